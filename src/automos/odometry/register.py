"""Every scan of a recording registered to the ones before, from a start at which nothing is known of the motion.

A registration that begins at rest while the sensor is in full flight may stay at rest for good: rings lie on rings. So
where the first scans seem to stand, or nearly, they are also registered from a few speeds in either direction of the
sensor's axes, and the start under which they fold best onto each other is taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, se3_log
from automos.odometry.clock import USUAL_PERIOD
from automos.odometry.kiss import CAREFUL, KNOWN_MOTION, UNKNOWN_MOTION, Effort, KissOdometry, Registered, map_voxel
from automos.odometry.links import Alignment
from automos.odometry.motion import SweepTiming
from automos.odometry.refine import refine_poses
from automos.odometry.registration import rows_of_first_in_voxel
from automos.odometry.speed import chain
from automos.odometry.stretch import Stretch
from automos.odometry.surfels import Surfels
from automos.odometry.sweeps import surfels_of, usable_points
from automos.scan import Scan, Sequence
from automos.settings import OdometrySettings

Array = npt.NDArray[np.float64]

START_ALIGNMENT = Alignment(kernels=(0.2, 0.2), noise=0.05, submap_length=0.5, max_distance=40.0, max_surfels=1200)
"""How poses from each start are made to fit: wide enough not to overlook what does not."""
START_SCANS = 6
"""Scans registered twice, to know the motion during the first."""
CLEAR_STEP = 0.2
"""Metres from scan to scan, faster starts are no mistaken rest."""
TRIED_STEPS = (1.0, 2.5)
"""Metres from scan to scan, tried at slower ones."""
FOLD_SCANS = 10
"""Scans whose folding decides between these."""
TRIAL_VOXEL = 1.5
"""Metres, voxel of the local map in these trials."""
TRIAL_ITERATIONS = 20
"""Of one registration in these trials."""
TRIAL_GAIN = 0.2
"""Share by which they must fold better."""


def register_scans(
    sequence: Sequence,
    settings: OdometrySettings,
    timing: SweepTiming,
    gaps: Array,
    effort: Effort = CAREFUL,
) -> Iterator[Registered]:
    """Yield every scan of `sequence` registered to the ones before.

    Parameters
    ----------
    sequence : the scans.
    settings : the odometry's.
    timing : when in the sweep each point was measured.
    gaps : (N - 1,) time between neighbouring scans, in units of the usual one (1 where no scan is missing).
    effort : how long each registration goes on.
    """
    twist = _first_twist(sequence, settings, timing, gaps, effort)
    odometry = KissOdometry(settings, timing, twist, KNOWN_MOTION, effort=effort)
    for i, scan in enumerate(sequence):
        yield odometry.register(scan, gaps[i - 1] if i else 0.0)


def _first_twist(
    sequence: Sequence, settings: OdometrySettings, timing: SweepTiming, gaps: Array, effort: Effort
) -> Array:
    """Return the (6,) motion per usual gap at the start."""
    scans = [sequence[i] for i in range(min(START_SCANS, len(sequence)))]
    twist = _twist_from_rest(scans, settings, timing, gaps, effort)
    if len(sequence) <= START_SCANS:
        return twist
    n = min(FOLD_SCANS, len(sequence))
    trials = [_Trial.of(sequence[i], settings, timing) for i in range(n)]
    folded, misfit = _fold_from(twist, trials, settings, timing, gaps, effort)
    # What pulls registrations off pulls them to rest, so a motion that remains is none by mistake.
    if misfit is None or np.linalg.norm(folded[:3]) > CLEAR_STEP:
        return twist
    best, best_misfit = twist, misfit + np.log1p(-TRIAL_GAIN)
    quick = settings.model_copy(update={"voxel": TRIAL_VOXEL})
    hasty = replace(effort, max_iterations=TRIAL_ITERATIONS)
    for direction in np.vstack([np.eye(6)[:2], -np.eye(6)[:2]]):
        for step in TRIED_STEPS:
            guess, misfit = _fold_from(step * direction, trials, quick, timing, gaps, hasty)
            if misfit is not None and misfit < best_misfit:
                best, best_misfit = guess, misfit
    return best


@dataclass(frozen=True, eq=False)
class _Trial:
    """A scan thinned out as KISS-ICP does first of all, for quick trials, and its surfels as they came."""

    thin: Scan
    surfels: Surfels

    @staticmethod
    def of(scan: Scan, settings: OdometrySettings, timing: SweepTiming) -> _Trial:
        points, times = usable_points(scan, timing, np.zeros(6), settings)
        rows = rows_of_first_in_voxel(points, 0.5 * map_voxel(settings))
        thin = Scan(points[rows], time=None if times is None else timing.duration * (times[rows] + np.float32(0.5)))
        return _Trial(thin, surfels_of(points, times))


def _twist_from_rest(
    scans: list[Scan], settings: OdometrySettings, timing: SweepTiming, gaps: Array, effort: Effort
) -> Array:
    """Return the (6,) first motion that a few scans give: forwards from rest, then backwards.

    A registration that starts far off moves on in small steps, so here it must not be content with little.
    """
    effort = replace(effort, convergence=min(effort.convergence, effort.start_convergence))
    n = len(scans)
    forwards = KissOdometry(settings, timing, np.zeros(6), UNKNOWN_MOTION, effort=effort)
    for i, scan in enumerate(scans):
        forwards.register(scan, gaps[i - 1] if i else 0.0)
    backwards = KissOdometry(settings, timing, forwards.twist, UNKNOWN_MOTION, True, effort)
    for i in reversed(range(n)):
        backwards.register(scans[i], gaps[i] if i < n - 1 else 0.0)
    return backwards.twist


def _fold_from(
    twist: Array,
    scans: list[_Trial],
    settings: OdometrySettings,
    timing: SweepTiming,
    gaps: Array,
    effort: Effort,
) -> tuple[Array, float | None]:
    """Return the (6,) first motion found from the guess `twist`, and how badly the scans fold with what follows."""
    odometry = KissOdometry(settings, timing, twist, KNOWN_MOTION, effort=effort)
    steps = [odometry.register(scan.thin, gaps[i - 1] if i else 0.0).T_last_this for i, scan in enumerate(scans)]
    n = len(scans)
    T = chain(np.eye(4), np.array(steps[1:]))
    gaps = gaps[: n - 1]
    raw = Stretch([scan.surfels for scan in scans], np.zeros((n, 6)), T, gaps, USUAL_PERIOD, timing.share)
    folded, _, links = refine_poses(raw.moved(T), np.zeros(n, bool), settings, START_ALIGNMENT)
    T = folded.T_world_sensor
    return se3_log(inverse(T[0]) @ T[1]) / gaps[0], links.misfit
