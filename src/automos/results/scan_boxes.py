"""The objects of one scan: boxes, verdicts and velocities, as columns or one by one."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.geometry import make_transform
from automos.core.scan import Pose
from automos.core.upright_boxes import Boxes
from automos.objects.kinds import Kind
from automos.objects.verdict import Verdict
from automos.results.tracks_file import VERDICTS

_Vector = npt.NDArray[np.float64]


class Box(NamedTuple):
    """One object in one scan, in the frame that was requested: metres, radians, metres per second.

    `verdict` is one of `VERDICTS`, `score` its confidence; `is_observed` is False where the box was interpolated.
    """

    id: int
    verdict: str
    kind: Kind
    score: float
    center: _Vector
    size: _Vector
    yaw: float
    velocity: _Vector
    is_observed: bool

    @property
    def pose(self) -> Pose:
        """(4, 4) from the box, its centre the origin and x its heading, to the frame that it is in."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return make_transform([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], self.center)


@dataclass(frozen=True, eq=False)
class ScanBoxes:
    """The objects of one scan; as an iterable, a `Box` each.

    Attributes
    ----------
    boxes : Boxes
        K boxes in the requested frame; the score is the confidence of the verdict.
    ids : (K,) int64
        Track ids, from 1.
    verdict : (K,) int8
        Index into `VERDICTS`.
    kind : (K,) int8
        Of `Kind`, the likeliest.
    velocity : (K, 3) float64
        Metres per second, in the same frame.
    observed : (K,) bool
        False if the object has no points in this scan and its box was interpolated.
    """

    boxes: Boxes
    ids: npt.NDArray[np.int64]
    verdict: npt.NDArray[np.int8]
    kind: npt.NDArray[np.int8]
    velocity: npt.NDArray[np.float64]
    observed: npt.NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.ids)

    def __iter__(self) -> Iterator[Box]:
        boxes = self.boxes
        parts = (boxes.score.tolist(), boxes.center, boxes.size, boxes.yaw.tolist(), self.velocity)
        columns = (self.ids.tolist(), self.verdict, self.kind, *parts, self.observed.tolist())
        for id, verdict, kind, *rest in zip(*columns, strict=True):
            yield Box(id, VERDICTS[verdict], Kind(kind), *rest)

    @property
    def moving(self) -> list[Box]:
        """Those that move: motion says nothing of what stands, be it a parked car or a bush."""
        return [box for box in self if box.verdict == VERDICTS[Verdict.MOVING]]
