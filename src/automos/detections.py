"""What one scan offers to the tracker: boxes, and how the evidence speaks of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.geometry import Boxes


@dataclass(frozen=True, eq=False)
class Detections:
    """The segments of one scan that may be objects.

    Attributes
    ----------
    boxes : their boxes, level frame.
    n_points : (M,) how many points each has.
    n_moving, n_static : (M,) how many of them the evidence calls moving and static; the others are unknown.
    has_stayed : (M,) bool, whether the evidence alone would call it static; tracks that move may still end in it.
    """

    boxes: Boxes
    n_points: npt.NDArray[np.float64]
    n_moving: npt.NDArray[np.float64]
    n_static: npt.NDArray[np.float64]
    has_stayed: npt.NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.boxes)

    def __getitem__(self, rows: npt.NDArray) -> Detections:
        columns = (self.n_points, self.n_moving, self.n_static, self.has_stayed)
        return Detections(self.boxes[rows], *(column[rows] for column in columns))

    @property
    def moving_share(self) -> npt.NDArray[np.float64]:
        """(M,) in [0, 1]: moving among the points the evidence speaks of, shrunk to 0.5 where it says little."""
        return (self.n_moving + 1.0) / (self.n_moving + self.n_static + 2.0)

    @staticmethod
    def columns() -> tuple[str, ...]:
        """Return the names of the arrays that `to_arrays` gives."""
        return ("center", "size", "yaw", "score", "n_points", "n_moving", "n_static", "has_stayed")

    @staticmethod
    def concatenate(parts: list[Detections]) -> Detections:
        """Return the segments of all `parts`, in order."""
        columns = ("n_points", "n_moving", "n_static", "has_stayed")
        joined = (np.concatenate([getattr(part, name) for part in parts]) for name in columns)
        return Detections(Boxes.concatenate([part.boxes for part in parts]), *joined)

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return the columns by name, for saving."""
        counts = {"n_points": self.n_points, "n_moving": self.n_moving, "n_static": self.n_static}
        return {**self.boxes.to_arrays(), **counts, "has_stayed": self.has_stayed}

    @staticmethod
    def from_arrays(arrays: Mapping[str, npt.NDArray]) -> Detections:
        """Return the detections that `to_arrays` took apart."""
        columns = (arrays[name] for name in ("n_points", "n_moving", "n_static", "has_stayed"))
        return Detections(Boxes.from_arrays(arrays), *columns)
