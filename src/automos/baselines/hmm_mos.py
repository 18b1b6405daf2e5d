"""HMM-MOS: where many voxels that were free are hit at once, something has come.

Our reading of Bhandari, James, Phillips, McAree, "Moving Object Segmentation in Point Cloud Data using Hidden Markov
Models" (IROS workshop, 2024). Every voxel is unobserved, free or occupied; what a scan says of the voxels that its rays
went through or ended in follows from their distance to the nearest voxel that was hit. Hit voxels that were free are
counted over a neighbourhood, in which what is unobserved counts against them; a median takes out single ones, the last
scans are summed, and Otsu's threshold separates motion from flicker. Only the past is used, as in the paper.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.baselines.batches import BatchSize, add_points, cut_batches, labels_of_voxels
from automos.baselines.brick_grid import FAR, BrickGrid, Ids
from automos.core.kernels import kernel
from automos.core.scan import Frames, Mask

_BATCH = BatchSize(scans=600, length=480.0)
"""What is further away than the reach of the rays is forgotten, as in the authors' map."""

_UNKNOWN, _OCCUPIED, _FREE = range(3)
_REACH = 4
"""Voxels from the nearest hit, from which on a surface is out of the question."""
_BINS = 100


@dataclass(frozen=True)
class Parameters:
    """The authors' values for Apollo (config/Apollo/config_apollo.yaml), which they use for vehicles.

    Attributes
    ----------
    voxel : float
        Metres.
    min_range, max_range : float
        Metres, points used.
    deviation : float
        Metres, of a hit around the surface that caused it.
    change : float
        Probability per scan that a voxel's state changes.
    sure : float
        Probability from which on a state is believed.
    reach : int
        Voxels around (2: 5 x 5 x 5) over which changes are counted.
    window : int
        Scans over which these counts are summed.
    min_sum : int
        Of a voxel that goes on moving; and what a scan's threshold must exceed, else nothing moves in it.
    forget : int
        Scans after which a voxel that was not seen is unobserved again.
    """

    batch: BatchSize = _BATCH
    voxel: float = 0.25
    min_range: float = 1.5
    max_range: float = 120.0
    deviation: float = 0.25
    change: float = 0.005
    sure: float = 0.99
    reach: int = 2
    window: int = 5
    min_sum: int = 3
    forget: int = 300


def find_moving(frames: Frames, parameters: Parameters, start: int = 0) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order: the points in voxels of movers."""
    for batch in cut_batches(frames, parameters.batch, start):
        seen = range(batch.frames[0], batch.own[-1] + 1)  # the future is not asked
        origins = frames.T_level_sensor[seen[0] : seen[-1] + 1, :3, 3]
        grid = BrickGrid(parameters.voxel, origins, parameters.max_range + _REACH * parameters.voxel)
        ids_of = [add_points(grid, frames[k], parameters.max_range, parameters.min_range) for k in seen]
        grid.widen(parameters.reach)
        voxels = _Voxels(grid, parameters)
        for k, ids in zip(seen, ids_of, strict=True):
            is_moving = voxels.observe(k, frames[k].origin_level, np.unique(ids[ids >= 0]))
            if k >= batch.own[0]:
                yield k, labels_of_voxels(ids, is_moving)


class _Voxels:
    """What is believed of every voxel of a grid, and where something came of late."""

    def __init__(self, grid: BrickGrid, parameters: Parameters):
        n = len(grid)
        self._grid, self._parameters, self._indices = grid, parameters, grid.indices()
        self._belief = np.full(n, 0.5, np.float32)  # that it is occupied
        self._state = np.full(n, _UNKNOWN, np.int8)
        # the last scan that saw it (a ray went through or ended there), hit it, changed its state
        self._seen, self._hit, self._changed = (np.full(n, -1, np.int32) for _ in range(3))
        self._last_away = np.full(n, FAR)
        self._sum = np.zeros(n, np.int32)
        self._recent: deque[tuple[Ids, Ids]] = deque()
        self._moved = np.zeros(n, bool)
        steps = np.sqrt(np.arange(256)) * parameters.voxel / parameters.deviation
        self._surface = np.exp(-0.5 * steps**2)
        self._surface[FAR] = 0.0

    def observe(self, k: int, origin: npt.NDArray, hit: Ids) -> Mask:
        """Return (V,) bool moving, after what scan `k` saw: its rays from `origin` (3,) to the voxels `hit` (H,)."""
        about = self._parameters
        self._grid.pass_lines(origin, self._indices[hit], k, self._seen)
        self._seen[hit] = self._hit[hit] = k
        away = self._grid.squared_steps(hit, self._indices, _REACH)
        nearest, self._last_away = np.minimum(away, self._last_away), away
        about_voxels = (self._seen, nearest, self._belief, self._state, self._changed)
        _filter(k, *about_voxels, self._surface, about.change, about.sure)
        return self._find_movers(k, hit, self._count_changes(k, hit))

    def _count_changes(self, k: int, hit: Ids) -> Ids:
        """Return (H,) int32: how much came around each of the voxels `hit` in scan `k`."""
        if len(self._recent) < self._parameters.window:  # too little is known yet
            return np.zeros(len(hit), np.int32)
        around = self._grid.neighbours(hit, self._indices, self._parameters.reach)
        counts = np.zeros(len(self._state), np.int32)
        counts[hit] = _count(around, k, self._state, self._seen, self._hit, self._changed, k - self._parameters.forget)
        return _median(self._grid.neighbours(hit, self._indices, 1), self._hit == k, counts)

    def _find_movers(self, k: int, hit: Ids, counts: Ids) -> Mask:
        """Return (V,) bool moving in scan `k`, which hit `hit` (H,) and found `counts` (H,) changes there."""
        about = self._parameters
        self._sum[hit] += counts
        self._recent.append((hit, counts))
        if len(self._recent) > about.window:
            old, gone = self._recent.popleft()
            self._sum[old] -= gone
        total = self._sum[hit]
        threshold = otsu_threshold(total)
        is_mover = (total > threshold) | (self._moved[hit] & (total > about.min_sum))
        self._moved = np.zeros(len(self._state) + 1, bool)  # one more for "no voxel", -1
        self._moved[self._grid.neighbours(hit[is_mover], self._indices, 1)] = True
        self._moved = self._moved[:-1] & (self._hit == k)
        return self._moved if about.min_sum < threshold < np.inf else np.zeros_like(self._moved)


@kernel
def _filter(k, seen, away, belief, state, changed, surface, change, sure):  # type: ignore[no-untyped-def]
    """One step of the hidden Markov model for the voxels that scan `k` saw; a belief past `sure` becomes the state.

    away : (V,) uint8, squared steps to the nearest hit.   surface : (256,) how likely that is of an occupied voxel.
    Of a voxel that was seen, "unobserved" has no likelihood: two states are left, and one number holds the belief.
    """
    for v in range(len(seen)):
        if seen[v] != k:
            continue
        likelihood = surface[away[v]]
        occupied = ((1.0 - 2.0 * change) * belief[v] + change) * likelihood
        free = ((1.0 - 2.0 * change) * (1.0 - belief[v]) + change) * (1.0 - likelihood)
        belief[v] = occupied / (occupied + free)
        now = _OCCUPIED if belief[v] > sure else _FREE if belief[v] < 1.0 - sure else _UNKNOWN
        if now != _UNKNOWN:
            if state[v] != _UNKNOWN and state[v] != now:
                changed[v] = k
            state[v] = now


@kernel
def _count(around, k, state, seen, hit, changed, forgotten):  # type: ignore[no-untyped-def]
    """Return (H,) int32: hit voxels whose state changed among `around` (H, W), less those unobserved, at least 0."""
    out = np.zeros(len(around), np.int32)
    for i in range(len(around)):
        n = 0
        for v in around[i]:
            if v < 0 or state[v] == _UNKNOWN or seen[v] <= forgotten:
                n -= 1
            elif changed[v] == k and hit[v] == k:
                n += 1
        out[i] = max(n, 0)
    return out


@kernel
def _median(around, is_hit, counts):  # type: ignore[no-untyped-def]
    """Return (H,) int32: the median of `counts` (V,) over those of `around` (H, W) that were hit."""
    out = np.zeros(len(around), np.int32)
    values = np.empty(around.shape[1], np.int32)
    for i in range(len(around)):
        n = 0
        for v in around[i]:
            if v >= 0 and is_hit[v]:
                values[n] = counts[v]
                n += 1
        ordered = np.sort(values[:n])  # never empty: each was hit itself
        out[i] = (ordered[(n - 1) // 2] + ordered[n // 2]) // 2
    return out


def otsu_threshold(values: npt.NDArray) -> float:
    """Return above what `values` (N,) are the upper of two classes, by their histogram; inf if all are the same."""
    if not len(values) or values.min() == values.max():
        return np.inf
    counts, edges = np.histogram(values, _BINS)
    bins = np.arange(_BINS)
    below, sum_below = np.cumsum(counts)[:-1], np.cumsum(counts * bins)[:-1]
    above, sum_above = counts.sum() - below, (counts * bins).sum() - sum_below
    between = below * above * (sum_below / below - sum_above / above) ** 2
    return float(edges[len(between) - between[::-1].argmax()])  # of equals, the last
