"""Objects that a person proposes: a cluster or a box, tracked through the recording, with its points.

The tracker is offered a whole segment and the pieces that the evidence cut out of it; a click selects the smallest
segment that holds the point. Points that already belong to a moving object stay with it: where the path of the new
object enters a moving one, it ends.
"""

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.scan import OBJECT
from automos.core.upright_boxes import Boxes, points_in_boxes
from automos.objects.boxes import fit_boxes
from automos.objects.detections import Detections
from automos.objects.labels import label_scans
from automos.objects.tracking import TrackedObjects
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts
from automos.readers.box_truth import SOLE
from automos.review.amendments import Amendment, Part
from automos.review.apply import Changes, decided_verdicts, parts_in
from automos.review.follow import Detect, follow_segment
from automos.review.log import now
from automos.review.run_stages import RunStages

REACH = 1.5
"""Metres around a click within which a point is looked for."""
GAP = 0.5
"""Metres between neighbours of a cluster where the run has no segment."""
MAX_TALL = 4.5
"""Metres above its lowest point that a drawn box may hold."""
MAX_GAP = 1.5
"""Seconds for which it may be out of sight: a person sees what it is taken for afterwards, and where it ends."""
MIN_OWN = 0.5
"""Share of its points that must not move with something else already."""
_NEW = -2
"""Segment that a person drew, which the run does not have."""


class Proposer:
    """Makes proposals for one run; keeps the segments of scans it has read."""

    def __init__(self, stages: RunStages):
        """Take the run's stages, for this thread alone."""
        self._stages = stages
        self.detections = lru_cache(4000)(self._detections)

    def _detections(self, index: int) -> Detections:
        stage = self._stages.stage("instances")
        return Detections.from_arrays(stage.load(self._stages.names[index], *Detections.columns()))

    # ------------------------------------------------------------------------------------------------- what is shown
    def at(self, index: int, x: float, y: float, changes: Changes) -> Amendment:
        """Return the thing at (`x`, `y`), metres in the level frame, in scan `index`, followed through time.

        Raises
        ------
        InputError
            Nothing stands there.
        """
        rows, segment = self._cluster(index, x, y)
        return self._followed(index, rows, segment, changes)

    def rows_at(self, index: int, x: float, y: float) -> npt.NDArray[np.int64]:
        """Return the rows, of scan `index` as the recording has it, of the thing at (`x`, `y`); errors as of `at`."""
        rows, segment = self._cluster(index, x, y)
        if segment == _NEW:
            return self._stages.kept(index)[rows]
        found = self.detections(index).boxes
        box = np.array([*found.center[segment], *found.size[segment], found.yaw[segment]])
        return self._painted(index, segment, box)

    def in_boxes(self, boxes: dict[int, npt.NDArray[np.float64]], changes: Changes) -> Amendment:
        """Return what is in boxes (5,) that a person drew: x, y, length, width, yaw by scan; level frame.

        One box is followed through time as what it holds; between several, the box goes straight from one to the next.

        Raises
        ------
        InputError
            Nothing stands in a box.
        """
        upright = {index: self._upright(index, box) for index, box in sorted(boxes.items())}
        if len(upright) > 1:
            return self._between(upright, changes)
        ((index, box),) = upright.items()
        rows = self._rows_in(index, box)
        return self._followed(index, rows, self._segment_of(index, rows), changes)

    def from_segment(self, index: int, segment: int, changes: Changes) -> Amendment:
        """Return `segment` of scan `index`, followed through time."""
        return self._followed(index, self._rows_of_segment(index, segment), segment, changes)

    # ----------------------------------------------------------------------------------------------------- a cluster
    def _cluster(self, index: int, x: float, y: float) -> tuple[npt.NDArray[np.int64], int]:
        """Return the frame's rows of the thing nearest to a click, and its segment, `_NEW` if it has none."""
        points, is_object = self._frame(index)
        away = np.hypot(points[:, 0] - x, points[:, 1] - y)
        near = np.flatnonzero(is_object & (away < REACH))
        if not len(near):
            raise InputError("nothing stands there: click on a point that is not ground, or draw a box")
        nearest = near[away[near].argmin()]
        ids, stayed = self._segments(index)
        segment = ids[nearest] if ids[nearest] >= 0 else stayed[nearest]
        if segment >= 0:
            return self._rows_of_segment(index, int(segment)), int(segment)
        return _grown(points, is_object & (ids < 0), int(nearest)), _NEW

    def _segment_of(self, index: int, rows: npt.NDArray[np.int64]) -> int:
        """Return the segment that `rows` are most of and that is most of `rows`, `_NEW` if there is none."""
        best, best_share = _NEW, 0.5
        for ids in self._segments(index):
            inside = ids[rows]
            held = np.bincount(inside[inside >= 0], minlength=1)
            segment = int(held.argmax())
            share = held[segment] / max(len(rows), int((ids == segment).sum()), 1)
            if share > best_share:
                best, best_share = segment, share
        return best

    def _rows_of_segment(self, index: int, segment: int) -> npt.NDArray[np.int64]:
        ids, stayed = self._segments(index)
        return np.flatnonzero((ids == segment) | (stayed == segment))

    # --------------------------------------------------------------------------------------------------- through time
    def _followed(self, index: int, rows: npt.NDArray[np.int64], segment: int, changes: Changes) -> Amendment:
        detect: Detect = self.detections
        if segment == _NEW:
            drawn = self._described(index, rows)
            segment = len(self.detections(index))
            with_drawn = Detections.concatenate([self.detections(index), drawn])
            detect = lambda i: with_drawn if i == index else self.detections(i)  # noqa: E731
        stamps, follow = self._stages.trajectory.stamps, self._stages.settings.tracking
        settings = follow.model_copy(update={"max_gap": max(follow.max_gap, MAX_GAP)})
        path = follow_segment(detect, stamps, index, segment, settings)
        parts = {}
        for way in ([i for i in path if i >= index], [i for i in reversed(path) if i < index]):
            for i in way:
                own, box = path[i]
                if own < 0:
                    continue
                is_drawn = i == index and own >= len(self.detections(index))
                found = self._stages.kept(i)[rows] if is_drawn else self._painted(i, own, box)
                free = found[~self._moves_already(i, changes)[found]]
                if i != index and len(free) < MIN_OWN * len(found):
                    break
                if len(free):
                    parts[self._stages.names[i]] = Part.of_box(free, box, self._stages.trajectory.T_level_sensor[i])
        if not parts:
            raise InputError("what stands there moves already: choose it in the list")
        return _proposed(parts)

    def _between(self, boxes: dict[int, npt.NDArray[np.float64]], changes: Changes) -> Amendment:
        keys = np.array(list(boxes))
        corners = np.array(list(boxes.values()))
        corners[:, 6] = np.unwrap(corners[:, 6], period=np.pi)  # a box turned by half a turn is the same box
        stamps = self._stages.trajectory.stamps
        parts = {}
        for i in range(keys[0], keys[-1] + 1):
            box = np.array([np.interp(stamps[i], stamps[keys], column) for column in corners.T])
            found = self._stages.kept(i)[self._rows_in(i, box, may_be_empty=True)]
            free = found[~self._moves_already(i, changes)[found]]
            if len(free):
                parts[self._stages.names[i]] = Part.of_box(free, box, self._stages.trajectory.T_level_sensor[i])
        return _proposed(parts)

    def _painted(self, index: int, segment: int, box: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
        """Return the scan's rows that the run would have painted, had it found a moving track in this segment."""
        stages = self._stages
        one = np.zeros(1, np.int64)
        fast = np.full((1, 3), np.inf)  # whatever counts as moving now
        track = Tracks(one, np.array([index]), np.array([segment]), box[None, :3], box[None, 3:6], box[6:], fast)
        judged = Verdicts(np.array([Verdict.MOVING], np.int8), np.ones(1))
        painted = label_scans(stages.scans, TrackedObjects(track, judged), stages.settings, 1, [index])
        return np.flatnonzero(next(iter(painted))[1]["track"] == 0)

    def _moves_already(self, index: int, changes: Changes) -> npt.NDArray[np.bool_]:
        owner = self._stages.owner_of_points(index)
        is_moving = decided_verdicts(self._stages.verdicts, changes.decided).verdict == Verdict.MOVING
        moves = np.append(is_moving, False)[owner]  # owner -1 reads the last
        for amendment, rows in parts_in(self._stages, index, changes):
            moves[rows] = amendment.verdict == "moving"
        return moves

    # --------------------------------------------------------------------------------------------------- of one scan
    def _frame(self, index: int) -> tuple[npt.NDArray, npt.NDArray[np.bool_]]:
        kind = self._stages.stage("candidates").load(self._stages.names[index], "kind")["kind"]
        return self._stages.frame(index).points_level, kind == OBJECT

    def _segments(self, index: int) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        found = self._stages.stage("instances").load(self._stages.names[index], "ids", "stayed")
        return found["ids"], found["stayed"]

    def _upright(self, index: int, box: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return (7,): a box drawn on the ground (5,) as high as what stands in it."""
        points, is_object = self._frame(index)
        x, y, length, width, yaw = box
        tall = np.array([x, y, 0.0, max(length, 0.1), max(width, 0.1), 2e3, yaw])
        inside = _inside(points, tall)
        standing = inside & is_object
        if not standing.any():
            raise InputError("nothing stands in that box: draw it around points that are not ground")
        low = float(np.percentile(points[inside, 2], 2))
        top = points[standing & (points[:, 2] < low + MAX_TALL), 2].max(initial=low + 0.1)
        return np.array([x, y, 0.5 * (low + top), tall[3], tall[4], top - low, yaw])

    def _rows_in(self, index: int, box: npt.NDArray[np.float64], may_be_empty: bool = False) -> npt.NDArray[np.int64]:
        """Return the frame's rows in an upright box (7,), without the ground under it."""
        points, is_object = self._frame(index)
        bottom = box[2] - 0.5 * box[5]
        rows = np.flatnonzero(_inside(points, box) & (is_object | (points[:, 2] > bottom + SOLE)))
        if not len(rows) and not may_be_empty:
            raise InputError("nothing stands in that box: draw it around points that are not ground")
        return rows

    def _described(self, index: int, rows: npt.NDArray[np.int64]) -> Detections:
        """Return `rows` of a frame as a segment."""
        points, _ = self._frame(index)
        boxes = fit_boxes(points[rows], np.zeros(len(rows), np.int32), np.ones(1))
        n = np.array([float(len(rows))])
        return Detections.of_objects(boxes, n, n, np.zeros(1))


def _proposed(parts: dict[str, Part]) -> Amendment:
    return Amendment("", now(), "added", "moving", dict(sorted(parts.items())))


def _inside(points: npt.NDArray, box: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    return points_in_boxes(points, Boxes(box[None, :3], box[None, 3:6], box[6:], np.ones(1)), 0.05) >= 0


def _grown(points: npt.NDArray, is_free: npt.NDArray[np.bool_], start: int) -> npt.NDArray[np.int64]:
    """Return the rows of the free points that hang together with `start` without a gap."""
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    near = np.flatnonzero(is_free & (np.abs(points[:, :2] - points[start, :2]).max(axis=1) < 10.0))
    pairs = cKDTree(points[near]).sparse_distance_matrix(cKDTree(points[near]), GAP)
    _, part = connected_components(pairs, directed=False)
    return near[part == part[np.searchsorted(near, start)]]
