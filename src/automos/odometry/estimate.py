"""The steps of the odometry: sweep timing, poses, refinement, ground (paper III-A)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from automos.core.errors import InputError
from automos.core.geometry import Array, checked_poses
from automos.core.parallel import available_cores
from automos.core.scan import Pose, Sequence
from automos.core.views import distinct_scans
from automos.odometry.clock import Clock, read_clock
from automos.odometry.kiss import register_scans
from automos.odometry.links import measure_consistency, summarize
from automos.odometry.motion import MAX_ACCELERATION, chain, greatest_acceleration, step_twists, usable_points
from automos.odometry.refine import RollingRefinement
from automos.odometry.speed import speed_figures
from automos.odometry.surfels import surfels_of
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.timing import TimingChoice, choose_timing
from automos.odometry.trajectory import Trajectory
from automos.odometry.vertical import MIN_POINTS, level_frame
from automos.settings import OdometrySettings

GROUND_SCANS = 20  # scans of a recording in which the ground is searched
WITHOUT_CLOCK = 4.0
"""Factor by which accelerations may be overestimated without stamps: the slowest sensors rotate at 5 Hz."""
Progress = Callable[[int, int], None]
MOST_PASSES = 2  # times that all scans are registered, at most: again, if scans turn out to be missing


class Registration(NamedTuple):
    """All scans, registered."""

    poses: Pose  # (N, 4, 4)
    gaps: Array  # (N - 1,) time between neighbouring scans over the usual one
    extrapolated: list[int]  # scans with too few points to register
    figures: dict[str, Any]  # of the refinement


def estimate_trajectory(
    sequence: Sequence,
    settings: OdometrySettings,
    poses: Pose | None = None,
    progress: Progress | None = None,
    workers: int = 0,
) -> Trajectory:
    """Return the poses and the motion of the sensor at every scan of `sequence`.

    Parameters
    ----------
    sequence : Sequence, at least one scan.
    settings : OdometrySettings
    poses : (N, 4, 4) T_world_sensor, optional, known poses: then nothing is registered; only the motion during each
        sweep and the ground are estimated.
    progress : callable, optional, receives the number of processed scans and their total.
    workers : int, threads, 0: one per core; the result does not depend on it.

    Raises
    ------
    InputError
        If the sequence is empty, or the poses are not one rigid transform per scan.
    """
    from threadpoolctl import threadpool_limits

    if len(sequence) == 0:
        raise InputError(f"{sequence.name} holds no scans; give a folder with at least one scan.")
    is_repeat = sequence.repeats
    if poses is None and is_repeat is not None and is_repeat[1:].any() and not is_repeat[0]:
        distinct = estimate_trajectory(distinct_scans(sequence, is_repeat), settings, None, progress, workers)
        return distinct.with_repeats(is_repeat)
    # The pool's threads share the work; BLAS threads would only spin on the same cores for small matrices.
    with ThreadPoolExecutor(workers or available_cores()) as pool, threadpool_limits(1, "blas"):
        estimate = _Estimate(sequence, settings, read_clock(sequence), pool, progress)
        # Steps 1 to 4 of docs/odometry.md: timing of the points, initial poses, speed, refinement.
        if poses is None:
            poses, timing = estimate.from_scans()
        else:
            poses = checked_poses(poses, len(sequence))
            timing = estimate.timing_at(poses).timing
        motion = timing.share * step_twists(poses, estimate.clock.gaps)
        estimate.check(poses, timing)  # step 5
        T_level_world, has_ground = _find_level(sequence, poses, timing, motion, settings)  # step 6
    if not has_ground:
        estimate.warnings.append(
            "no ground found near the sensor; its z axis is used as vertical and its height as zero."
        )
    diagnostics = {"warnings": estimate.warnings, **estimate.figures}
    return Trajectory(poses, estimate.clock.stamps, motion, timing, T_level_world, diagnostics)


def _find_level(
    sequence: Sequence, poses: Pose, timing: SweepTiming, motion: Array, settings: OdometrySettings
) -> tuple[Pose, bool]:
    """Return `T_level_world` and whether ground was found, from a few scans of the recording."""
    ids = np.unique(np.linspace(0, len(sequence) - 1, GROUND_SCANS).round().astype(int)).tolist()
    clouds = {i: usable_points(sequence[i], timing, motion[i], settings)[0] for i in ids}
    used = [i for i in ids if len(clouds[i]) >= MIN_POINTS]
    return level_frame([clouds[i] for i in used], poses[used], settings)


@dataclass
class _Estimate:
    """Poses and timing of one recording."""

    sequence: Sequence
    settings: OdometrySettings
    clock: Clock
    pool: ThreadPoolExecutor
    progress: Progress | None
    warnings: list[str] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)

    def timing_at(self, poses: Pose | None) -> TimingChoice:
        """Return the timing under which scans align best, at given (N, 4, 4) `poses` or else at estimated ones."""
        choice = choose_timing(self.sequence, self.settings, poses, self.clock, self.pool)
        self.figures["timing"] = choice.to_dict()
        return choice

    def from_scans(self) -> tuple[Pose, SweepTiming]:
        """Return (N, 4, 4) poses and the timing, from the scans alone."""
        choice = self.timing_at(None)
        poses = self._poses_under(choice.timing)
        if self.settings.time in ("auto", "azimuth") and not choice.suits(poses):
            # The poses used for the choice followed the traffic: choose the timing again.
            better = self.timing_at(poses)
            if better.timing != choice.timing:
                self.warnings = []
                poses = self._poses_under(better.timing)
            choice = better
        return poses, choice.timing

    def check(self, poses: Pose, timing: SweepTiming) -> None:
        """Measure how well scans align with (N, 4, 4) `poses`, and add the warnings that follow."""
        sequence, settings, clock, figures = self.sequence, self.settings, self.clock, self.figures
        if "wall_thickness_m" not in figures:
            figures.update(summarize(measure_consistency(sequence, poses, timing, clock.gaps, clock.period, settings)))
        acceleration, at = greatest_acceleration(poses, clock.stamps)
        figures |= {"greatest_acceleration_m_s2": acceleration, "greatest_acceleration_at": sequence.names[at]}
        self.warnings += doubts(figures, settings, clock.has_stamps)

    def _poses_under(self, timing: SweepTiming) -> Pose:
        """Return (N, 4, 4) poses under a timing; corrects the clock if scans are missing."""
        names, given = self.sequence.names, self.clock.gaps
        found = self._register(timing)
        if len(missing := np.flatnonzero(self.clock.gaps != given)):
            self.warnings.append(
                f"scans seem to be missing at {len(missing)} places (first: before {names[missing[0] + 1]}); "
                "without stamps, their number was estimated from the motion and taken into account."
            )
        if held := found.extrapolated:
            self.warnings.append(
                f"scans with too few points to register: {len(held)} (first: {names[held[0]]}); their "
                "poses are extrapolated."
            )
        self.figures |= found.figures
        return found.poses

    def _register(self, timing: SweepTiming) -> Registration:
        """Return every scan registered to the previous ones; repeated if scans turn out to be missing."""
        for _ in range(1 if self.clock.has_stamps else MOST_PASSES):
            found = self._register_once(timing)
            if (found.gaps == self.clock.gaps).all():
                break
            self.clock = self.clock.with_gaps(found.gaps)
        return found

    def _register_once(self, timing: SweepTiming) -> Registration:
        """Return every scan registered to the previous ones, and refined; without stamps, missing scans are counted."""
        clock, settings, steps, held = self.clock, self.settings, [], []
        is_refined = settings.refine or not clock.has_stamps  # in which missing scans are counted
        refinement = RollingRefinement(clock, timing.share, settings, self.pool)
        for i, scan in enumerate(register_scans(self.sequence, settings, timing, clock.gaps)):
            steps.append(scan.T_last_this)
            if not scan.is_registered:
                held.append(i)
            if is_refined:
                surfels = self.pool.submit(surfels_of, scan.points, scan.times, timing.has_seam)
                refinement.add(surfels, scan.twist, scan.T_last_this, clock.gaps[i - 1] if i else 1.0)
            if self.progress is not None:
                self.progress(i + 1, len(self.sequence))
        poses, gaps, figures = chain(np.eye(4), np.array(steps[1:]).reshape(-1, 4, 4)), clock.gaps, {}
        if is_refined:
            refined, consistency = refinement.finish()
            gaps = np.array(refinement.gaps[1:])
            if settings.refine:
                poses, figures = refined, {**summarize(consistency), **speed_figures(refinement.searches)}
        return Registration(poses, gaps, held, figures)


def doubts(figures: dict[str, Any], settings: OdometrySettings, has_clock: bool = True) -> list[str]:
    """Return the warnings, in sentences, that follow from the `figures` of a run."""
    found = []
    if figures.get("is_speed_doubted", False):
        faster, here, there = (figures[k] for k in ("rival_faster_m_s", "landmarks_refound", "refound_at_rival"))
        found.append(
            "the speed is in doubt: of the landmarks that cannot be traffic (higher than any vehicle, far beside the "
            f"road), {here:.0f} are re-observed at the estimated speed, {there:.0f} if the sensor is {abs(faster):.0f} "
            f"m/s {'faster' if faster > 0.0 else 'slower'}. The poses may follow traffic rather than the world; do not "
            "trust the labels: give your own poses (--poses)."
        )
    acceleration = figures.get("greatest_acceleration_m_s2", 0.0)
    if acceleration > MAX_ACCELERATION * (1.0 if has_clock else WITHOUT_CLOCK):
        found.append(
            f"around scan {figures['greatest_acceleration_at']} the speed changes by {acceleration:.0f} m/s per "
            "second, more than any vehicle can. The poses before or after it are wrong and may follow traffic rather "
            "than the world; do not trust the labels there: give your own poses (--poses)."
        )
    thickness, disagreement = figures["wall_thickness_m"], figures["baseline_disagreement_m"]
    if thickness is not None and (thickness > settings.max_wall_thickness or disagreement > settings.max_disagreement):
        found.append(
            f"scans a second apart do not align with each other: walls are {100 * thickness:.0f} cm thick and poses "
            f"disagree by {100 * disagreement:.0f} cm. Poses or point times are inaccurate, so labels will be, too."
        )
    return found
