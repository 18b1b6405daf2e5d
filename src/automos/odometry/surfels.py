"""Surfels: the points of a scan in each voxel, as mean and covariance.

Voxels double in size with distance, as the beams diverge. A scan is reduced to a few thousand surfels that can be
moved, merged and matched at a thousandth of the cost of its points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.geometry import Array
from automos.kernels import kernel
from automos.odometry.motion import usable_points
from automos.scan import Points, Scan
from automos.sensor.compensation import compensate
from automos.sensor.sweep_timing import SweepTiming
from automos.settings import OdometrySettings
from automos.voxels import VoxelMap, find_slot, voxel_key

N_LEVELS = 4
"""Voxel sizes: each covers twice the distance of the previous one."""
NEAR = 20.0
"""Metres up to which voxels have their smallest size: beams of usual sensors are at most 10 cm apart there."""
SURFEL = 0.4
"""Metres, smallest voxel edge for surfels: large enough for several points, small enough to be flat."""
MAX_RANGE = 80.0
"""Metres; surfels farther away are larger than the errors they should reveal."""
MIN_SURFEL_POINTS = 3
"""Points of a surfel, at least: fewer have no extent."""
BODY_RANGE = 6.0
"""Metres within which the ego body is searched: up to the ends of a long vehicle."""
BODY_VOXEL = 0.4
"""Metres, edge of the voxels in which positions are compared, the same as for surfels."""
BODY_SHARE = 0.8
"""Share of the scans that must observe it at the same position."""
BODY_SPREAD = 0.04
"""Metres, deviation of that position: noise of a surfel."""


@dataclass(frozen=True, eq=False)
class Surfels:
    """Surfels in one frame."""

    mean: Points  # (M, 3) metres
    covariance: npt.NDArray[np.float32]  # (M, 6) square metres: xx, xy, xz, yy, yz, zz of the points about their mean
    count: npt.NDArray[np.float32]  # (M,) points
    time: npt.NDArray[np.float32]  # (M,) in [-0.5, 0.5], mean time in the sweep (zero if unknown)
    sparse: Surfels | None = None  # of the whole scan, those with too few points for a surface

    def __len__(self) -> int:
        return len(self.mean)

    def __getitem__(self, rows: npt.NDArray | slice) -> Surfels:
        return Surfels(self.mean[rows], self.covariance[rows], self.count[rows], self.time[rows])

    def compensated(self, twist: Array) -> Surfels:
        """Return the surfels, compensated for the motion `twist` (6,) during the sweep."""
        sparse = None if self.sparse is None else self.sparse.compensated(twist)
        return replace(self, mean=compensate(self.mean, self.time, twist), sparse=sparse)

    def timed(self, times_of: Callable[[Points], npt.NDArray[np.float32]]) -> Surfels:
        """Return the surfels with the times that `times_of` gives for their positions."""
        sparse = None if self.sparse is None else self.sparse.timed(times_of)
        return replace(self, time=times_of(self.mean), sparse=sparse)


def make_surfels(points: Points, times: npt.NDArray[np.float32] | None, has_seam: bool = False) -> Surfels:
    """Return all surfels of one scan; see `surfels_of`."""
    if times is None:
        times = np.zeros(len(points), np.float32)
    size = 1 << max(len(points), 16).bit_length()
    sums = _sum_moments(np.ascontiguousarray(points), times, has_seam, size)
    moments = sums[:, 1:] * (1.0 / sums[:, :1])
    mean, second = moments[:, :3], moments[:, 3:9]
    covariance = second - mean[:, [0, 0, 0, 1, 1, 2]] * mean[:, [0, 1, 2, 1, 2, 2]]
    return Surfels(*(part.astype(np.float32) for part in (mean, covariance, sums[:, 0], moments[:, 9])))


def surfels_of(points: Points, times: npt.NDArray[np.float32] | None, has_seam: bool = False) -> Surfels:
    """Return the surfels of one scan that have enough points.

    Parameters
    ----------
    points : (N, 3) float32, metres, sensor frame, usable points only.
    times : (N,) float32 in [-0.5, 0.5] of the sweep, or None if unknown.
    has_seam : bool, whether places are seen at the start or the end of a sweep, as by a rotating sensor: then no surfel
        is of both. A pattern that never repeats sees a place throughout the sweep.
    """
    surfels = make_surfels(points, times, has_seam)
    is_surface = surfels.count >= MIN_SURFEL_POINTS
    return replace(surfels[is_surface], sparse=surfels[~is_surface])


def scan_surfels(scan: Scan, twist: Array, timing: SweepTiming, settings: OdometrySettings) -> Surfels:
    """Return the surfels of `scan`, compensated for the `twist` (6,) of its sweep with the times of `timing`."""
    return surfels_of(*usable_points(scan, timing, twist, settings), timing.has_seam)


def without_body(surfels: list[Surfels]) -> list[Surfels]:
    """Return the surfels of consecutive scans, each in its sensor frame, without those of the ego body.

    These are near the sensor, at the same position within centimetres in nearly every scan (as is very even ground,
    which is not needed; at standstill, everything is).
    """
    if not surfels:
        return []
    is_near = [np.einsum("ij,ij->i", s.mean, s.mean) < BODY_RANGE**2 for s in surfels]
    means = np.concatenate([s.mean[near] for s, near in zip(surfels, is_near, strict=True)]).astype(np.float64)
    voxel = VoxelMap(BODY_VOXEL).add(means)
    count = np.bincount(voxel)
    spread = np.zeros(len(count))
    for axis in range(3):
        mean = np.bincount(voxel, means[:, axis], len(count)) / count
        spread += np.bincount(voxel, (means[:, axis] - mean[voxel]) ** 2, len(count)) / count
    is_body = ((count > BODY_SHARE * len(surfels)) & (spread < BODY_SPREAD**2))[voxel]
    parts = np.split(is_body, np.cumsum([near.sum() for near in is_near])[:-1])
    kept = [~near for near in is_near]
    for keep, near, body in zip(kept, is_near, parts, strict=True):
        keep[near] = ~body
    return [scan[keep] for scan, keep in zip(surfels, kept, strict=True)]


@kernel
def level_of(x, y, z):  # type: ignore[no-untyped-def]
    """Return the voxel level at a position in the sensor frame."""
    squared = x * x + y * y + z * z
    limit = NEAR * NEAR
    level = 0
    while squared > limit and level < N_LEVELS - 1:
        limit *= 4.0
        level += 1
    return level


@kernel
def key_at_level(x, y, z, level, inverse_voxel):  # type: ignore[no-untyped-def]
    """Return the int64 key of a voxel at a level; each level doubles the edge."""
    return voxel_key(x, y, z, inverse_voxel / (1 << level)) | level


@kernel
def _sum_moments(points, times, has_seam, size):  # type: ignore[no-untyped-def]
    """Return (M, 11) sums over the points of each voxel: count, x, y, z, xx, xy, xz, yy, yz, zz, time."""
    keys, row_of = np.full(size, -1, np.int64), np.empty(size, np.int32)
    sums = np.zeros((len(points), 11))
    n = 0
    inverse_voxel = 1.0 / SURFEL
    for i in range(len(points)):
        x, y, z = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        if not (x * x + y * y + z * z < MAX_RANGE * MAX_RANGE):
            continue
        key = key_at_level(x, y, z, level_of(x, y, z), inverse_voxel)
        if has_seam and times[i] > 0.0:  # at the seam, separates the start of the sweep from its end
            key |= 4
        slot = find_slot(keys, key)
        if keys[slot] == -1:
            keys[slot], row_of[slot] = key, n
            n += 1
        row = sums[row_of[slot]]
        row[0] += 1.0
        row[1] += x
        row[2] += y
        row[3] += z
        row[4] += x * x
        row[5] += x * y
        row[6] += x * z
        row[7] += y * y
        row[8] += y * z
        row[9] += z * z
        row[10] += times[i]
    return sums[:n]


@kernel
def moved(T, point):  # type: ignore[no-untyped-def]
    """Return x, y, z (float64) of a `point` (3,) moved by `T` (4, 4) or (3, 4)."""
    px, py, pz = float(point[0]), float(point[1]), float(point[2])
    x = T[0, 0] * px + T[0, 1] * py + T[0, 2] * pz + T[0, 3]
    y = T[1, 0] * px + T[1, 1] * py + T[1, 2] * pz + T[1, 3]
    z = T[2, 0] * px + T[2, 1] * py + T[2, 2] * pz + T[2, 3]
    return x, y, z
