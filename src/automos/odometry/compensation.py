"""Motion compensation: a sweep's points as the sensor would have measured them mid-sweep.

Motion within a sweep is modelled as a constant twist: half of it before the reference time (mid-sweep), half after.
"""

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.kernels import kernel
from automos.core.scan import Frame, Points, Pose, Scan
from automos.odometry.drifting_seam import drifting_times
from automos.odometry.sweep_timing import SweepTiming, sweep_times


def compensate(points: Points, times: npt.NDArray[np.float32], twist: npt.ArrayLike) -> Points:
    """Return `points` as the sensor would have measured them mid-sweep.

    Parameters
    ----------
    points : (N, 3) float32, metres, sensor frame at each point's own time.
    times : (N,) float32 in [-0.5, 0.5], from `sweep_times`.
    twist : (6,) se(3) motion of the sensor over one sweep, sensor frame.

    Equation: compensation
    """
    twist = np.asarray(twist, np.float64)
    if not np.any(twist):
        return points
    # Contiguous, so that the kernel is compiled only once.
    points, times = np.ascontiguousarray(points), np.ascontiguousarray(times)
    out = np.empty_like(points)
    _compensate(points, times, twist[:3], twist[3:], out)
    return out


def frame_of(scan: Scan, timing: SweepTiming, motion: Array, T_level_sensor: Pose, stamp: float) -> Frame:
    """Return the valid points of `scan`, compensated for the sensor's `motion` (6,) during the sweep.

    The original points are compensated, in their order, never a cloud returned by a registration: those are clipped and
    downsampled, so their rows no longer match the labels.
    """
    kept = np.flatnonzero(scan.is_valid)
    points = scan.points if len(kept) == len(scan) else np.take(scan.points, kept, axis=0)
    times = settled_times(scan, timing, motion, kept)
    if times is not None:
        points = compensate(points, times, motion)
    return Frame(
        points=points,
        kept=kept,
        n_points=len(scan),
        T_level_sensor=T_level_sensor,
        stamp=stamp,
        sweep_time=times,
        sweep_motion=motion,
        sensor=None if scan.sensor is None else scan.sensor[kept],
        T_scan_sensor=scan.T_scan_sensor,
    )


def settled_times(
    scan: Scan, timing: SweepTiming, twist: Array, rows: npt.NDArray[np.intp]
) -> npt.NDArray[np.float32] | None:
    """Return (M,) float32 times of the points in `rows` (M,) of `scan`, one each, or None if unknown.

    A static surface observed twice in one scan is observed at the same position: of a point's two possible times, a
    turn apart, the one is chosen that places the point closer to points of the other turn.
    """
    if timing.source != "azimuth" or timing.seam_deg is not None:
        known = sweep_times(scan, timing)
        return None if known is None else np.take(known, rows)
    all_times, is_any_twofold = np.zeros(len(scan), np.float32), np.zeros(len(scan), np.bool_)
    for of_sensor, part in map(scan.of_sensor, range(scan.n_sensors)):
        all_times[of_sensor], is_any_twofold[of_sensor] = drifting_times(part.points, timing.turn, timing.turns)
    times, is_twofold = np.take(all_times, rows), np.take(is_any_twofold, rows)
    if is_twofold.sum() < 2 or not np.any(twist):
        return times
    from scipy.spatial import cKDTree  # imported only for such recordings

    points, first = np.take(scan.points, rows[is_twofold], axis=0), times[is_twofold]
    second = np.minimum(first + np.float32(1.0 / timing.turns), np.float32(0.5))
    if_first, if_second = compensate(points, first, twist), compensate(points, second, twist)
    off_first, off_second = cKDTree(if_second).query(if_first)[0], cKDTree(if_first).query(if_second)[0]
    times[is_twofold] = np.where(off_second < off_first, second, first)
    return times


@kernel(fastmath=True)
def _compensate(points, times, rho, phi, out):  # type: ignore[no-untyped-def]
    """Apply exp(time * twist): Rodrigues' formula with sine and cosine as series, exact up to half a turn per sweep."""
    px, py, pz = phi[0], phi[1], phi[2]
    square = px * px + py * py + pz * pz
    rx, ry, rz = rho[0], rho[1], rho[2]
    sx, sy, sz = py * rz - pz * ry, pz * rx - px * rz, px * ry - py * rx  # phi x rho
    cx, cy, cz = py * sz - pz * sy, pz * sx - px * sz, px * sy - py * sx  # phi x (phi x rho)
    for i in range(len(points)):
        t = float(times[i])
        x, y, z = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        q = t * t * square  # the angle turned, squared
        sine = t * (1 + q * (-1 / 6 + q * (1 / 120 + q * (-1 / 5040 + q * (1 / 362880 - q / 39916800)))))
        cosine = t * t * (1 / 2 + q * (-1 / 24 + q * (1 / 720 + q * (-1 / 40320 + q / 3628800))))  # 1 - cos
        rest = t * t * t * (1 / 6 + q * (-1 / 120 + q * (1 / 5040 + q * (-1 / 362880 + q / 39916800))))  # angle - sin
        dot = px * x + py * y + pz * z
        out[i, 0] = x + sine * (py * z - pz * y) + cosine * (px * dot - square * x + sx) + t * rx + rest * cx
        out[i, 1] = y + sine * (pz * x - px * z) + cosine * (py * dot - square * y + sy) + t * ry + rest * cy
        out[i, 2] = z + sine * (px * y - py * x) + cosine * (pz * dot - square * z + sz) + t * rz + rest * cz
