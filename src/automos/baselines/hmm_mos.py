"""HMM-MOS: a voxel whose state changes holds, or held, something that moves, if its surroundings agree.

Our reading of Bhandari, James, Phillips, McAree, "Moving Object Segmentation in Point Cloud Data using Hidden Markov
Models" (IROS workshop, 2024). Every voxel is unobserved, free or occupied; what a scan says of the voxels that its rays
went through or ended in follows from their distance to the nearest voxel that was hit. Changes are summed over their
neighbourhood, smoothed by a median, and summed over the last scans; Otsu's threshold tells motion from flicker. Only
the past is used, as in the paper. What we add: ground is never moving.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from automos.baselines.batches import BATCH, BatchSize, cut_batches, is_within, labels_of_voxels
from automos.baselines.brick_grid import BrickGrid
from automos.candidates.ground import segment_ground
from automos.scan import Frames, Mask
from automos.settings import GroundSettings

_UNOBSERVED, _OCCUPIED, _FREE = range(3)
_FAR = 5.0
"""Voxels from the nearest hit, from which on a surface is out of the question."""


@dataclass(frozen=True)
class Parameters:
    """The authors' values for Apollo, which they use for vehicles.

    Attributes
    ----------
    voxel : metres.
    min_range, max_range : metres, points used.
    deviation : metres, of a hit around the surface that caused it.
    change : probability per scan that a voxel's state changes.
    sure : probability from which on a state is believed.
    reach : voxels around (2: 5 x 5 x 5) over which changes are summed.
    window : scans, likewise.
    min_sum : changes a scan that make motion, at least; Otsu's threshold may ask for more.
    """

    batch: BatchSize = BATCH
    voxel: float = 0.25
    min_range: float = 0.5
    max_range: float = 120.0
    deviation: float = 0.25
    change: float = 0.005
    sure: float = 0.99
    reach: int = 2
    window: int = 5
    min_sum: float = 3.0


def find_moving(
    frames: Frames, parameters: Parameters, ground: GroundSettings, start: int = 0
) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order: the points in voxels of movers."""
    for batch in cut_batches(frames, parameters.batch, start):
        first, seen = batch.frames[0], range(batch.frames[0], batch.own[-1] + 1)  # the future is not asked
        grid = BrickGrid(parameters.voxel, frames.T_level_sensor[first : seen[-1] + 1, :3, 3], parameters.max_range)
        ids_of = []
        for k in seen:
            used = is_within(frames[k], parameters.max_range, parameters.min_range)
            ids_of.append(np.full(len(used), -1, np.int32))
            ids_of[-1][used] = grid.add(frames[k].points_level[used])
        voxels = _Voxels(grid, parameters)
        for k, ids in zip(seen, ids_of, strict=True):
            frame = frames[k]
            used, is_ground = ids >= 0, segment_ground(frame.points_level, frame.origin_level, ground)
            hit, standing = np.unique(ids[used]), np.unique(ids[used & ~is_ground])
            is_moving = voxels.observe(k, frame.origin_level, frame.points_level[used], hit, standing)
            if k >= batch.own[0]:
                yield k, labels_of_voxels(ids, is_moving) & ~is_ground


class _Voxels:
    """What is believed of every voxel, and where changes were of late."""

    def __init__(self, grid: BrickGrid, parameters: Parameters):
        n = len(grid)
        self._grid, self._parameters, self._indices = grid, parameters, grid.indices()
        self._belief = np.zeros((n, 3), np.float32)
        self._belief[:, _UNOBSERVED] = 1.0
        self._state = np.full(n, _UNOBSERVED, np.int8)
        self._passed, self._hit = np.full(n, -1, np.int32), np.full(n, -1, np.int32)
        self._last_hit = np.zeros(0, np.int32)
        self._recent: deque[npt.NDArray[np.int32]] = deque(maxlen=parameters.window)

    def observe(self, k: int, origin: npt.NDArray, ends: npt.NDArray, hit: npt.NDArray, standing: npt.NDArray) -> Mask:
        """Return (V,) bool moving, after what scan `k` saw: its rays from `origin` (3,) to `ends` (M, 3).

        hit : voxels in which rays ended.   standing : those in which something that is not ground was hit.
        """
        about, n = self._parameters, len(self._state)
        self._grid.pass_rays(origin, ends, k, self._passed)
        self._hit[hit] = k
        seen = np.flatnonzero((self._passed == k) | (self._hit == k))
        before = self._state[seen].copy()
        _filter(seen, self._likelihood(seen, hit), self._belief, self._state, about.change, about.sure)
        after = self._state[seen]
        changed = np.zeros(n + 1, bool)  # one more for "no voxel", -1
        changed[standing] = self._state[standing] == _FREE  # hit, and not believed yet
        changed[np.intersect1d(standing, seen[(before == _FREE) & (after == _OCCUPIED)])] = True
        changed[seen[(before == _OCCUPIED) & (after == _FREE)]] = True

        scores = np.zeros(n, np.int32)
        scores[standing] = changed[self._grid.neighbours(standing, self._indices, about.reach)].sum(axis=1)
        scores[standing] = self._median_around(standing, scores, k)
        self._recent.append(scores)
        total = np.sum([part[standing] for part in self._recent], axis=0)
        moving = standing[total >= max(otsu_threshold(total), about.min_sum * about.window)]
        is_moving = np.zeros(n + 1, bool)
        is_moving[np.unique(self._grid.neighbours(moving, self._indices, 1))] = True
        return is_moving[:-1] & (self._hit == k)

    def _likelihood(self, seen: npt.NDArray, hit: npt.NDArray[np.int32]) -> npt.NDArray[np.float32]:
        """Return (K,) float32: how well each of `seen` agrees with a surface in it, hits of the last scan included."""
        from scipy.spatial import cKDTree

        hits = np.union1d(hit, self._last_hit)
        self._last_hit = hit
        if not len(hits):
            return np.zeros(len(seen), np.float32)
        away, _ = cKDTree(self._indices[hits]).query(self._indices[seen], distance_upper_bound=_FAR)
        surface = np.exp(-0.5 * (away * self._parameters.voxel / self._parameters.deviation) ** 2)
        return np.clip(surface, self._parameters.change, 1.0 - self._parameters.change).astype(np.float32)

    def _median_around(self, voxels: npt.NDArray, scores: npt.NDArray, k: int) -> npt.NDArray[np.int32]:
        """Return (K,) int32: the median score of the voxels of 3 x 3 x 3 around each of `voxels` that scan `k` hit."""
        if not len(voxels):
            return np.zeros(0, np.int32)
        around = self._grid.neighbours(voxels, self._indices, 1)
        is_hit = np.append(self._hit == k, False)[around]
        values = np.where(is_hit, np.append(scores, 0)[around].astype(np.float32), np.float32(np.nan))
        return np.nanmedian(values, axis=1).astype(np.int32)  # never empty: each was hit itself


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _filter(seen, likelihood, belief, state, change, sure):  # type: ignore[no-untyped-def]
    """One step of the hidden Markov model for the voxels `seen` (K,); a belief past `sure` becomes the state."""
    stay = 1.0 - 3.0 * change
    for i in range(len(seen)):
        v = seen[i]
        unobserved = (stay * belief[v, _UNOBSERVED] + change) * change
        occupied = (stay * belief[v, _OCCUPIED] + change) * likelihood[i]
        free = (stay * belief[v, _FREE] + change) * (1.0 - likelihood[i])
        total = unobserved + occupied + free
        belief[v, _UNOBSERVED], belief[v, _OCCUPIED], belief[v, _FREE] = (
            unobserved / total,
            occupied / total,
            free / total,
        )
        if occupied / total >= sure:
            state[v] = _OCCUPIED
        elif free / total >= sure:
            state[v] = _FREE


def otsu_threshold(values: npt.NDArray) -> float:
    """Return the value from which on the positive ones of `values` (N,) integers are the upper of two classes.

    It is the least of them where they cannot be told apart, and 0 where there is none.
    """
    counts = np.bincount(values)[1:].astype(np.float64)
    if not counts.sum():
        return 0.0
    numbers = np.arange(1, len(counts) + 1)
    below, sum_below = np.cumsum(counts), np.cumsum(counts * numbers)
    above, sum_above = below[-1] - below, sum_below[-1] - sum_below
    with np.errstate(divide="ignore", invalid="ignore"):
        between = np.nan_to_num(below * above * (sum_below / below - sum_above / above) ** 2)
    split = int(between.argmax()) + 1 if between.max() > 0.0 else 0
    return float(numbers[split + np.flatnonzero(counts[split:])[0]])
