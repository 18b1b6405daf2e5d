"""Evidence of motion: was a point's place seen to be empty, before or after?

For every point that is neither ground nor ego body, scans from 0.2 to 8 s before and after are asked what they saw
there: through (the place was empty, so the point came or went), a hit (the place was still taken), or nothing. Short
spans tell fast things apart, long ones slow walkers and cars that wait. No single see-through counts for much; what
all spans say together does. Memory holds the scans that may still be asked, whatever the recording's length.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.candidates.ego_body import EgoBody, find_ego_body
from automos.candidates.free_space_image import PyramidShape, RangeImage, make_image, pyramid_shape
from automos.candidates.free_space_pattern import BeamPattern, learn_pattern, raw_points, seen_in
from automos.candidates.free_space_vote import find_supported, look_through
from automos.candidates.free_space_weigh import find_open, find_seen_through, sum_votes, weaken_lone, weigh_looks
from automos.candidates.ground import fit_ground, is_on_ground
from automos.geometry import inverse
from automos.scan import EGO_BODY, GROUND, OBJECT, Frames
from automos.settings import EgoBodySettings, FreeSpaceSettings, GroundSettings

_PATTERN_SCANS = 5


@dataclass(frozen=True, eq=False)
class Evidence:
    """What other scans say of one frame's points.

    Attributes
    ----------
    kind : (M,) uint8, OBJECT, GROUND or EGO_BODY.
    net : (M,) float32, see-throughs minus hits, weighted; above 0 the point has moved, 0 is unknown. 0 for ground and
        ego body.
    through, hits : (M,) uint8, how many scans saw through the point and how many hit it again.
    height : (M,) float32, metres above the ground.
    """

    kind: npt.NDArray[np.uint8]
    net: npt.NDArray[np.float32]
    through: npt.NDArray[np.uint8]
    hits: npt.NDArray[np.uint8]
    height: npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Seen:
    """What is kept of a frame while others may ask about it."""

    kind: npt.NDArray[np.uint8]
    height: npt.NDArray[np.float32]
    objects: npt.NDArray[np.float32]  # (3, K) metres, sensor frame
    image: RangeImage
    motion: npt.NDArray[np.float32]
    pattern: BeamPattern


class FreeSpace:
    """Evidence of a whole recording: the sensor's pattern and the ego body are learnt at the start."""

    def __init__(
        self,
        frames: Frames,
        stamps: npt.NDArray[np.float64],
        settings: FreeSpaceSettings,
        ground: GroundSettings,
        ego_body: EgoBodySettings,
        threads: int = 2,
    ):
        """Learn from a few of `frames` how the sensor's rays lie and what of the vehicle they meet.

        `stamps` (N,) are the frames' times in seconds, increasing. The result does not depend on `threads`.
        """
        self.threads = threads
        self.frames, self.stamps = frames, np.asarray(stamps, np.float64)
        self.settings, self.ground = settings, ground
        spread = np.unique(np.linspace(0, len(frames) - 1, _PATTERN_SCANS).astype(int))
        self.pattern: BeamPattern = learn_pattern([frames[i] for i in spread])
        self.pyramid: PyramidShape = pyramid_shape(self.pattern)
        self.body: EgoBody = find_ego_body(frames, self.pattern, ego_body, ground, threads)
        self._T_sensor_level = inverse(frames.T_level_sensor)
        steps = np.floor(self.stamps / settings.far_step)
        self._is_far_partner = np.concatenate([[True], np.diff(steps) > 0])

    def partners(self, index: int) -> npt.NDArray[np.int64]:
        """Return the scans that are asked about scan `index`, in time order: the nearest to each span.

        Over the longer spans only scans `far_step` apart are asked, so that only their images need be kept for long.
        """
        spans, far = np.asarray(self.settings.spans), np.flatnonzero(self._is_far_partner)
        is_far = spans > self.settings.far_from
        near_ids = self._nearest(index, np.arange(len(self.stamps)), spans[~is_far])
        return np.union1d(near_ids, self._nearest(index, far, spans[is_far]))

    def _nearest(self, index: int, ids: npt.NDArray[np.int64], spans: npt.NDArray) -> npt.NDArray[np.int64]:
        """Return those of scans `ids` that are nearest to `spans` before and after scan `index`, if near enough."""
        wanted = self.stamps[index] + np.concatenate([-spans[::-1], spans])
        stamps = self.stamps[ids]
        nearest = np.searchsorted(0.5 * (stamps[1:] + stamps[:-1]), wanted)
        off = np.abs(stamps[nearest] - wanted)
        is_near = off <= self.settings.span_tolerance * np.abs(wanted - self.stamps[index])
        return np.setdiff1d(ids[nearest[is_near]], [index])

    def collect(self, start: int = 0, stop: int | None = None) -> Iterator[tuple[int, Evidence]]:
        """Yield (index, evidence) of every frame from `start` to before `stop`, in order; each frame is read once.

        The result does not depend on where one starts and stops.
        """
        todo = range(start, len(self.frames) if stop is None else stop)
        partners = {i: self.partners(i) for i in todo}
        last_use = np.full(len(self.frames), -1)
        for i in todo:
            last_use[[i, *partners[i]]] = i
        seen: dict[int, Future[_Seen]] = {}
        asked: deque[tuple[int, Future[Evidence]]] = deque()
        with ThreadPoolExecutor(self.threads) as pool:
            for i in todo:
                ahead = min(i + 2 * self.threads, todo[-1])
                for j in (ahead, *partners[ahead], i, *partners[i]):
                    if j not in seen:
                        seen[j] = pool.submit(self._look, int(j))
                others = {int(j): seen[j].result() for j in partners[i]}
                asked.append((i, pool.submit(self._ask, i, seen[i].result(), others)))
                if len(asked) > 2 * self.threads:
                    done, evidence = asked.popleft()
                    yield done, evidence.result()
                for j in [j for j in seen if last_use[j] <= i]:
                    del seen[j]
            while asked:
                done, evidence = asked.popleft()
                yield done, evidence.result()

    def _look(self, index: int) -> _Seen:
        """Return what frame `index` saw."""
        frame = self.frames[index]
        points = frame.points_level
        ground = fit_ground(points, frame.origin_level, self.ground)
        is_ground = is_on_ground(points, frame.origin_level, ground, self.ground)
        raw = raw_points(frame)
        kind = np.where(is_ground, np.uint8(GROUND), np.uint8(OBJECT))
        kind[self.body.covers(raw)] = EGO_BODY
        pattern, is_last = seen_in(frame, raw, self.pattern)
        image = make_image(raw, np.where(is_last, kind, np.uint8(EGO_BODY)), pattern, self.pyramid)
        height = points[:, 2] - ground.height_at(points)
        knows_motion = frame.sweep_motion is not None and frame.sweep_time is not None
        motion = np.asarray(frame.sweep_motion if knows_motion else np.zeros(6), np.float32)
        objects = np.take(frame.points, np.flatnonzero(kind == OBJECT), axis=0)
        return _Seen(kind, height, np.ascontiguousarray(objects.T), image, motion, pattern)

    def _ask(self, index: int, mine: _Seen, others: dict[int, _Seen]) -> Evidence:
        """Return what the scans in `others` say about frame `index`."""
        n = mine.objects.shape[1]
        ids = np.arange(n)
        own_ranges = np.linalg.norm(mine.objects, axis=0)
        heights = mine.height[mine.kind == OBJECT]
        order = sorted(others)
        votes = np.zeros((len(order), n), np.int8)
        first = self._first_asked(index, order)
        for k in np.flatnonzero(first):
            self._add_votes(index, mine, ids, own_ranges, heights, order[k], others[order[k]], votes[k])
        # Most points are hit by all who see them: the others need not be asked about those.
        ids = find_open(votes, first, self.settings.sure_hits)
        for k in np.flatnonzero(~first):
            self._add_votes(index, mine, ids, own_ranges, heights, order[k], others[order[k]], votes[k])

        ids = find_seen_through(votes)
        support = (np.float32(self.settings.support), np.float32(self.settings.support_per_metre))
        is_supported = find_supported(
            np.take(mine.objects, ids, axis=1), mine.motion, mine.pattern, mine.image, *support
        )
        weaken_lone(votes, ids, is_supported, self.settings.lone_weight)

        net, through, hits = np.empty(n, np.float32), np.empty(n, np.uint8), np.empty(n, np.uint8)
        sum_votes(votes, int(np.searchsorted(order, index)), self.settings.stay_weight, net, through, hits)
        is_object = mine.kind == OBJECT
        net, through, hits = (_scatter(values, is_object) for values in (net, through, hits))
        return Evidence(mine.kind, net, through, hits, mine.height)

    def _first_asked(self, index: int, order: list[int]) -> npt.NDArray[np.bool_]:
        """Return which of the scans `order` are nearest to the spans that are asked first."""
        first = np.zeros(len(order), np.bool_)
        if order:
            offsets, spans = self.stamps[order] - self.stamps[index], np.asarray(self.settings.first_spans)
            for span in (*-spans, *spans):
                first[np.argmin(np.abs(offsets - span))] = True
        return first

    def _add_votes(
        self,
        index: int,
        mine: _Seen,
        ids: npt.NDArray[np.int64],
        own_ranges: npt.NDArray,
        heights: npt.NDArray,
        other_index: int,
        other: _Seen,
        votes: npt.NDArray[np.int8],
    ) -> None:
        """Write into `votes` (K,) what scan `other_index` says about the points `ids` of scan `index`."""
        s = self.settings
        T = (self._T_sensor_level[other_index] @ self.frames.T_level_sensor[index])[:3].astype(np.float32)
        tolerances = tuple(np.float32(x) for x in (s.margin, s.margin_per_metre, s.hit, s.hit_per_metre, s.clear_width))
        points = mine.objects if len(ids) == mine.objects.shape[1] else np.take(mine.objects, ids, axis=1)
        codes = np.empty(len(ids), np.uint8)
        ranges, misses = np.empty(len(ids), np.float32), np.empty(len(ids), np.float32)
        scan = (other.motion, other.pattern, self.pyramid, other.image)
        look_through(points, T, *scan, tolerances, codes, ranges, misses)
        pitch = np.float32(self.pattern.row_height)
        weigh_looks(codes, ranges, misses, own_ranges, heights, pitch, s.near_miss, s.weak_weight, ids, votes)


def _scatter(values: npt.NDArray, is_object: npt.NDArray[np.bool_]) -> npt.NDArray:
    out = np.zeros(len(is_object), values.dtype)
    out[is_object] = values
    return out
