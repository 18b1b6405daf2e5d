"""The segments of one scan as the tracker sees them: boxes, and what the evidence says of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from automos.upright_boxes import Boxes


@dataclass(frozen=True, eq=False)
class Detections:
    """The segments of one scan that may be objects.

    Attributes
    ----------
    boxes : Boxes
        Their boxes, level frame.
    n_points : (M,) float64
        How many points each has.
    n_moving, n_static : (M,) float64
        How many of them the evidence calls moving and static; the others are unknown.
    has_stayed : (M,) bool
        Whether the evidence alone would call it static; tracks that move may still end in it.
    part_of : (M,) int32
        The segment that has stayed which it was cut out of, -1 for none.
    lift : (M,) float64
        Metres from the ground up to its lowest point.
    solidity : (M,) float64
        In [0, 1], mean over its points of the share of rays beside each that ended beside it.
    """

    boxes: Boxes
    n_points: npt.NDArray[np.float64]
    n_moving: npt.NDArray[np.float64]
    n_static: npt.NDArray[np.float64]
    has_stayed: npt.NDArray[np.bool_]
    part_of: npt.NDArray[np.int32]
    lift: npt.NDArray[np.float64]
    solidity: npt.NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.boxes)

    def __getitem__(self, rows: npt.NDArray) -> Detections:
        return Detections(self.boxes[rows], *(getattr(self, name)[rows] for name in _COLUMNS))

    @property
    def moving_share(self) -> npt.NDArray[np.float64]:
        """(M,) in [0, 1]: moving among the points the evidence speaks of, shrunk to 0.5 where it says little."""
        return (self.n_moving + 1.0) / (self.n_moving + self.n_static + 2.0)

    @staticmethod
    def of_objects(
        boxes: Boxes,
        n_points: npt.NDArray[np.float64],
        n_moving: npt.NDArray[np.float64],
        n_static: npt.NDArray[np.float64],
        lift: npt.NDArray[np.float64] | None = None,
        solidity: npt.NDArray[np.float64] | None = None,
    ) -> Detections:
        """Return segments all of which may be objects, none a part of another; solid, on the ground if not given."""
        n = len(boxes)
        lift = np.zeros(n) if lift is None else lift
        solidity = np.ones(n) if solidity is None else solidity
        nothing_stayed, whole = np.zeros(n, np.bool_), np.full(n, -1, np.int32)
        return Detections(boxes, n_points, n_moving, n_static, nothing_stayed, whole, lift, solidity)

    @staticmethod
    def nothing() -> Detections:
        """Return no segments."""
        return Detections.of_objects(Boxes.empty(), *np.zeros((3, 0)))

    @staticmethod
    def columns() -> tuple[str, ...]:
        """Return the names of the arrays that `to_arrays` gives."""
        return (*(f.name for f in fields(Boxes)), *_COLUMNS)

    @staticmethod
    def concatenate(parts: list[Detections]) -> Detections:
        """Return the segments of all `parts`, in order."""
        joined = (np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS)
        return Detections(Boxes.concatenate([part.boxes for part in parts]), *joined)

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return the columns by name, for saving."""
        return {**self.boxes.to_arrays(), **{name: getattr(self, name) for name in _COLUMNS}}

    @staticmethod
    def from_arrays(arrays: Mapping[str, npt.NDArray]) -> Detections:
        """Return the detections that `to_arrays` took apart."""
        return Detections(Boxes.from_arrays(arrays), *(arrays[name] for name in _COLUMNS))


_COLUMNS = tuple(f.name for f in fields(Detections) if f.name != "boxes")
