"""The objects of a run: those of one scan, as columns or one by one; all of them as arrays, and as one table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.column_data import ColumnData
from automos.core.extras import import_extra
from automos.core.geometry import upright_pose
from automos.core.scan import Array, Ints, Mask, Pose
from automos.core.upright_boxes import Boxes
from automos.objects.kinds import Kind, likeliest
from automos.objects.verdict import Verdict
from automos.results.tracks_file import MIN_SIDE, VERDICTS

if TYPE_CHECKING:
    import pandas as pd

_Vector = Array


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
        return upright_pose((np.cos(self.yaw), np.sin(self.yaw)), self.center)


@dataclass(frozen=True, eq=False)
class ScanBoxes(ColumnData):
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
    ids: Ints
    verdict: npt.NDArray[np.int8]
    kind: npt.NDArray[np.int8]
    velocity: Array
    observed: Mask

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


@dataclass(frozen=True, eq=False)
class Object:
    """One object of a run and its K boxes in the level frame: z up, the ground under the first scan at z = 0.

    Attributes
    ----------
    id : int
        Number of the object, from 1.
    verdict : str
        "moving" if it moved at some time while it was observed, else "static", or "unknown".
    p_moved : float
        Probability in [0, 1] that it moved at some time.
    kinds : dict of str to float
        Probability of each kind: car, large_vehicle, two_wheeler, person, other. Empty if the run does not say.
    scans : (K,) int64
        Number of the scan that each box is in, ascending.
    stamps : (K,) float64
        Times of these scans, seconds.
    boxes : Boxes
        `center` (K, 3) and `size` (K, 3: length, width, height) in metres, `yaw` (K,) in radians about z, and `score`
        (K,), the confidence of the verdict.
    velocity : (K, 3) float64
        Metres per second.
    p_moving : (K,) float64
        Probability that it moves in each of the scans.
    observed : (K,) bool
        False where it has no points in the scan, and its box was interpolated.
    """

    id: int
    verdict: str
    p_moved: float
    kinds: dict[str, float]
    scans: Ints
    stamps: Array
    boxes: Boxes
    velocity: Array
    p_moving: Array
    observed: Mask

    @staticmethod
    def of_track(track: dict[str, Any]) -> Object:
        """Return the object that tracks.json tells of as `track`."""
        rows = sorted(track["boxes"], key=lambda box: box["scan"])
        column = lambda name, kind=np.float64: np.array([box[name] for box in rows], kind)  # noqa: E731
        sure = np.full(len(rows), float(track["confidence"]))
        return Object(
            id=track["id"],
            verdict=track["verdict"],
            p_moved=track.get("p_moved", 0.0),
            kinds=track.get("kind", {}),
            scans=column("scan", np.int64),
            stamps=column("stamp"),
            boxes=Boxes(column("center"), column("size"), column("yaw"), sure),
            velocity=column("velocity"),
            p_moving=np.array([box.get("p_moving", 0.0) for box in rows]),
            observed=column("observed", np.bool_),
        )

    def __len__(self) -> int:
        return len(self.scans)

    def __repr__(self) -> str:
        return f"<Object {self.id}: {self.kind}, {self.verdict}, moved with p = {self.p_moved:.2f}, {len(self)} boxes>"

    @property
    def kind(self) -> str:
        """The likeliest kind."""
        return likeliest(self.kinds).name.lower()

    @property
    def moves(self) -> Mask:
        """(K,) whether it moves in each of the scans; all False unless its verdict is "moving"."""
        return (self.p_moving >= 0.5) & (self.verdict == "moving")


def boxes_by_scan(objects: Sequence[Object]) -> tuple[Ints, ScanBoxes]:
    """Return the scan of each box of all `objects`, ascending, and the boxes; sides are `MIN_SIDE` at least."""
    told = [(one.id, VERDICTS.index(one.verdict), likeliest(one.kinds)) for one in objects]
    each = np.array([len(one) for one in objects], np.int64)
    ids, verdict, kind = np.repeat(np.array(told, np.int64).reshape(-1, 3), each, axis=0).T
    scans = np.concatenate([np.zeros(0, np.int64), *(one.scans for one in objects)])
    boxes = Boxes.concatenate([one.boxes for one in objects])
    velocity = np.concatenate([np.zeros((0, 3)), *(one.velocity for one in objects)])
    observed = np.concatenate([np.zeros(0, np.bool_), *(one.observed for one in objects)])
    wide = replace(boxes, size=np.maximum(boxes.size, MIN_SIDE))
    order = np.lexsort((ids, scans))
    found = ScanBoxes(wide, ids, verdict.astype(np.int8), kind.astype(np.int8), velocity, observed)
    return scans[order], found[order]


def table_of(objects: Sequence[Object]) -> pd.DataFrame:
    """Return a table with a row for every box; MissingExtraError if pandas is not installed."""
    pandas = import_extra("pandas", "pandas", "a table needs {}, which is not installed: {}")
    each = [len(found) for found in objects]
    of_boxes = ("scans", "stamps", "p_moving", "observed")
    of_objects = {"object": "id", "verdict": "verdict", "kind": "kind", "p_moved": "p_moved"}
    columns: dict[str, Any] = {
        name.removesuffix("s"): [x for found in objects for x in getattr(found, name)] for name in of_boxes
    }
    columns |= {name: np.repeat([getattr(one, of) for one in objects], each) for name, of in of_objects.items()}
    parts = [np.column_stack([f.boxes.center, f.boxes.size, f.boxes.yaw, f.velocity]) for f in objects]
    names = ("x", "y", "z", "length", "width", "height", "yaw", "vx", "vy", "vz")
    places = np.concatenate([np.zeros((0, len(names))), *parts])
    return pandas.DataFrame(columns | dict(zip(names, places.T, strict=True)))
