"""Boxes that people drew, made into a label for every point: the truth of recordings that came without one per point.

As SemanticKITTI has it, an object that moves at any time of the recording is moving in every scan. Boxes are drawn a
few centimetres off and rest on the ground: what lies just outside a mover's box or at its very bottom is unlabeled.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.column_data import ColumnData
from automos.core.errors import InputError
from automos.core.geometry import FARTHEST, Array, transform
from automos.core.label_files import pack
from automos.core.labels import Label
from automos.core.reading import damage_reported, is_there, read_json
from automos.core.scan import MAX_RANGE, Ints, Pose, Scan, Sequence
from automos.core.upright_boxes import Boxes, TrueBoxes, points_in_boxes
from automos.readers.stamped_poses import rigid_transforms

PACE = 1.0
"""Seconds over which a box must get on to have moved; a shorter track is judged over its whole length."""
MOVED = 0.5
"""Metres: a box that gets further than this within PACE moves. Argoverse 2 calls points above 0.5 m/s dynamic."""
STOOD = 0.25
"""Metres: a box that never gets further than this within PACE stands; between the two it is not known."""
MARGIN = 0.3
"""Metres around a mover's box that are left unlabeled."""
SOLE = 0.2
"""Metres at the bottom of a mover's box that are left unlabeled: wheels, feet and the ground between them."""


@dataclass(frozen=True, eq=False)
class DrawnBoxes(ColumnData):
    """The boxes of a recording, a row each.

    Attributes
    ----------
    scan : (R,) which scan each was drawn in: its index, time or name, as the format has it.
    track : (R,) int64, which object it is of, from 1.
    boxes : R boxes, each in a frame of its scan in which they stand upright.
    label : (R,) uint8, the `Label` of its object.
    """

    scan: npt.NDArray
    track: Ints
    boxes: Boxes
    label: npt.NDArray[np.uint8]

    @classmethod
    def judged(
        cls, scan: npt.NDArray, objects: npt.NDArray, boxes: Boxes, seconds: Array, T_world_boxes: Pose
    ) -> DrawnBoxes:
        """Return R boxes of `objects` (R,), ids of any kind, each judged by how it moves in the world.

        Parameters
        ----------
        seconds : (R,) when each box was seen.
        T_world_boxes : (R, 4, 4) from the frame of each box, or (4, 4) from that of all.
        """
        _, track = np.unique(objects, return_inverse=True)
        return cls(scan, track + 1, boxes, judge_boxes(track, seconds, centers_in_world(T_world_boxes, boxes.center)))

    def of(self, scan: int | str) -> DrawnBoxes:
        """Return the boxes drawn in one scan."""
        return self[np.flatnonzero(self.scan == scan)]

    def track_at(self, points: npt.NDArray) -> Ints:
        """Return (N,) which object's box each of `points` (N, 3) is in, 0 in none; all boxes being of their scan."""
        return np.append(self.track, 0)[points_in_boxes(points, self.boxes)].astype(np.int64)


def checked_boxes(center: npt.NDArray, size: npt.NDArray, yaw: npt.NDArray, path: Path) -> Boxes:
    """Return the boxes (R, 3), (R, 3), (R,) that the file at `path` holds, in its frame.

    Raises
    ------
    InputError
        One of them is nowhere, has no size or no heading.
    """
    has_place = (np.abs(center) < FARTHEST).all(axis=1) & (np.abs(yaw) < FARTHEST)
    has_size = ((size >= 0.0) & (size < MAX_RANGE)).all(axis=1)
    if not (has_place & has_size).all():
        raise InputError(f"{path} has a box that is nowhere or has no size; download it again")
    return Boxes(center, size, yaw, np.ones(len(yaw)))


def judge_boxes(track: Ints, time: Array, center_world: Array) -> npt.NDArray[np.uint8]:
    """Return for each box the `Label` of its track: MOVING, STATIC, or UNLABELED if that is not known.

    Parameters
    ----------
    track : (R,) which object each box is of.
    time : (R,) seconds.
    center_world : (R, 3) metres, in a frame that stands still.

    Returns
    -------
    (R,) uint8.
    """
    label = np.empty(len(track), np.uint8)
    order = np.lexsort((time, track))
    for rows in np.split(order, np.flatnonzero(np.diff(track[order])) + 1):
        if len(rows):
            label[rows] = _judge(time[rows], center_world[rows])
    return label


def _judge(time: Array, center: Array) -> Label:
    later = np.minimum(np.searchsorted(time, time + PACE - 1e-6), len(time) - 1)
    steps = np.linalg.norm(center[later] - center, axis=1)
    seconds = np.maximum((time[later] - time) / PACE, 1.0)  # boxes further apart than PACE: metres per PACE
    got_on = float((steps / seconds).max())
    if got_on > MOVED:
        return Label.MOVING
    return Label.STATIC if got_on < STOOD and time[-1] - time[0] >= 0.5 * PACE else Label.UNLABELED


def centers_in_world(T_world_sensor: Pose, center: Array) -> Array:
    """Return (R, 3) centres in the world, of centres (R, 3) in the sensor's frame at poses (R, 4, 4)."""
    return np.einsum("...ij,...j->...i", T_world_sensor[..., :3, :3], center) + T_world_sensor[..., :3, 3]


def paint_boxes(scan: Scan, T_boxes_sensor: Pose, drawn: DrawnBoxes) -> npt.NDArray[np.uint32]:
    """Return the labels of a scan's points from the boxes drawn around its objects.

    Parameters
    ----------
    T_boxes_sensor : (4, 4), from the scan's frame to that of the boxes, in which they stand upright.
    drawn : the boxes of this scan.

    Returns
    -------
    (N,) uint32 as SemanticKITTI stores them; STATIC outside all boxes, UNLABELED for points without a return.
    """
    points = transform(T_boxes_sensor, np.where(scan.is_valid[:, None], scan.points, np.float32(0.0)))
    is_mover = drawn.label != Label.STATIC
    static, movers = drawn[~is_mover], drawn[is_mover]
    label = np.full(len(scan), Label.STATIC, np.uint8)
    instance = static.track_at(points)

    label[points_in_boxes(points, movers.boxes, MARGIN) >= 0] = Label.UNLABELED
    owner = points_in_boxes(points, movers.boxes)
    inside = owner >= 0
    own, sole = owner[inside], movers.boxes.center[:, 2] - 0.5 * movers.boxes.size[:, 2] + SOLE
    label[inside] = np.where(points[inside, 2] < sole[own], Label.UNLABELED, movers.label[own])
    instance[inside] = movers.track[own]

    label[~scan.is_valid], instance[~scan.is_valid] = Label.UNLABELED, 0
    return pack(label, instance)


class DrawnTruth(Sequence):
    """A recording whose truth is boxes; readers derive from it, and say which were drawn in a scan."""

    def _boxes_of(self, index: int) -> tuple[DrawnBoxes, Pose] | None:
        """Return the boxes of scan `index` and (4, 4) T_boxes_sensor; None where nobody drew any."""
        raise NotImplementedError

    def _judged(self, index: int, scan: Scan, labels: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
        """Return the labels (N,) of scan `index` without those of points at which nobody looked: all by default."""
        return labels

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return (N,) uint32 labels of scan `index` from its boxes; None without."""
        index = self._scan_number(index)
        found = self._boxes_of(index)
        if found is None:
            return None
        scan, (drawn, T_boxes_sensor) = self[index], found
        return self._judged(index, scan, paint_boxes(scan, T_boxes_sensor, drawn))

    def truth_boxes(self, index: int) -> TrueBoxes | None:
        """Return the boxes of scan `index`; None without."""
        found = self._boxes_of(self._scan_number(index))
        return None if found is None else TrueBoxes(found[0].track, found[0].boxes, found[1])


def motion_with_boxes(
    points: npt.NDArray,
    instance: Ints,
    now: tuple[Ints, Boxes],
    later: tuple[Ints, Boxes],
) -> npt.NDArray[np.float32]:
    """Return (N, 3) metres that points move with the boxes they are in, as rigid things do.

    Parameters
    ----------
    points : (N, 3) metres, in a frame that stands still and in which boxes stand upright.
    instance : (N,) the object each point is on, 0 for none, which does not move.
    now, later : (K,) ids and boxes of the points' scan and of the next one, in the points' frame.

    Returns
    -------
    NaN for points on an object that one of the two has no box of.
    """
    motion = np.zeros((len(points), 3), np.float32)
    motion[instance > 0] = np.nan
    for track, row, other in zip(*np.intersect1d(now[0], later[0], return_indices=True), strict=True):
        on_it = instance == track
        turn = later[1].yaw[other] - now[1].yaw[row]
        c, s = np.cos(turn), np.sin(turn)
        arm = points[on_it] - now[1].center[row]
        turned = arm @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        motion[on_it] = turned - arm + (later[1].center[other] - now[1].center[row])
    return motion


def boxes_beside(source: Path, name: str) -> TrueBoxes | None:
    """Return the boxes that `source` has of scan `name`; None without, InputError where they are damaged."""
    path = source / "boxes" / f"{name}.json"
    if not is_there(path):
        return None  # before anything is read: few recordings have boxes, and all their scans are asked
    with damage_reported(path, "is not a file of boxes", "simulate the recording again"):
        document = read_json(path)
        rows = document["boxes"]
        columns = [np.array([row[key] for row in rows], np.float64) for key in ("center", "size", "yaw")]
        ids = np.array([row["id"] for row in rows], np.int64)
        center, size, yaw = columns[0].reshape(-1, 3), columns[1].reshape(-1, 3), columns[2].reshape(len(ids))
        T_level_sensor = np.array(document["T_level_sensor"], np.float64).reshape(4, 4)
    return TrueBoxes(ids, checked_boxes(center, size, yaw, path), rigid_transforms(T_level_sensor[None], path)[0])


def motion_beside(source: Path, sequence: Sequence, index: int) -> npt.NDArray[np.float32] | None:
    """Return what `Sequence.truth_motion` does, of the boxes in `source`; None without boxes or instance ids.

    Raises
    ------
    InputError : a file of boxes that is damaged.
    """
    names = sequence.names
    now = boxes_beside(source, names[index])
    truth = None if now is None else sequence.truth(index)
    if now is None or truth is None:
        return None
    later = boxes_beside(source, names[index + 1]) if index + 1 < len(names) else None
    of_later = (np.zeros(0, np.int64), Boxes.empty()) if later is None else later[:2]
    points = transform(now.T_boxes_sensor, sequence[index].points)
    motion = motion_with_boxes(points, (truth >> 16).astype(np.int64), now[:2], of_later)
    motion = motion @ now.T_boxes_sensor[:3, :3].astype(np.float32)
    motion[(truth & 0xFFFF) == Label.UNLABELED] = np.nan
    return motion
