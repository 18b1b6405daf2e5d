"""Point times within the sweep, and motion compensation of points to mid-sweep.

Motion within a sweep is modelled as a constant twist: half of it before the reference time (mid-sweep), half after.
Times are fractions of a sweep in [-0.5, 0.5], so no clock is needed.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import accumulate
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from automos.geometry import Array, inverse, se3_log
from automos.kernels import kernel
from automos.odometry.drifting_seam import drifting_times, turns_from
from automos.odometry.sweep_order import PointOrder, turns_since_start
from automos.scan import MIN_RANGE, Points, Pose, Scan
from automos.settings import OdometrySettings

LONGEST_SWEEP = 1e4
"""Seconds; larger values are not times within a sweep: the slowest surveying scanners take minutes."""
MIN_POINTS = 50
"""Usable points that a scan needs for registration and for the ground search."""
ACCELERATION_SECONDS = 0.5
"""Interval over which accelerations are measured: within shorter ones, a handheld sensor shakes more than a vehicle."""
MAX_ACCELERATION = 8.0
"""m/s², an emergency stop. Poses that switch between following the world and the traffic exceed it."""


@dataclass(frozen=True)
class SweepTiming:
    """How the time of each point within its sweep is known.

    Its source is "file": times in the scans; "order": the advance of the azimuth along the file; "index": the place in
    the file, of a sensor that measures at a steady rate; "azimuth": the azimuth of the point; or "none": the points are
    already compensated, or it is unknown.
    """

    source: Literal["file", "order", "index", "azimuth", "none"] = "none"
    duration: float = 0.0  # "file": seconds from a sweep's first point to its last
    turn: int = 0  # "azimuth", "order": +1 counter-clockwise seen from the sensor's +z, -1 clockwise
    seam_deg: float | None = 0.0  # "azimuth": where a sweep starts and ends, from +x towards +y; None if it drifts
    turns: float = 1.0  # "azimuth": turns per scan if the seam drifts
    share: float = 0.0  # sweep duration over the time between scans; 0 for "none", negative if played backwards
    order: PointOrder | None = None  # "order" only

    @property
    def has_fixed_seam(self) -> bool:
        """Whether the azimuth alone gives the time, of a surfel as of a point."""
        return self.source == "azimuth" and self.seam_deg is not None

    @property
    def has_seam(self) -> bool:
        """Whether the times are known to be those of a rotating sensor."""
        return self.source in ("azimuth", "order")

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as plain numbers and text, for `from_dict`."""
        return asdict(self)

    @staticmethod
    def from_dict(fields: dict[str, Any]) -> SweepTiming:
        """Return the timing from the fields of `to_dict`."""
        order = fields.get("order")
        known = None if order is None else {name: order[name] for name in ("turn", "turns", "turns_per_scan", "start")}
        return SweepTiming(**{**fields, "order": None if known is None else PointOrder(**known)})

    def __str__(self) -> str:
        """Return the timing in a few words."""
        turning = {1: "counter-clockwise", -1: "clockwise"}
        if self.source == "none":
            return "none (compensated already, or unknown)"
        if self.source == "file":
            text = f"times in the file ({1e3 * self.duration:.0f} ms a scan)"
        elif self.source == "index":
            text = "order of the points (a steady rate)"
        elif self.order is not None:
            text = f"order of the points ({turning[self.order.turn]}, {self.order.turns:.2f} turns a scan)"
        else:
            is_fixed = self.seam_deg is not None
            seam = f"at {self.seam_deg:.0f} degrees" if is_fixed else f"drifting, {self.turns:.2f} turns a scan"
            text = f"azimuth ({turning[self.turn]}, seam {seam})"
        part = abs(self.share) / max(1.0 if self.order is None else self.order.span / self.order.turns_per_scan, 1e-9)
        if self.source != "file" and part < 0.6:
            text += f", {part:.2g} of the time between scans"
        return f"{text}, backwards" if self.share < 0.0 else text


def recorded_duration(scan: Scan) -> float | None:
    """Return the seconds from a sweep's first point to its last according to the scan's times; None if unknown.

    Ignores NaN and times above `LONGEST_SWEEP`.
    """
    if scan.time is None or not scan.is_valid.any():
        return None
    times = scan.time[np.abs(scan.time) < LONGEST_SWEEP]  # never true of NaN
    return float(times.max(initial=0.0)) or None


def sweep_times(scan: Scan, timing: SweepTiming) -> npt.NDArray[np.float32] | None:
    """Return (N,) float32 times of all points of `scan` in [-0.5, 0.5] of a sweep, or None if unknown.

    NaN for points with two possible times: `trajectory.settled_times` chooses one once the motion is known.
    """
    if timing.source == "none":
        return None
    if timing.source == "order" and timing.order is not None:
        fraction = turns_since_start(scan, timing.order) / np.float32(timing.order.span) - np.float32(0.5)
        return np.minimum(fraction, np.float32(0.5))
    if timing.source == "index":
        return (np.arange(len(scan), dtype=np.float32) + np.float32(0.5)) / np.float32(len(scan)) - np.float32(0.5)
    if timing.source == "azimuth":
        if timing.seam_deg is None:
            times, is_twofold = drifting_times(scan.points, timing.turn, timing.turns)
            times[is_twofold] = np.nan
            return times
        return azimuth_times(scan.points, timing.turn, timing.seam_deg)
    if scan.time is None:
        return np.zeros(len(scan), np.float32)
    fraction = np.nan_to_num(scan.time / np.float32(timing.duration) - np.float32(0.5))
    return np.clip(fraction, -0.5, 0.5).astype(np.float32)


def azimuth_times(points: Points, turn: int, seam_deg: float) -> npt.NDArray[np.float32]:
    """Return (N,) float32 times in [-0.5, 0.5] of `points` (N, 3) from a sensor that rotates about its z axis.

    `turn` is +1 for counter-clockwise, -1 for clockwise; sweeps start and end at azimuth `seam_deg`.
    """
    return turns_from(np.ascontiguousarray(points), turn, seam_deg / 360.0, 0.5)


def compensate(points: Points, times: npt.NDArray[np.float32], twist: npt.ArrayLike) -> Points:
    """Return `points` as the sensor would have measured them mid-sweep.

    Parameters
    ----------
    points : (N, 3) float32, metres, sensor frame at each point's own time.
    times : (N,) float32 in [-0.5, 0.5], from `sweep_times`.
    twist : (6,) se(3) motion of the sensor over one sweep, sensor frame.
    """
    twist = np.asarray(twist, np.float64)
    if not np.any(twist):
        return points
    # Contiguous, so that the kernel is compiled only once.
    points, times = np.ascontiguousarray(points), np.ascontiguousarray(times)
    out = np.empty_like(points)
    _compensate(points, times, twist[:3], twist[3:], out)
    return out


def usable_points(
    scan: Scan, timing: SweepTiming, twist: Array, settings: OdometrySettings
) -> tuple[Points, npt.NDArray[np.float32] | None]:
    """Return the valid points in range (M, 3), compensated for `twist` (6,), and their times (M,) or None.

    Points with two possible times are left out.
    """
    points, times = timed_points(scan, timing, settings)
    return (points, None) if times is None else (compensate(points, times, twist), times)


def timed_points(
    scan: Scan, timing: SweepTiming, settings: OdometrySettings
) -> tuple[Points, npt.NDArray[np.float32] | None]:
    """Return the valid points in range (M, 3), uncompensated, with times (M,) or None; leaves out ambiguous times."""
    rows = _rows_in_range(scan.points, max(settings.min_range, MIN_RANGE), settings.max_range)
    times = sweep_times(scan, timing)
    if times is not None:
        times = np.take(times, rows)
        is_known = np.isfinite(times)
        if not is_known.all():
            rows, times = rows[is_known], times[is_known]
    return np.take(scan.points, rows, axis=0), times  # [rows] takes five times as long


def chain(T_first: Pose, steps: Pose) -> Pose:
    """Return the (N, 4, 4) poses from `T_first` and the following (N - 1, 4, 4) `steps`."""
    return np.array(list(accumulate(steps, np.matmul, initial=T_first)))


def step_twists(poses: Pose, gaps: Array) -> Array:
    """Return (N, 6) twists per usual gap at each scan: the mean of the steps before and after it."""
    n = len(poses)
    if n < 2:
        return np.zeros((n, 6))
    steps = se3_log(inverse(poses[:-1]) @ poses[1:]) / gaps[:, None]
    before, after = np.vstack([steps[:1], steps]), np.vstack([steps, steps[-1:]])
    return 0.5 * (before + after)


def greatest_acceleration(poses: Pose, times: Array) -> tuple[float, int]:
    """Return the greatest acceleration, m/s², of (N, 4, 4) `poses` over half a second, and its middle scan."""
    if len(times) < 2:
        return 0.0, 0
    span = max(ACCELERATION_SECONDS, 1.5 * float(np.median(np.diff(times))))
    middle = np.flatnonzero((times - span >= times[0]) & (times + span <= times[-1]))
    if len(middle) == 0:
        return 0.0, 0

    def at(when: Array) -> Array:
        return np.stack([np.interp(when, times, along) for along in poses[:, :3, 3].T], axis=1)

    change = at(times[middle] + span) - 2.0 * poses[middle, :3, 3] + at(times[middle] - span)
    found = np.linalg.norm(change, axis=1) / span**2
    return float(found.max()), int(middle[np.argmax(found)])


def can_be_driven(poses: Pose, times: Array) -> bool:
    """Return whether a vehicle can follow (N, 4, 4) `poses` at `times` (N,), seconds."""
    return greatest_acceleration(poses, times)[0] <= MAX_ACCELERATION


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


@kernel
def _rows_in_range(points, nearest, farthest):  # type: ignore[no-untyped-def]
    rows = np.empty(len(points), np.int32)
    n = 0
    for i in range(len(points)):
        x, y, z = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        squared = x * x + y * y + z * z
        if nearest * nearest < squared < farthest * farthest:  # never true of NaN
            rows[n] = i
            n += 1
    return rows[:n]
