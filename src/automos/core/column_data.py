"""Data classes whose fields are columns: arrays with one row for each thing."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class ColumnData:
    """Base of a data class of columns: some of its rows, several of them joined, saving and loading."""

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))

    def __getitem__(self, rows: npt.NDArray | slice) -> Self:
        return type(self)(*(getattr(self, f.name)[rows] for f in fields(self)))

    @classmethod
    def concatenate(cls, parts: list[Self]) -> Self:
        """Return the rows of all `parts`, at least one, in order."""
        return cls(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(cls)))

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return the columns by name, for saving."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, npt.NDArray]) -> Self:
        """Return the columns saved by `to_arrays`."""
        return cls(*(np.asarray(arrays[f.name]) for f in fields(cls)))
