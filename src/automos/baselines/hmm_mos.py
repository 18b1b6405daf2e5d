"""HMM-MOS: a voxel that was free and is occupied now holds something that came, if its surroundings agree.

Our reading of Bhandari, James, Phillips, McAree, "Moving Object Segmentation in Point Cloud Data using Hidden Markov
Models" (IROS workshop, 2024). Every voxel is unobserved, free or occupied; what a scan says of the voxels that its rays
went through or ended in follows from their distance to the nearest voxel that was hit. Voxels that turned from free to
occupied are summed over their neighbourhood and the last scans; Otsu's threshold tells motion from flicker. Only the
past is used, as in the paper. What we add: ground is never moving, and what touches something that stands there and
never came does not count, because a surface on the border of two voxels is now in the one, now in the other.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numba
import numpy as np
import numpy.typing as npt

from automos.baselines.batches import add_points, cut_batches, labels_of_voxels
from automos.baselines.brick_grid import BrickGrid
from automos.candidates.ground import segment_ground
from automos.scan import Frames, Mask
from automos.settings import GroundSettings, HmmMosSettings

_UNOBSERVED, _OCCUPIED, _FREE = range(3)
_NEVER = -(1 << 30)


def find_moving(
    frames: Frames, settings: HmmMosSettings, ground: GroundSettings, start: int = 0
) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order: the points in entered voxels."""
    for batch in cut_batches(frames, settings.batch, start):
        first, seen = batch.frames[0], range(batch.frames[0], batch.own[-1] + 1)  # the future is not asked
        grid = BrickGrid(settings.voxel, frames.T_level_sensor[first : seen[-1] + 1, :3, 3], settings.max_range)
        ids_of = [add_points(grid, frames[k], settings.max_range) for k in seen]
        voxels = _Voxels(grid, settings)
        for k, ids in zip(seen, ids_of, strict=True):
            frame = frames[k]
            used, ends = ids >= 0, frame.points_level[ids >= 0]
            is_ground = segment_ground(frame.points_level, frame.origin_level, ground)
            standing = np.unique(ids[used & ~is_ground])
            is_moving = voxels.observe(k, frame.origin_level, ends, np.unique(ids[used]), standing)
            if k >= batch.own[0]:
                yield k, labels_of_voxels(ids, is_moving) & ~is_ground


class _Voxels:
    """What is believed of every voxel, and which changed of late."""

    def __init__(self, grid: BrickGrid, settings: HmmMosSettings):
        n = len(grid)
        self._grid, self._settings, self._indices = grid, settings, grid.indices()
        self._belief = np.zeros((n, 3), np.float32)
        self._belief[:, _UNOBSERVED] = 1.0
        self._state = np.full(n, _UNOBSERVED, np.int8)
        self._entered = np.full(n, _NEVER, np.int32)  # when it last turned from free to occupied
        self._passed, self._hit = np.full(n, -1, np.int32), np.full(n, -1, np.int32)
        self._stood = np.zeros(n, bool)  # something that is not ground was hit in it
        self._recent: deque[npt.NDArray] = deque()
        self._count = np.zeros(n, np.int64)  # in how many of the last scans something stood in it that had come

    def observe(self, k: int, origin: npt.NDArray, ends: npt.NDArray, hit: npt.NDArray, standing: npt.NDArray) -> Mask:
        """Return (V,) bool moving, after what scan `k` saw: its rays from `origin` (3,) to `ends` (M, 3).

        hit : voxels in which rays ended.   standing : those in which something that is not ground was hit.
        """
        about = self._settings
        self._grid.pass_rays(origin, ends, k, self._passed)
        self._hit[hit] = k
        seen = np.flatnonzero((self._passed == k) | (self._hit == k))
        near = self._grid.neighbours(seen, self._indices, 1)
        likelihood = _likelihood(near, self._hit, k, about.voxel, about.deviation, about.change)
        standing_free = standing[self._state[standing] == _FREE]
        _filter(seen, likelihood, self._belief, self._state, self._entered, k, about.change, about.sure)
        self._entered[standing_free] = k
        self._stood[standing] = True
        turned = standing[self._entered[standing] > k - about.memory]
        turned = turned[~self._is_beside_what_stayed(turned, k)]
        self._recent.append(turned)
        self._count[turned] += 1
        if len(self._recent) > about.window:
            self._count[self._recent.popleft()] -= 1
        sums = np.append(self._count, 0)[self._grid.neighbours(turned, self._indices, about.reach)].sum(axis=1)
        is_moving = np.zeros(len(self._count), bool)
        is_moving[turned[sums >= max(about.min_sum, otsu_threshold(sums))]] = True
        return is_moving

    def _is_beside_what_stayed(self, voxels: npt.NDArray, k: int) -> Mask:
        """Return (K,) bool: which of `voxels` touch one in which something stands that never came.

        A surface on the border of two voxels is now in the one, now in the other.
        """
        has_stayed = self._stood & (self._state == _OCCUPIED) & (self._entered <= k - self._settings.memory)
        return np.append(has_stayed, False)[self._grid.neighbours(voxels, self._indices, 1)].any(axis=1)


@numba.njit(cache=True, nogil=True)
def _likelihood(near, hit, k, voxel, deviation, floor):  # type: ignore[no-untyped-def]
    """Return (K,) float32: how well each voxel, `near` (K, 27) its neighbourhood, agrees with a surface in it."""
    out = np.empty(len(near), np.float32)
    for i in range(len(near)):
        best = 1 << 30
        for j in range(27):
            if near[i, j] >= 0 and hit[near[i, j]] == k:
                best = min(best, abs(j // 9 - 1) + abs(j // 3 % 3 - 1) + abs(j % 3 - 1))  # squared: steps are 0 or 1
        surface = np.exp(-0.5 * best * (voxel / deviation) ** 2) if best < 4 else 0.0
        out[i] = min(max(surface, floor), 1.0 - floor)
    return out


@numba.njit(cache=True, nogil=True)
def _filter(seen, likelihood, belief, state, entered, k, change, sure):  # type: ignore[no-untyped-def]
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
            if state[v] == _FREE:
                entered[v] = k
            state[v] = _OCCUPIED
        elif free / total >= sure:
            state[v] = _FREE


def otsu_threshold(values: npt.NDArray) -> float:
    """Return the value from which on `values` (N,), not negative, are the upper of two classes; 0 where all are one.

    Classes are told apart on a scale of ratios (quarters of an octave): a near van has a hundred times the voxels of a
    far pedestrian, and on a plain scale it would be the one class and everything else the other.
    """
    if len(values) == 0:
        return 0.0
    counts = np.bincount(np.floor(4.0 * np.log2(1.0 + values)).astype(np.int64)).astype(np.float64)
    below, mean_below = np.cumsum(counts), np.cumsum(counts * np.arange(len(counts)))
    above, mean_above = below[-1] - below, mean_below[-1] - mean_below
    with np.errstate(divide="ignore", invalid="ignore"):
        between = np.nan_to_num(below * above * (mean_below / below - mean_above / above) ** 2)
    return float(2.0 ** ((between.argmax() + 1) / 4.0) - 1.0) if between.max() > 0.0 else 0.0
