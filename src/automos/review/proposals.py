"""Objects that a person proposes: a cluster or a box, tracked through the recording, with its points.

The tracker is offered a whole segment and the pieces that the evidence cut out of it; a click selects the smallest
segment that holds the point.
"""

from collections.abc import Callable
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
from automos.review.follow import follow_segment
from automos.review.reshaping import Found, OnScan, Way
from automos.review.run_stages import RunStages

REACH = 1.5
"""Metres around a click within which a point is looked for."""
GAP = 0.5
"""Metres between neighbours of a cluster where the run has no segment."""
MAX_TALL = 4.5
"""Metres above its lowest point that a drawn box may hold."""
MAX_GAP = 1.5
"""Seconds for which it may be out of sight: a person sees what it is taken for afterwards, and where it ends."""
_NEW = -2
"""Segment that a person drew, which the run does not have."""


class Proposer:
    """Makes proposals for one run; keeps the segments of scans it has read."""

    def __init__(self, stages: RunStages):
        """Take the run's stages."""
        self._stages = stages
        self.detections = lru_cache(4000)(stages.detections)

    # ------------------------------------------------------------------------------------------------- what is shown
    def at(self, index: int, x: float, y: float, on_scan: OnScan) -> Way:
        """Return the thing at (`x`, `y`), metres in the level frame, in scan `index`, followed through time.

        Raises
        ------
        InputError
            Nothing stands there.
        """
        rows, segment = self._cluster(index, x, y)
        return self._followed(index, rows, segment, on_scan)

    def rows_at(self, index: int, x: float, y: float) -> npt.NDArray[np.int64]:
        """Return the rows, of scan `index` as the recording has it, of the thing at (`x`, `y`); errors as of `at`."""
        rows, segment = self._cluster(index, x, y)
        if segment == _NEW:
            return self._stages.kept(index)[rows]
        found = self.detections(index).boxes
        box = np.array([*found.center[segment], *found.size[segment], found.yaw[segment]])
        return self._painted(index, segment, box)

    def in_boxes(self, boxes: tuple[tuple[int, tuple[float, ...]], ...], on_scan: OnScan) -> Way:
        """Return what is in boxes that a person drew: scan, and x, y, length, width, yaw; level frame.

        One box is followed through time as what it holds; between several, the box goes straight from one to the next.

        Raises
        ------
        InputError
            Nothing stands in a box.
        """
        upright = {index: self._upright(index, box) for index, box in sorted(boxes)}
        if len(upright) > 1:
            return self._between(upright, on_scan)
        ((index, box),) = upright.items()
        rows = self._rows_in(index, box)
        return self._followed(index, rows, self._segment_of(index, rows), on_scan)

    def from_segment(self, index: int, segment: int, on_scan: OnScan) -> Way:
        """Return `segment` of scan `index`, followed through time."""
        return self._followed(index, self._rows_of_segment(index, segment), segment, on_scan)

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
    def _followed(self, index: int, rows: npt.NDArray[np.int64], segment: int, on_scan: OnScan) -> Way:
        first = self.detections(index)
        if segment == _NEW:
            segment = len(first)
            first = Detections.concatenate([first, self._described(index, rows)])

        def detect(i: int) -> Detections:
            on_scan(0)
            return first if i == index else self.detections(i)

        stamps, follow = self._stages.trajectory.stamps, self._stages.settings.tracking
        settings = follow.model_copy(update={"max_gap": max(follow.max_gap, MAX_GAP)})
        path = follow_segment(detect, stamps, index, segment, settings)
        seen = {i: (own, box) for i, (own, box) in path.items() if own >= 0}

        def held(i: int) -> npt.NDArray[np.int64]:
            own, box = seen[i]
            is_drawn = i == index and own >= len(self.detections(index))
            return self._stages.kept(i)[rows] if is_drawn else self._painted(i, own, box)

        ways = [[i for i in seen if i >= index], [i for i in reversed(seen) if i < index]]
        return self._way(ways, {i: box for i, (_, box) in seen.items()}, held, on_scan, True)

    def _between(self, boxes: dict[int, npt.NDArray[np.float64]], on_scan: OnScan) -> Way:
        keys = np.array(list(boxes))
        corners = np.array(list(boxes.values()))
        corners[:, 6] = np.unwrap(corners[:, 6], period=np.pi)  # a box turned by half a turn is the same box
        stamps = self._stages.trajectory.stamps
        scans = range(keys[0], keys[-1] + 1)
        between = {i: np.array([np.interp(stamps[i], stamps[keys], column) for column in corners.T]) for i in scans}

        def held(i: int) -> npt.NDArray[np.int64]:
            return self._stages.kept(i)[self._rows_in(i, between[i], may_be_empty=True)]

        return self._way([list(scans)], between, held, on_scan, False)

    def _way(
        self,
        ways: list[list[int]],
        boxes: dict[int, npt.NDArray[np.float64]],
        held: Callable[[int], npt.NDArray[np.int64]],
        on_scan: OnScan,
        may_end: bool,
    ) -> Way:
        def found(i: int) -> Found:
            on_scan(len(boxes))
            rows = held(i)
            return rows, self._stages.owner_of_points(i)[rows]

        return Way(ways, boxes, lru_cache(None)(found), may_end)

    def _painted(self, index: int, segment: int, box: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
        """Return the scan's rows that the run would have painted, had it found a moving track in this segment."""
        stages = self._stages
        one = np.zeros(1, np.int64)
        fast = np.full((1, 3), np.inf)  # whatever counts as moving now
        track = Tracks(one, np.array([index]), np.array([segment]), box[None, :3], box[None, 3:6], box[6:], fast)
        judged = Verdicts(np.array([Verdict.MOVING], np.int8), np.ones(1))
        painted = label_scans(stages.scans, TrackedObjects(track, judged), stages.settings, 1, [index])
        return np.flatnonzero(next(iter(painted))[1]["track"] == 0)

    # --------------------------------------------------------------------------------------------------- of one scan
    def _frame(self, index: int) -> tuple[npt.NDArray, npt.NDArray[np.bool_]]:
        kind = self._stages.stage("candidates").load(self._stages.names[index], "kind")["kind"]
        return self._stages.frame(index).points_level, kind == OBJECT

    def _segments(self, index: int) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        found = self._stages.stage("instances").load(self._stages.names[index], "ids", "stayed")
        return found["ids"], found["stayed"]

    def _upright(self, index: int, box: tuple[float, ...]) -> npt.NDArray[np.float64]:
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
