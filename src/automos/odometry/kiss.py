"""Poses of every scan from the scans alone, with KISS-ICP (paper III-A; Vizzo et al., RA-L 2023).

Scans are compensated to mid-sweep before KISS-ICP, so its poses refer to mid-sweep (its own compensation would move
them to the sweep's end). If a scan has too few points to register, the motion is extrapolated and the map kept.

A registration that starts at rest may stay at rest while the sensor drives fast, because rings coincide. So the first
scans are also registered from a few speeds, and the start whose scans align best over longer baselines is chosen.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array, inverse, se3_exp, se3_log
from automos.core.scan import Points, Pose, Scan, Sequence
from automos.odometry.clock import USUAL_PERIOD
from automos.odometry.links import COARSE, Window
from automos.odometry.motion import MIN_POINTS, chain, usable_points
from automos.odometry.refine import refine_poses
from automos.odometry.registration import Icp, LocalMap
from automos.odometry.surfels import Surfels, scan_surfels
from automos.odometry.sweep_timing import SweepTiming
from automos.settings import OdometrySettings

STEP_DIGITS = 6
"""Decimals (m, rad) of a step: rounding removes the effect of the summation order, so that reruns are identical."""
UNKNOWN_MOTION, KNOWN_MOTION = 2.0, 0.5
"""Metres, initial expected deviation while the motion is unknown, and once it is known."""
START_SCANS = 6  # scans registered twice to estimate the motion during the first one
CLEAR_STEP = 0.5
"""Metres per scan: registrations are biased towards rest, so a faster start is not a mistaken standstill."""
TRIED_STEPS = (1.0, 2.5)  # metres per scan, tried if a start is slower, in both directions of the sensor's x and y axes
TRIAL_SURFELS = 3000  # surfels of a scan with which starts are compared, at most
SAME_START = 0.05  # metres per scan between starts that converged to the same motion, at most
TRIAL_SCANS = 10  # scans whose alignment decides between starts
COARSE_VOXEL = 1.5
"""Metres, voxel of the local map that surfels are registered to: later steps provide centimetre accuracy."""


class Registered(NamedTuple):
    """One registered scan."""

    T_last_this: Pose  # (4, 4) from this scan's sensor frame to the previous one (identity for the first)
    is_registered: bool  # False if the motion is extrapolated
    points: Points  # (M, 3) usable points, compensated
    times: npt.NDArray[np.float32] | None  # (M,) in [-0.5, 0.5] of the sweep, None if unknown
    twist: Array  # (6,) motion during the sweep, used for the compensation


def empty_map(settings: OdometrySettings) -> LocalMap:
    """Return an empty map to register scans to."""
    voxel = settings.voxel or settings.max_range / 100.0
    return LocalMap(voxel, settings.points_per_voxel, settings.max_range)


class KissOdometry:
    """KISS-ICP with a motion model per usual gap, which bridges missing scans.

    `threshold` is the initial expected deviation from `twist`. KISS-ICP adapts it from large deviations only: with a
    good start, it would keep a large search range, in which rings match rings and bias the motion to standstill.
    """

    def __init__(
        self, settings: OdometrySettings, timing: SweepTiming, twist: Array, threshold: float, reverse: bool = False
    ):
        self._icp = Icp(empty_map(settings), threshold)
        self._timing, self._settings = timing, settings
        self._sign = -1.0 if reverse else 1.0
        self._pose: Pose = np.eye(4)  # of the last scan
        self.twist = twist  # forwards in time, even if scans are registered backwards

    def register(self, scan: Scan, gap: float) -> Registered:
        """Return `scan` registered to the previous ones, `gap` usual gaps after the last one (0 for the first)."""
        step = se3_exp(self._sign * gap * self.twist)
        during = self._timing.share * self.twist
        points, times = usable_points(scan, self._timing, during, self._settings)
        if is_registered := len(points) >= MIN_POINTS:
            T = self._icp.register(points, self._pose @ step)
            step = se3_exp(np.round(se3_log(inverse(self._pose) @ T), STEP_DIGITS))
            if gap > 0.0:
                self.twist = self._sign / gap * se3_log(step)
        self._pose = self._pose @ step
        return Registered(step, is_registered, points, times, during)


def register_scans(
    sequence: Sequence, settings: OdometrySettings, timing: SweepTiming, gaps: Array
) -> Iterator[Registered]:
    """Yield every scan of `sequence` registered to the previous ones; `gaps` as in `Clock`."""
    start = find_start([sequence[i] for i in range(min(TRIAL_SCANS, len(sequence)))], settings, timing, gaps)
    odometry = KissOdometry(settings, timing, start, KNOWN_MOTION)
    for i, scan in enumerate(sequence):
        yield odometry.register(scan, gaps[i - 1] if i else 0.0)


def find_start(scans: list[Scan], settings: OdometrySettings, timing: SweepTiming, gaps: Array) -> Array:
    """Return the (6,) motion per usual gap at the first of `scans`; the first `TRIAL_SCANS` suffice."""
    rest = _from_rest(scans[:START_SCANS], settings, timing, gaps[: START_SCANS - 1])
    surfels = [scan_surfels(scan, np.zeros(6), timing, settings) for scan in scans]
    return _find_start(rest, surfels, settings, timing.share, gaps)


def register_surfels(surfels: list[Surfels], settings: OdometrySettings, gaps: Array) -> Pose:
    """Return (N - 1, 4, 4) rough steps from each scan to the previous one, from uncompensated surfels alone."""
    scans, settings = _as_scans(surfels), settings.model_copy(update={"voxel": COARSE_VOXEL})
    rest = _from_rest(scans[:START_SCANS], settings, SweepTiming(), gaps[: START_SCANS - 1])
    start = _find_start(rest, surfels[:TRIAL_SCANS], settings, 0.0, gaps)
    return _follow(KissOdometry(settings, SweepTiming(), start, KNOWN_MOTION), scans, gaps)


def _find_start(rest: Array, surfels: list[Surfels], settings: OdometrySettings, share: float, gaps: Array) -> Array:
    """Return the (6,) motion per usual gap at the start: `rest`, estimated from rest, or one that aligns better.

    surfels : those of the first scans, uncompensated.
    """
    surfels = [s[:: -(-len(s) // TRIAL_SURFELS) or 1] for s in surfels]
    scans, gaps = _as_scans(surfels), gaps[: len(surfels) - 1]
    settings = settings.model_copy(update={"voxel": COARSE_VOXEL})
    timing = SweepTiming("file", duration=1.0, share=share) if share else SweepTiming()
    if len(scans) <= START_SCANS:
        return rest
    axes = np.vstack([np.eye(6)[:2], -np.eye(6)[:2]])
    best, least, tried = rest, np.inf, list[Pose]()
    for twist in [rest, *(step * axis for axis in axes for step in TRIED_STEPS)]:
        steps = _follow(KissOdometry(settings, timing, twist, KNOWN_MOTION), scans, gaps)
        if any(np.linalg.norm((steps - other)[:, :3, 3], axis=1).mean() < SAME_START for other in tried):
            continue
        T = chain(np.eye(4), steps)
        uncompensated = Window(surfels, np.zeros((len(surfels), 6)), T, gaps, USUAL_PERIOD, share)
        aligned, consistency = refine_poses(uncompensated.moved(T), settings, COARSE)
        misfit = consistency.misfit
        start, is_from_rest = se3_log(aligned.steps[0]) / gaps[0], not tried
        if is_from_rest and (misfit is None or np.linalg.norm(start[:3]) > CLEAR_STEP):
            return rest
        if misfit is not None and misfit < least:
            best, least = rest if is_from_rest else start, misfit
        tried.append(steps)
    return best


def _from_rest(scans: list[Scan], settings: OdometrySettings, timing: SweepTiming, gaps: Array) -> Array:
    """Return the (6,) initial motion from a few scans, registered forwards from rest, then backwards."""
    forwards = KissOdometry(settings, timing, np.zeros(6), UNKNOWN_MOTION)
    _follow(forwards, scans, gaps)
    backwards = KissOdometry(settings, timing, forwards.twist, UNKNOWN_MOTION, reverse=True)
    _follow(backwards, scans[::-1], gaps[::-1])
    return backwards.twist


def _follow(odometry: KissOdometry, scans: list[Scan], gaps: Array) -> Pose:
    """Return (N - 1, 4, 4) steps from each scan to the previous one."""
    steps = [odometry.register(scan, gap).T_last_this for scan, gap in zip(scans, [0.0, *gaps], strict=True)]
    return np.array(steps[1:]).reshape(-1, 4, 4)


def _as_scans(surfels: list[Surfels]) -> list[Scan]:
    """Return scans whose points are the means of surfels, with the times of a "file" of one second per sweep."""
    return [Scan(s.mean, time=s.time + np.float32(0.5)) for s in surfels]
