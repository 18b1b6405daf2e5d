"""Objects that a person proposes: a cluster or a box, tracked through the recording, with its points.

The tracker is offered a whole segment and the pieces that the evidence cut out of it; a click selects the smallest
segment that holds the point.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import Array
from automos.core.scan import OBJECT, Mask
from automos.objects.boxes import fit_boxes
from automos.objects.detections import Detections
from automos.objects.tracking import TrackedObjects
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts
from automos.readers.box_truth import SOLE
from automos.review.box_rows import as_box, as_rows, is_inside
from automos.review.follow import follow_segment
from automos.review.reshaping import Found, OnScan, Way
from automos.review.run_stages import Rows, RunStages

REACH = 1.5
"""Metres around a click within which a point is looked for."""
GAP = 0.5
"""Metres between neighbours of a cluster where the run has no segment."""
MAX_TALL = 4.5
"""Metres above its lowest point that a drawn box may hold."""
MARGIN = 0.05
"""Metres around a drawn box in which points are taken for its own."""
MAX_GAP = 1.5
"""Seconds for which it may be out of sight: a person sees what it is taken for afterwards, and where it ends."""
_NEW, _NONE = -2, np.zeros(0, np.int64)
"""Segment that a person drew, which the run does not have; and the rows of no point."""


class Proposer:
    """Makes proposals for one run; keeps the segments of scans it has read."""

    def __init__(self, stages: RunStages, most: int | None = None):
        """Take the run's stages, and how many scans each way something is followed through: to its ends if None."""
        self._stages, self._most = stages, most
        self.detections = lru_cache(4000)(stages.detections)

    # ------------------------------------------------------------------------------------------------- what is shown
    def at(self, index: int, x: float, y: float, on_scan: OnScan) -> Way:
        """Return the thing at (`x`, `y`), metres in the level frame, in scan `index`, followed through time.

        Raises
        ------
        InputError
            Nothing stands there.
        """
        return self._followed(index, *self._cluster(index, x, y), on_scan)

    def rows_at(self, index: int, x: float, y: float) -> Rows:
        """Return the rows, of scan `index` as the recording has it, of the thing at (`x`, `y`); errors as of `at`."""
        segment, rows = self._cluster(index, x, y)
        if segment == _NEW:
            return self._stages.kept(index)[rows]
        return self._painted(index, segment, as_rows(self.detections(index).boxes)[segment])

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
        return self._followed(index, self._segment_of(index, rows), rows, on_scan)

    def from_segment(self, index: int, segment: int, on_scan: OnScan) -> Way:
        """Return `segment` of scan `index`, followed through time."""
        return self._followed(index, segment, _NONE, on_scan)

    # ----------------------------------------------------------------------------------------------------- a cluster
    def _cluster(self, index: int, x: float, y: float) -> tuple[int, Rows]:
        """Return the segment nearest to a click, or, if what is there has none, `_NEW` and its rows of the frame."""
        points, is_object = self._frame(index)
        away = np.hypot(points[:, 0] - x, points[:, 1] - y)
        near = np.flatnonzero(is_object & (away < REACH))
        if not len(near):
            raise InputError("nothing stands there: click on a point that is not ground, or draw a box")
        nearest = near[away[near].argmin()]
        ids, stayed = self._stages.segments(index)
        segment = ids[nearest] if ids[nearest] >= 0 else stayed[nearest]
        if segment >= 0:
            return int(segment), _NONE
        return _NEW, _grown(points, is_object & (ids < 0), int(nearest))

    def _segment_of(self, index: int, rows: Rows) -> int:
        """Return the segment that `rows` are most of and that is most of `rows`, `_NEW` if there is none."""
        best, best_share = _NEW, 0.5
        for ids in self._stages.segments(index):
            inside = ids[rows]
            held = np.bincount(inside[inside >= 0], minlength=1)
            segment = int(held.argmax())
            share = held[segment] / max(len(rows), int((ids == segment).sum()), 1)
            if share > best_share:
                best, best_share = segment, share
        return best

    # --------------------------------------------------------------------------------------------------- through time
    def _followed(self, index: int, segment: int, rows: Rows, on_scan: OnScan) -> Way:
        """Return a segment of scan `index`, or if it is `_NEW` what the frame's `rows` are, followed through time."""
        first = self.detections(index)
        if segment == _NEW:
            segment = len(first)
            first = Detections.concatenate([first, self._described(index, rows)])

        def detect(i: int) -> Detections:
            on_scan(0)
            return first if i == index else self.detections(i)

        stamps, follow = self._stages.trajectory.stamps, self._stages.settings.tracking
        settings = follow.model_copy(update={"max_gap": max(follow.max_gap, MAX_GAP)})
        path = follow_segment(detect, stamps, index, segment, settings, self._most)
        seen = {i: (own, box) for i, (own, box) in path.items() if own >= 0}

        def held(i: int) -> Rows:
            own, box = seen[i]
            is_drawn = i == index and own >= len(self.detections(index))
            return self._stages.kept(i)[rows] if is_drawn else self._painted(i, own, box)

        ways = [[i for i in seen if i >= index], [i for i in reversed(seen) if i < index]]
        boxes = {i: box for i, (_, box) in seen.items()}
        return Way(ways, boxes, self._owned(held, on_scan, len(boxes)), may_end=True)

    def _between(self, boxes: dict[int, Array], on_scan: OnScan) -> Way:
        keys = np.array(list(boxes))
        corners = np.array(list(boxes.values()))
        corners[:, 6] = np.unwrap(corners[:, 6], period=np.pi)  # a box turned by half a turn is the same box
        stamps = self._stages.trajectory.stamps
        scans = range(keys[0], keys[-1] + 1)[: self._most]
        between = {i: np.array([np.interp(stamps[i], stamps[keys], column) for column in corners.T]) for i in scans}

        def held(i: int) -> Rows:
            return self._stages.kept(i)[self._rows_in(i, between[i], may_be_empty=True)]

        return Way([list(scans)], between, self._owned(held, on_scan, len(between)), may_end=False)

    def _owned(self, held: Callable[[int], Rows], on_scan: OnScan, n_scans: int) -> Callable[[int], Found]:
        """Return what gives the rows `held` in a scan, and whose they are, and tells of each scan once."""

        @lru_cache(None)
        def found(i: int) -> Found:
            on_scan(n_scans)
            rows = held(i)
            return rows, self._stages.owner_of_points(i)[rows]

        return found

    def _painted(self, index: int, segment: int, box: Array) -> Rows:
        """Return the scan's rows that the run would have painted, had it found a moving track in this segment."""
        one, upright = np.zeros(1, np.int64), as_box(box)
        fast = np.full((1, 3), np.inf)  # whatever counts as moving now
        where = upright.center, upright.size, upright.yaw
        track = Tracks(one, np.array([index]), np.array([segment]), *where, fast)
        judged = Verdicts(np.array([Verdict.MOVING], np.int8), np.ones(1))
        return np.flatnonzero(self._stages.painted(index, TrackedObjects(track, judged))["track"] == 0)

    # --------------------------------------------------------------------------------------------------- of one scan
    def _frame(self, index: int) -> tuple[npt.NDArray, Mask]:
        return self._stages.frame(index).points_level, self._stages.kinds(index) == OBJECT

    def _upright(self, index: int, box: tuple[float, ...]) -> Array:
        """Return (7,): a box drawn on the ground (5,) as high as what stands in it."""
        points, is_object = self._frame(index)
        x, y, length, width, yaw = box
        tall = np.array([x, y, 0.0, max(length, 0.1), max(width, 0.1), 2e3, yaw])
        inside = is_inside(points, tall, MARGIN)
        standing = inside & is_object
        if not standing.any():
            raise InputError("nothing stands in that box: draw it around points that are not ground")
        low = float(np.percentile(points[inside, 2], 2))
        top = points[standing & (points[:, 2] < low + MAX_TALL), 2].max(initial=low + 0.1)
        return np.array([x, y, 0.5 * (low + top), tall[3], tall[4], top - low, yaw])

    def _rows_in(self, index: int, box: Array, may_be_empty: bool = False) -> Rows:
        """Return the frame's rows in an upright box (7,), without the ground under it."""
        points, is_object = self._frame(index)
        bottom = box[2] - 0.5 * box[5]
        rows = np.flatnonzero(is_inside(points, box, MARGIN) & (is_object | (points[:, 2] > bottom + SOLE)))
        if not len(rows) and not may_be_empty:
            raise InputError("nothing stands in that box: draw it around points that are not ground")
        return rows

    def _described(self, index: int, rows: Rows) -> Detections:
        """Return `rows` of a frame as a segment."""
        points, _ = self._frame(index)
        boxes = fit_boxes(points[rows], np.zeros(len(rows), np.int32), np.ones(1))
        n = np.array([float(len(rows))])
        return Detections.of_objects(boxes, n, n, np.zeros(1))


def _grown(points: npt.NDArray, is_free: Mask, start: int) -> Rows:
    """Return the rows of the free points that hang together with `start` without a gap."""
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    near = np.flatnonzero(is_free & (np.abs(points[:, :2] - points[start, :2]).max(axis=1) < 10.0))
    pairs = cKDTree(points[near]).sparse_distance_matrix(cKDTree(points[near]), GAP)
    _, part = connected_components(pairs, directed=False)
    return near[part == part[np.searchsorted(near, start)]]
