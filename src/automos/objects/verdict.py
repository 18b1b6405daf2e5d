"""The verdicts on tracks (moving, static or unknown) and their confidence."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from automos.core.column_data import ColumnData


class Verdict(IntEnum):
    """The verdict on a track."""

    UNKNOWN = 0
    STATIC = 1
    MOVING = 2


@dataclass(frozen=True, eq=False)
class Verdicts(ColumnData):
    """One row per track: verdict (T,) int8 of `Verdict`, confidence (T,) float64 in [0, 1].

    `scatter` (T,) float64, metres, is the standard deviation of its sights about its smoothed path; NaN if not given.
    """

    verdict: npt.NDArray[np.int8]
    confidence: npt.NDArray[np.float64]
    scatter: npt.NDArray[np.float64] = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.scatter is None:
            object.__setattr__(self, "scatter", np.full(len(self.verdict), np.nan))

    def __repr__(self) -> str:
        return f"<Verdicts: {', '.join(f'{(self.verdict == v).sum()} {v.name.lower()}' for v in Verdict)}>"

    @property
    def is_moving(self) -> npt.NDArray[np.bool_]:
        """(T,) whether each track has moved."""
        return self.verdict == Verdict.MOVING
