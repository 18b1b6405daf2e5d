"""Evidence of motion: was a point's place seen to be empty, before or after?

For every point that is neither ground nor ego body, scans from 0.2 to 8 s before and after are asked what they saw
there: through (the place was empty, so the point came or went), a hit (the place was still taken), or nothing. Short
spans tell fast things apart, long ones slow walkers and cars that wait. No single see-through counts for much; what
all spans say together does. Memory holds the scans that may still be asked, whatever the recording's length.

Rays start where their LiDAR sits. Of merged clouds each LiDAR has a pattern, a view of every scan and a say of its own;
one scan has one say: a hit by any of its LiDARs stands.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_view import Lidar, Seen, View, learn_lidars, look
from automos.candidates.free_space_vote import look_through
from automos.candidates.free_space_weigh import (
    find_open,
    find_seen_through,
    join_votes,
    sum_votes,
    weaken_lone,
    weigh_looks,
)
from automos.geometry import inverse
from automos.scan import Frames
from automos.settings import EgoBodySettings, FreeSpaceSettings, GroundSettings

_PATTERN_SCANS = 5


@dataclass(frozen=True, eq=False)
class Evidence:
    """What other scans say of one frame's points.

    Attributes
    ----------
    kind : (M,) uint8, OBJECT, GROUND, EGO_BODY or SPECK.
    net : (M,) float32, see-throughs minus hits, weighted; above 0 the point has moved, 0 is unknown. 0 for what is no
        object.
    through, hits : (M,) uint8, how many scans saw through the point and how many hit it again.
    height : (M,) float32, metres above the ground.
    solidity : (M,) uint8, share of the rays beside an object that ended beside it, 255 for all.
    """

    kind: npt.NDArray[np.uint8]
    net: npt.NDArray[np.float32]
    through: npt.NDArray[np.uint8]
    hits: npt.NDArray[np.uint8]
    height: npt.NDArray[np.float32]
    solidity: npt.NDArray[np.uint8]


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
        self.lidars: list[Lidar] = learn_lidars(frames, [frames[i] for i in spread], ego_body, threads)
        steps = np.floor(self.stamps / settings.far_step)
        self._is_far_partner = np.concatenate([[True], np.diff(steps) > 0])

    @property
    def ray_steps(self) -> npt.NDArray[np.float64]:
        """(2,) radians between neighbouring rows and columns of rays, of the sparsest LiDAR."""
        return np.max([(s.pattern.row_height, s.pattern.column_width) for s in self.lidars], axis=0)

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
        seen: dict[int, Future[Seen]] = {}
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

    def _look(self, index: int) -> Seen:
        """Return what frame `index` saw."""
        return look(self.frames[index], self.lidars, self.ground)

    def _ask(self, index: int, mine: Seen, others: dict[int, Seen]) -> Evidence:
        """Return what the scans in `others` say about frame `index`."""
        n = len(mine.kind)
        net, through, hits = np.zeros(n, np.float32), np.zeros(n, np.uint8), np.zeros(n, np.uint8)
        for view, lidar in zip(mine.views, self.lidars, strict=True):
            heights = mine.height[view.rows][view.is_object]
            told = self._ask_about(index, view, lidar, heights, others)
            net[view.rows], through[view.rows], hits[view.rows] = (_scatter(part, view.is_object) for part in told)
        return Evidence(mine.kind, net, through, hits, mine.height, mine.solidity)

    def _ask_about(
        self,
        index: int,
        mine: View,
        lidar: Lidar,
        heights: npt.NDArray[np.float32],
        others: dict[int, Seen],
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
        """Return net, through and hits (K,) of a view's objects, which are `heights` (K,) above the ground."""
        n = mine.objects.shape[1]
        ids = np.arange(n)
        own_ranges = np.linalg.norm(mine.objects, axis=0)
        order = sorted(others)
        votes = np.zeros((len(order), n), np.int8)
        first = self._first_asked(index, order)
        for k in np.flatnonzero(first):
            self._add_votes(mine, ids, own_ranges, heights, others[order[k]], votes[k])
        # Most points are hit by all who see them: the others need not be asked about those.
        ids = find_open(votes, first, self.settings.sure_hits)
        for k in np.flatnonzero(~first):
            self._add_votes(mine, ids, own_ranges, heights, others[order[k]], votes[k])

        ids = find_seen_through(votes)
        weaken_lone(votes, ids, mine.is_supported[ids], self.settings.lone_weight)

        net, through, hits = np.empty(n, np.float32), np.empty(n, np.uint8), np.empty(n, np.uint8)
        sum_votes(votes, int(np.searchsorted(order, index)), self.settings.stay_weight, net, through, hits)
        return net, through, hits

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
        mine: View,
        ids: npt.NDArray[np.int64],
        own_ranges: npt.NDArray,
        heights: npt.NDArray,
        other: Seen,
        votes: npt.NDArray[np.int8],
    ) -> None:
        """Write into `votes` (K,) what another scan says about the points `ids` of a view."""
        s = self.settings
        tolerances = tuple(np.float32(x) for x in (s.margin, s.margin_per_metre, s.hit, s.hit_per_metre, s.clear_width))
        points = mine.objects if len(ids) == mine.objects.shape[1] else np.take(mine.objects, ids, axis=1)
        codes = np.empty(len(ids), np.uint8)
        ranges, misses = np.empty(len(ids), np.float32), np.empty(len(ids), np.float32)
        for k, (view, lidar) in enumerate(zip(other.views, self.lidars, strict=True)):
            T = (inverse(view.T_level_sensor) @ mine.T_level_sensor)[:3].astype(np.float32)
            scan = (view.motion, view.pattern, lidar.pyramid, view.image)
            look_through(points, T, *scan, tolerances, codes, ranges, misses)
            said = votes if k == 0 else np.zeros_like(votes)
            pitch = np.float32(lidar.pattern.row_height)
            weigh_looks(codes, ranges, misses, own_ranges, heights, pitch, s.near_miss, s.weak_weight, ids, said)
            if k > 0:
                join_votes(votes, said)


def _scatter(values: npt.NDArray, is_object: npt.NDArray[np.bool_]) -> npt.NDArray:
    out = np.zeros(len(is_object), values.dtype)
    out[is_object] = values
    return out
