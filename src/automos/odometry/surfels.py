"""Surfels: the points of a scan in each voxel, as mean and covariance.

Voxels double in size with distance, as the beams diverge. A scan is reduced to a few thousand surfels that can be
moved, merged and matched at a thousandth of the cost of its points.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.kernels import kernel
from automos.core.scan import Points, Scan
from automos.core.voxels import find_slot, voxel_key
from automos.odometry.compensation import compensate
from automos.odometry.elevation import raised
from automos.odometry.motion import usable_points
from automos.odometry.sweep_timing import SweepTiming
from automos.settings import OdometrySettings

N_LEVELS = 4
"""Voxel sizes: each covers twice the distance of the previous one."""
NEAR = 20.0
"""Metres up to which voxels have their smallest size: beams of usual sensors are at most 10 cm apart there."""
SURFEL = 0.4
"""Metres, smallest voxel edge for surfels: large enough for several points, small enough to be flat."""
MIN_SURFEL_POINTS = 3
"""Points of a surfel, at least: fewer have no extent."""


@dataclass(frozen=True, eq=False)
class TimedPoints:
    """Positions in one frame, and when in the sweep they were measured."""

    mean: Points  # (M, 3) metres
    time: npt.NDArray[np.float32]  # (M,) in [-0.5, 0.5], mean time in the sweep (zero if unknown)

    def __len__(self) -> int:
        return len(self.mean)

    def __getitem__(self, rows: npt.NDArray | slice) -> "TimedPoints":
        return TimedPoints(self.mean[rows], self.time[rows])

    def compensated(self, twist: Array) -> Self:
        """Return them compensated for the motion `twist` (6,) during the sweep."""
        return replace(self, mean=compensate(self.mean, self.time, twist))


@dataclass(frozen=True, eq=False)
class Surfels(TimedPoints):
    """Surfels in one frame."""

    covariance: npt.NDArray[np.float32]  # (M, 6) square metres: xx, xy, xz, yy, yz, zz of the points about their mean
    count: npt.NDArray[np.float32]  # (M,) points
    sparse: TimedPoints | None = None  # means of the whole scan's voxels with too few points for a surface

    def __getitem__(self, rows: npt.NDArray | slice) -> "Surfels":
        return Surfels(self.mean[rows], self.time[rows], self.covariance[rows], self.count[rows])

    def compensated(self, twist: Array) -> Self:
        """Return them compensated for the motion `twist` (6,), the sparse ones, too."""
        sparse = None if self.sparse is None else self.sparse.compensated(twist)
        return replace(super().compensated(twist), sparse=sparse)

    def raised(self, angle: float) -> Self:
        """Return them as if the beams pointed `angle` radians higher; their shapes are kept."""
        return replace(self, mean=raised(self.mean, angle))


def make_surfels(points: Points, times: npt.NDArray[np.float32] | None, has_seam: bool = False) -> Surfels:
    """Return all surfels of one scan; see `surfels_of`."""
    if times is None:
        times = np.zeros(len(points), np.float32)
    size = 1 << max(len(points), 16).bit_length()
    sums = _sum_moments(np.ascontiguousarray(points), times, has_seam, size)
    moments = sums[:, 1:] * (1.0 / sums[:, :1])
    mean, second = moments[:, :3], moments[:, 3:9]
    covariance = second - mean[:, [0, 0, 0, 1, 1, 2]] * mean[:, [0, 1, 2, 1, 2, 2]]
    return Surfels(*(part.astype(np.float32) for part in (mean, moments[:, 9], covariance, sums[:, 0])))


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
    return replace(surfels[is_surface], sparse=TimedPoints(surfels.mean[~is_surface], surfels.time[~is_surface]))


def scan_surfels(scan: Scan, twist: Array, timing: SweepTiming, settings: OdometrySettings) -> Surfels:
    """Return the surfels of `scan`, compensated for the `twist` (6,) of its sweep with the times of `timing`."""
    return surfels_of(*usable_points(scan, timing, twist, settings), timing.has_seam)


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
        key = key_at_level(x, y, z, level_of(x, y, z), inverse_voxel)
        if has_seam and times[i] > 0.0:  # at the seam, separates the start of the sweep from its end
            key |= 4
        slot = find_slot(keys, key)
        if keys[slot] == -1:
            keys[slot], row_of[slot] = key, n
            n += 1
        row = sums[row_of[slot]]
        moments = (np.float32(1.0), x, y, z, x * x, x * y, x * z, y * y, y * z, z * z, times[i])
        for k in range(len(moments)):
            row[k] += moments[k]
    return sums[:n]
