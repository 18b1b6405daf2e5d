"""Evidence of motion: was a point's place observed free, before or after?

For every point that is neither ground nor ego body, scans from 0.2 to 8 s before and after report on its place:
observed free (so the point came or went), hit (so the place was still occupied), or nothing. Short spans reveal fast
objects, long ones slow walkers and cars that wait. No single observation decides; the sum over all spans does. Memory
holds only the scans that may still be asked, whatever the length of the recording.

Rays start at their LiDAR. In merged clouds each LiDAR has its own view and report on every point. These are combined
into one report per scan, in which a hit by any LiDAR prevails, otherwise the strongest free-space observation.
"""

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial, reduce
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from automos.core.arrays import evenly_spread
from automos.core.geometry import Array, inverse
from automos.core.range_image import RangeImage
from automos.core.scan import Frames, Mask
from automos.evidence.height_map import GroundMap
from automos.evidence.look_through import look_through, tolerances_of
from automos.evidence.observations import Seen, View, ground_of, learn_lidars, look, with_body
from automos.evidence.steady_ground import SCANS_BEFORE, mended
from automos.evidence.votes import Votes, count_hits, sum_votes, weigh_looks
from automos.settings import CandidatesSettings, FreeSpaceSettings

Rows = npt.NDArray[np.int64]
Net = npt.NDArray[np.float32]
_Look = tuple[npt.NDArray[np.float32], RangeImage]
PATTERN_SCANS = 5  # of which the beams are learnt
_PART = 6000  # least points of a scan in a part for a thread, which pay for its overhead
SHORTEST = 0.2  # seconds: the first span
SPAN_TOLERANCE = 0.25  # share of a span by which the time of the asked scan may be off
SURE_HITS = 2  # number of hits, without any free-space observation, after which no more scans are asked


class FreeSpace:
    """Evidence for a whole recording; the sensor's pattern and the ego body are learnt at the start."""

    def __init__(self, frames: Frames, stamps: Array, settings: CandidatesSettings, threads: int = 2):
        """Learn the beam pattern from a few of `frames`, and the ego body from `frames`.

        `stamps` (N,) are the frames' times in seconds, increasing. The result does not depend on `threads`.
        """
        self.threads, self.frames, self.settings = threads, frames, settings
        self.stamps = np.asarray(stamps, np.float64)
        lidars = learn_lidars(evenly_spread(frames, PATTERN_SCANS))
        self.lidars = with_body(lidars, frames, frames.T_level_sensor, settings, threads)
        steps = np.floor(self.stamps / settings.free_space.far_step)
        self._is_far_partner = np.concatenate([[True], np.diff(steps) > 0])

    def partners(self, index: int) -> Rows:
        """Return the scans that are asked about scan `index`, in time order."""
        return partners_of(self.stamps[index], self.stamps, self._is_far_partner, self.settings.free_space)

    def collect(self, start: int = 0, stop: int | None = None) -> Iterator[tuple[int, Seen, Net]]:
        """Yield index, observations and evidence (`ask`) of each frame from `start` to before `stop`, in order.

        Each frame is read twice: for its ground, which later ones need, and for its rays. The result does not depend on
        `start` and `stop`.
        """
        todo = range(start, len(self.frames) if stop is None else stop)
        partners = {i: self.partners(i) for i in todo}
        last_use = np.full(len(self.frames), -1)
        for i in todo:
            last_use[[i, *partners[i]]] = i
        grounds: dict[int, Future[GroundMap]] = {}
        seen: dict[int, Future[Seen]] = {}
        asked: deque[tuple[int, Seen, Future[Net]]] = deque()
        with ThreadPoolExecutor(self.threads) as pool:
            for i in todo:
                ahead = min(i + 2 * self.threads, todo[-1])
                for j in (ahead, *partners[ahead], i, *partners[i]):
                    if j not in seen:
                        seen[j] = self._start_look(int(j), grounds, pool)
                mine, others = seen[i].result(), [seen[j].result() for j in partners[i]]
                offsets = self.stamps[partners[i]] - self.stamps[i]
                asked.append((i, mine, pool.submit(ask, mine, others, offsets, self.settings.free_space)))
                while len(asked) > (0 if i == todo[-1] else 2 * self.threads):
                    index, about, net = asked.popleft()
                    yield index, about, net.result()
                for j in [j for j in seen if last_use[j] <= i]:
                    del seen[j]
                for k in [k for k in grounds if k < i - SCANS_BEFORE]:
                    del grounds[k]

    def _start_look(self, index: int, grounds: dict[int, Future[GroundMap]], pool: ThreadPoolExecutor) -> Future[Seen]:
        """Start the look at a scan, after those of `grounds` that it needs and that are missing."""
        reach = self.stamps[index] - self.settings.free_space.longest_span  # what was before a pause is not asked
        needed = range(max(index - SCANS_BEFORE, int(np.searchsorted(self.stamps, reach))), index + 1)
        for k in needed:
            if k not in grounds:
                grounds[k] = pool.submit(self._map_ground, k)
        # Threads take up in order what is submitted: when this look begins, nothing that it waits for is left behind.
        return pool.submit(self._look, index, [grounds[k] for k in needed])

    def _map_ground(self, index: int) -> GroundMap:
        return ground_of(self.frames[index], self.settings.ground)

    def _look(self, index: int, grounds: list[Future[GroundMap]]) -> Seen:
        *before, own = (ground.result() for ground in grounds)
        return look(self.frames[index], self.lidars, mended(own, before), self.settings.ground)


def partners_of(stamp: float, stamps: Array, is_far: Mask, settings: FreeSpaceSettings) -> Rows:
    """Return which scans at `stamps` (N,) report on the one at `stamp`: the nearest to each span, in order.

    The scan itself is not among them. Over longer spans only the scans `is_far` (N,) report. They are `far_step` apart,
    so that few images must be kept for long. At the start of a stream, where none is near a span, the nearest reports.
    """
    spans = spans_of(settings)
    is_long = spans > settings.far_from
    near_ids = _nearest(stamp, stamps, np.arange(len(stamps)), spans[~is_long])
    chosen = np.union1d(near_ids, _nearest(stamp, stamps, np.flatnonzero(is_far), spans[is_long]))
    chosen = chosen[stamps[chosen] != stamp]
    if len(chosen) == 0 and len(stamps) > 1:
        away = np.abs(stamps - stamp)
        away[away == 0.0] = np.inf
        chosen = np.flatnonzero((away == away.min()) & (away <= spans.max()))[:1]
    return chosen


def spans_of(settings: FreeSpaceSettings) -> Array:
    """Return (S,) seconds between scans that are compared, each longer than the one before by the first or a third."""
    spans = [SHORTEST]
    while (longer := spans[-1] + max(SHORTEST, spans[-1] / 3.0)) < settings.longest_span:
        spans.append(longer)
    return np.array(spans)


def _nearest(stamp: float, stamps: Array, ids: Rows, spans: Array) -> Rows:
    """Return the scans of `ids` nearest to `spans` before and after `stamp`, if near enough."""
    if len(ids) == 0:
        return ids
    wanted = stamp + np.concatenate([-spans[::-1], spans])
    stamps = stamps[ids]
    nearest = np.searchsorted(0.5 * (stamps[1:] + stamps[:-1]), wanted)
    off = np.abs(stamps[nearest] - wanted)
    return ids[nearest[off <= SPAN_TOLERANCE * np.abs(wanted - stamp)]]


def ask(
    mine: Seen,
    others: list[Seen],
    offsets: Array,
    settings: FreeSpaceSettings,
    doubt: tuple[float, float] = (0.0, 0.0),
    pool: ThreadPoolExecutor | None = None,
) -> Net:
    """Return (M,) the evidence that each point of scan `mine` has moved, from the reports of `others` on its place.

    Positive: has moved; negative: has stayed; 0: unknown, or not an object point.

    Parameters
    ----------
    offsets : (P,) float64, seconds from `mine` to each of the others, increasing.
    doubt : metres and radians by which poses may be off.
    pool : ThreadPoolExecutor, optional, shares the work; the result does not depend on it.
    """
    net = np.zeros(len(mine.kind), np.float32)
    for view in mine.views:
        heights = mine.height[view.rows][view.is_object]
        n_parts = 1 if pool is None else max(len(heights) // _PART, 1)
        bounds = np.linspace(0, len(heights), n_parts + 1).astype(int)
        parts = [slice(a, b) for a, b in pairwise(bounds)]
        looked = [_looks_into(view, other) for other in others]
        part_of = partial(_ask_part, view, heights, looked, offsets, settings, tolerances_of(settings, doubt))
        asked = (map if pool is None else pool.map)(part_of, parts)
        of_view = np.zeros(len(view.is_object), np.float32)
        of_view[view.is_object] = np.concatenate(list(asked))
        net[view.rows] = of_view
    return net


def _looks_into(mine: View, other: Seen) -> list[_Look]:
    """Return the images of another scan with the (3, 4) transforms into them from a view of `mine`."""
    T_level_others = np.array([view.T_level_sensor for view in other.views]).reshape(-1, 4, 4)
    T_others_mine = (inverse(T_level_others) @ mine.T_level_sensor)[:, :3].astype(np.float32)
    return [(T, view.image) for T, view in zip(T_others_mine, other.views, strict=True)]


def _ask_part(
    mine: View,
    heights: Net,
    others: list[list[_Look]],
    offsets: Array,
    settings: FreeSpaceSettings,
    tolerances: tuple[np.float32, ...],
    part: slice,
) -> Net:
    """Return (K,) the evidence for a `part` of a view's object points; `heights` are those of all object points."""
    points = np.ascontiguousarray(mine.objects[:, part])
    trusts = np.where(mine.is_supported[part], 1.0, settings.lone_weight)
    about = [np.linalg.norm(points, axis=0), heights[part], trusts]
    # Asked first is about every third; points that these scans agree to have hit have stayed.
    thirds = spans_of(settings)[::-3]
    first = {int(np.argmin(np.abs(offsets - span))) for span in (*thirds, *-thirds) if others}
    votes = np.zeros((len(others), len(trusts)), np.int8)
    for k in first:
        votes[k] = _vote(points, about, others[k], tolerances)
    # Most points are hit by every scan that sees them, so the remaining scans need not report on those.
    ids = np.flatnonzero((votes.max(axis=0, initial=0) > 0) | (count_hits(votes) < SURE_HITS))
    points, about = np.take(points, ids, axis=1), [np.take(column, ids) for column in about]
    for k in set(range(len(others))) - first:
        votes[k, ids] = _vote(points, about, others[k], tolerances)
    # However few were asked: what all of them hit weighs as much as one that saw through.
    return sum_votes(votes, int(np.searchsorted(offsets, 0.0)), max(settings.stay_weight, 1.0 / max(len(others), 1)))


def _vote(
    points: npt.NDArray[np.float32], about: list[npt.NDArray], other: list[_Look], tolerances: tuple[np.float32, ...]
) -> Votes:
    """Return (K,) the vote of another scan on `points` (3, K) of a view; for `about` see `weigh_looks`."""
    votes = []
    for T, image in other:
        looks = look_through(points, T, image, tolerances)
        votes.append(weigh_looks(*looks, *about, np.float32(image.pattern.row_height)))
    return reduce(lambda a, b: np.where(np.minimum(a, b) < 0, np.minimum(a, b), np.maximum(a, b)), votes)
