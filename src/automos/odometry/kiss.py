"""Poses of every scan from the scans alone, with KISS-ICP (paper III-A; Vizzo et al., RA-L 2023).

Scans reach KISS-ICP already compensated to mid-sweep, so its poses are the sensor's at mid-sweep (its own compensation
would move them to the sweep's end), and a scan too poor to register holds the motion instead of breaking the map.

At the start nothing is known of the motion, and a registration that begins at rest while the sensor is in full flight
may stay at rest for good: rings lie on rings. So where the first scans seem to stand, or nearly, they are also
registered from a few speeds in either direction of the sensor's axes, and the start whose scans then align best over
longer baselines is taken. Amid traffic a standstill aligns well, too; but who stands sees landmarks again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, se3_exp, se3_log
from automos.odometry.clock import USUAL_PERIOD
from automos.odometry.links import COARSE, Window
from automos.odometry.motion import MIN_POINTS, SweepTiming, chain, usable_points
from automos.odometry.refine import refine_poses
from automos.odometry.registration import Icp, LocalMap
from automos.odometry.speed import search_speed
from automos.odometry.surfels import Surfels, surfels_of
from automos.scan import Points, Pose, Scan, Sequence
from automos.settings import OdometrySettings

Array = npt.NDArray[np.float64]

STEP_DIGITS = 6
"""Decimals (m, rad) of a step: sums of another order show in the sixteenth digit, and reruns are identical."""
UNKNOWN_MOTION, KNOWN_MOTION = 2.0, 0.5
"""Metres, deviation expected at first: while the motion is unknown, and once it is known."""
START_SCANS = 6
"""Scans registered twice, to know the motion during the first."""
CLEAR_STEP = 0.5
"""Metres from scan to scan: what pulls registrations off pulls them to rest, so faster starts are no mistaken rest."""
TRIED_STEPS = (1.0, 2.5)
"""Metres from scan to scan, tried where a start is slower, in either direction of the sensor's x and y."""
TRIAL_SURFELS = 3000
"""Of a scan, with which starts are compared, at most."""
SAME_START = 0.05
"""Metres from scan to scan between starts that registration has brought together: they are one."""
TRIAL_SCANS = 10
"""Scans whose alignment decides between these."""
TRIAL_GAIN = 0.2
"""Share by which another start must align them better, and one that landmarks contradict must do so, too."""
COARSE_VOXEL = 1.5
"""Metres, voxel of the local map that surfels are registered to: centimetres are left to what follows."""


@dataclass(frozen=True, eq=False)
class Registered:
    """One scan and where it was put.

    Attributes
    ----------
    T_last_this : (4, 4) from this scan's sensor frame to the one before (identity for the first).
    is_registered : False where the motion is only held.
    points : (M, 3) float32 the usable points, compensated.
    times : (M,) float32 in [-0.5, 0.5], or None where unknown.
    twist : (6,) motion during the sweep they were compensated with.
    """

    T_last_this: Pose
    is_registered: bool
    points: Points
    times: npt.NDArray[np.float32] | None
    twist: Array


def empty_map(settings: OdometrySettings) -> LocalMap:
    """Return the map that scans are registered on, without any yet."""
    voxel = settings.voxel or settings.max_range / 100.0
    return LocalMap(voxel, settings.points_per_voxel, settings.max_range)


class KissOdometry:
    """KISS-ICP with the motion it has seen, per usual gap, so that missing scans are bridged.

    `threshold` is the deviation from `twist` expected at first. KISS-ICP learns from great deviations only: with a good
    start it would look as far around as at first for ever, where rings match rings and pull to a standstill.
    """

    def __init__(
        self,
        settings: OdometrySettings,
        timing: SweepTiming,
        twist: Array,
        threshold: float,
        reverse: bool = False,
    ):
        self._icp = Icp(empty_map(settings), threshold, settings.max_range)
        self._timing = timing
        self._settings = settings
        self._sign = -1.0 if reverse else 1.0
        self._pose: Pose = np.eye(4)  # of the last scan
        self.twist = twist  # forwards in time, also where scans are registered backwards

    def register(self, scan: Scan, gap: float) -> Registered:
        """Return `scan` registered to the ones before, `gap` usual gaps after the last (0 for the first)."""
        step = se3_exp(self._sign * gap * self.twist)
        during = self._timing.share * self.twist
        points, times = usable_points(scan, self._timing, during, self._settings)
        is_registered = len(points) >= MIN_POINTS
        if is_registered:
            T = self._icp.register(points, self._pose @ step)
            step = se3_exp(np.round(se3_log(inverse(self._pose) @ T), STEP_DIGITS))
            if gap > 0.0:
                self.twist = self._sign / gap * se3_log(step)
        self._pose = self._pose @ step
        return Registered(step, is_registered, points, times, during)


def register_scans(
    sequence: Sequence, settings: OdometrySettings, timing: SweepTiming, gaps: Array
) -> Iterator[Registered]:
    """Yield every scan of `sequence` registered to the ones before.

    Parameters
    ----------
    sequence : the scans.
    settings : the odometry's.
    timing : when in the sweep each point was measured.
    gaps : (N - 1,) time between neighbouring scans, in units of the usual one (1 where no scan is missing).
    """
    start = find_start([sequence[i] for i in range(min(TRIAL_SCANS, len(sequence)))], settings, timing, gaps)
    odometry = KissOdometry(settings, timing, start, KNOWN_MOTION)
    for i, scan in enumerate(sequence):
        yield odometry.register(scan, gaps[i - 1] if i else 0.0)


def find_start(scans: list[Scan], settings: OdometrySettings, timing: SweepTiming, gaps: Array) -> Array:
    """Return the (6,) motion per usual gap at the first of `scans`, of which `TRIAL_SCANS` are enough."""
    rest = _from_rest(scans[:START_SCANS], settings, timing, gaps[: START_SCANS - 1])
    surfels = [surfels_of(*usable_points(scan, timing, np.zeros(6), settings)) for scan in scans]
    return _find_start(rest, surfels, settings, timing.share, gaps)


def register_surfels(surfels: list[Surfels], settings: OdometrySettings, gaps: Array) -> Pose:
    """Return (N - 1, 4, 4) rough steps from each scan to the one before, found with surfels as they came alone."""
    scans, settings = _as_scans(surfels), _coarse(settings)
    rest = _from_rest(scans[:START_SCANS], settings, SweepTiming(), gaps[: START_SCANS - 1])
    start = _find_start(rest, surfels[:TRIAL_SCANS], settings, 0.0, gaps)
    return _follow(KissOdometry(settings, SweepTiming(), start, KNOWN_MOTION), scans, gaps)


def _find_start(rest: Array, surfels: list[Surfels], settings: OdometrySettings, share: float, gaps: Array) -> Array:
    """Return the (6,) motion per usual gap at the start: `rest`, found from there, or another with which `surfels` fit.

    surfels : of the first scans, as they came.
    """
    surfels = [s[:: -(-len(s) // TRIAL_SURFELS) or 1] for s in surfels]
    scans, gaps = _as_scans(surfels), gaps[: len(surfels) - 1]
    settings, timing = _coarse(settings), SweepTiming("file", duration=1.0, share=share) if share else SweepTiming()
    if len(scans) <= START_SCANS:
        return rest
    axes = np.vstack([np.eye(6)[:2], -np.eye(6)[:2]])
    best, least, tried = rest, np.inf, list[Pose]()
    for twist in [rest, *(step * axis for axis in axes for step in TRIED_STEPS)]:
        steps = _follow(KissOdometry(settings, timing, twist, KNOWN_MOTION), scans, gaps)
        if any(np.linalg.norm((steps - other)[:, :3, 3], axis=1).mean() < SAME_START for other in tried):
            continue
        aligned, misfit = _align_start(steps, surfels, settings, share, gaps)
        start, is_from_rest = se3_log(aligned.steps[0]) / gaps[0], not tried
        if is_from_rest and (misfit is None or np.linalg.norm(start[:3]) > CLEAR_STEP):
            return rest
        if misfit is not None:
            misfit += is_from_rest * np.log1p(-TRIAL_GAIN)
            if misfit < least and search_speed(aligned, settings).landmarks.are_missed:
                misfit -= np.log1p(-TRIAL_GAIN)
            if misfit < least:
                best, least = rest if is_from_rest else start, misfit
        tried.append(steps)
    return best


def _from_rest(scans: list[Scan], settings: OdometrySettings, timing: SweepTiming, gaps: Array) -> Array:
    """Return the (6,) first motion that a few scans give: forwards from rest, then backwards."""
    forwards = KissOdometry(settings, timing, np.zeros(6), UNKNOWN_MOTION)
    _follow(forwards, scans, gaps)
    backwards = KissOdometry(settings, timing, forwards.twist, UNKNOWN_MOTION, reverse=True)
    _follow(backwards, scans[::-1], gaps[::-1])
    return backwards.twist


def _align_start(
    steps: Pose, surfels: list[Surfels], settings: OdometrySettings, share: float, gaps: Array
) -> tuple[Window, float | None]:
    """Return the scans aligned from (N - 1, 4, 4) `steps`, and how badly they align."""
    n, T = len(surfels), chain(np.eye(4), steps)
    as_they_came = Window(surfels, np.zeros((n, 6)), T, gaps, USUAL_PERIOD, share)
    aligned, _, links = refine_poses(as_they_came.moved(T), np.zeros(n, bool), settings, COARSE)
    return aligned, links.misfit


def _follow(odometry: KissOdometry, scans: list[Scan], gaps: Array) -> Pose:
    """Return (N - 1, 4, 4) steps from each scan to the one before."""
    steps = [odometry.register(scan, gap).T_last_this for scan, gap in zip(scans, [0.0, *gaps], strict=True)]
    return np.array(steps[1:]).reshape(-1, 4, 4)


def _as_scans(surfels: list[Surfels]) -> list[Scan]:
    return [Scan(s.mean, time=s.time + np.float32(0.5)) for s in surfels]


def _coarse(settings: OdometrySettings) -> OdometrySettings:
    return settings.model_copy(update={"voxel": COARSE_VOXEL})
