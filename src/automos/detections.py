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
    """

    boxes: Boxes
    n_points: npt.NDArray[np.float64]
    n_moving: npt.NDArray[np.float64]
    n_static: npt.NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.boxes)

    @property
    def moving_share(self) -> npt.NDArray[np.float64]:
        """(M,) in [0, 1]: moving among the points the evidence speaks of, shrunk to 0.5 where it says little."""
        return (self.n_moving + 1.0) / (self.n_moving + self.n_static + 2.0)

    @staticmethod
    def columns() -> tuple[str, ...]:
        """Return the names of the arrays that `to_arrays` gives."""
        return ("center", "size", "yaw", "score", "n_points", "n_moving", "n_static")

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return the columns by name, for saving."""
        counts = {"n_points": self.n_points, "n_moving": self.n_moving, "n_static": self.n_static}
        return {**self.boxes.to_arrays(), **counts}

    @staticmethod
    def from_arrays(arrays: Mapping[str, npt.NDArray]) -> Detections:
        """Return the detections that `to_arrays` took apart."""
        return Detections(Boxes.from_arrays(arrays), arrays["n_points"], arrays["n_moving"], arrays["n_static"])
