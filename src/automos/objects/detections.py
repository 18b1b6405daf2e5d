"""The segments of one scan as input of the tracker: boxes, and the evidence on each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from automos.core.scan import Pose
from automos.core.upright_boxes import Boxes
from automos.objects.outlines import corners


@dataclass(frozen=True, eq=False)
class Detections:
    """The segments of one scan that may be objects.

    Attributes
    ----------
    boxes : Boxes
        The boxes, level frame.
    n_points : (M,) float64
        Number of points of each segment.
    n_moving, n_static : (M,) float64
        Numbers of its points that have moved and that have stayed; the others are unknown.
    has_stayed : (M,) bool
        Whether the evidence alone makes it static; a moving track may still contain it.
    part_of : (M,) int32
        The stayed segment that it was cut out of, -1 for none.
    lift : (M,) float64
        Metres from the ground to its lowest point.
    solidity : (M,) float64
        In [0, 1], mean over its points of the share of adjacent rays that ended beside the point.
    hidden : (M, 2) bool
        Whether something nearer is beside its left and its right end, seen from the sensor.
    sensor : (M, 2) float64
        Metres, level frame: from where it was seen.
    outline : (M, K, 2) float32
        Metres, level frame: where its outermost points are, from the centre of its box, see `outlines`.
    """

    boxes: Boxes
    n_points: npt.NDArray[np.float64]
    n_moving: npt.NDArray[np.float64]
    n_static: npt.NDArray[np.float64]
    has_stayed: npt.NDArray[np.bool_]
    part_of: npt.NDArray[np.int32]
    lift: npt.NDArray[np.float64]
    solidity: npt.NDArray[np.float64]
    hidden: npt.NDArray[np.bool_]
    sensor: npt.NDArray[np.float64]
    outline: npt.NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.boxes)

    def __getitem__(self, rows: npt.NDArray) -> Detections:
        return Detections(self.boxes[rows], *(getattr(self, name)[rows] for name in _COLUMNS))

    def moved(self, T: Pose) -> Detections:
        """Return them where the scan is elsewhere, by the (4, 4) `T` of the level frame."""
        sensor, outline = self.sensor @ T[:2, :2].T + T[:2, 3], self.outline @ T[:2, :2].T.astype(np.float32)
        return replace(self, boxes=self.boxes.transformed(T), sensor=sensor, outline=outline)

    @property
    def moving_share(self) -> npt.NDArray[np.float64]:
        """(M,) in [0, 1]: share of moved points among the known ones, shrunk to 0.5 if few are known."""
        return (self.n_moving + 1.0) / (self.n_moving + self.n_static + 2.0)

    @staticmethod
    def of_objects(
        boxes: Boxes,
        n_points: npt.NDArray[np.float64],
        n_moving: npt.NDArray[np.float64],
        n_static: npt.NDArray[np.float64],
        lift: npt.NDArray[np.float64] | None = None,
        solidity: npt.NDArray[np.float64] | None = None,
        hidden: npt.NDArray[np.bool_] | None = None,
        sensor: tuple[float, float] = (0.0, 0.0),
        outline: npt.NDArray[np.float32] | None = None,
    ) -> Detections:
        """Return segments that may all be objects, none a part of another; by default solid boxes on the ground."""
        n = len(boxes)
        lift = np.zeros(n) if lift is None else lift
        solidity = np.ones(n) if solidity is None else solidity
        hidden = np.zeros((n, 2), np.bool_) if hidden is None else hidden
        outline = corners(boxes) if outline is None else outline
        nothing_stayed, whole, seen_from = np.zeros(n, np.bool_), np.full(n, -1, np.int32), np.tile(sensor, (n, 1))
        shown = lift, solidity, hidden, seen_from, outline
        return Detections(boxes, n_points, n_moving, n_static, nothing_stayed, whole, *shown)

    @staticmethod
    def nothing() -> Detections:
        """Return no segments."""
        return Detections.of_objects(Boxes.empty(), *np.zeros((3, 0)))

    @staticmethod
    def columns() -> tuple[str, ...]:
        """Return the names of the arrays that `to_arrays` returns."""
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
        """Return the detections saved by `to_arrays`."""
        return Detections(Boxes.from_arrays(arrays), *(arrays[name] for name in _COLUMNS))


_COLUMNS = tuple(f.name for f in fields(Detections) if f.name != "boxes")
