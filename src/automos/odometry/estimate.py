"""The steps of the odometry: sweep timing, poses, refinement, ground (paper III-A)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from automos.errors import InputError
from automos.odometry.clock import Clock, FacingGaps, find_missing, read_clock
from automos.odometry.consistency import doubts, greatest_acceleration, measure_consistency, speed_figures, summarize
from automos.odometry.kiss import register_scans
from automos.odometry.level import find_level
from automos.odometry.motion import SweepTiming, chain, step_twists
from automos.odometry.refine import RollingRefinement
from automos.odometry.surfels import surfels_of
from automos.odometry.timing import TimingChoice, choose_timing
from automos.odometry.trajectory import DistinctScans, Trajectory, checked_poses, with_repeats
from automos.parallel import available_cores
from automos.scan import Pose, Sequence
from automos.settings import OdometrySettings

Progress = Callable[[int, int], None]


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
        distinct = estimate_trajectory(DistinctScans(sequence, is_repeat), settings, None, progress, workers)
        return with_repeats(distinct, is_repeat)
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
        T_level_world, has_ground = find_level(sequence, poses, timing, motion, settings)  # step 6
    if not has_ground:
        estimate.warnings.append(
            "no ground found near the sensor; its z axis is used as vertical and its height as zero."
        )
    diagnostics = {"warnings": estimate.warnings, **estimate.figures}
    return Trajectory(poses, estimate.clock.stamps, motion, timing, T_level_world, diagnostics)


class _Estimate:
    """Poses and timing of one recording, with `warnings` and `figures`."""

    def __init__(
        self,
        sequence: Sequence,
        settings: OdometrySettings,
        clock: Clock,
        pool: ThreadPoolExecutor,
        progress: Progress | None,
    ):
        self.clock = clock
        self.warnings: list[str] = []
        self.figures: dict[str, Any] = {}
        self._sequence, self._settings, self._pool, self._progress = sequence, settings, pool, progress

    def timing_at(self, poses: Pose | None) -> TimingChoice:
        """Return the timing under which scans align best, at given (N, 4, 4) `poses` or else at estimated ones."""
        choice = choose_timing(self._sequence, self._settings, poses, self.clock, self._pool)
        self.figures["timing"] = choice.to_dict()
        return choice

    def from_scans(self) -> tuple[Pose, SweepTiming]:
        """Return (N, 4, 4) poses and the timing, from the scans alone."""
        choice = self.timing_at(None)
        poses = self._poses_under(choice.timing)
        if self._settings.time in ("auto", "azimuth") and not choice.suits(poses):
            # The poses used for the choice followed the traffic: choose the timing again.
            better = self.timing_at(poses)
            if better.timing != choice.timing:
                self.warnings = []
                poses = self._poses_under(better.timing)
            choice = better
        return poses, choice.timing

    def check(self, poses: Pose, timing: SweepTiming) -> None:
        """Measure how well scans align with (N, 4, 4) `poses`, and add the warnings that follow."""
        sequence, settings, clock, figures = self._sequence, self._settings, self.clock, self.figures
        if "wall_thickness_m" not in figures:
            figures.update(summarize(measure_consistency(sequence, poses, timing, clock, settings)))
        acceleration, at = greatest_acceleration(poses, clock.stamps)
        figures |= {"greatest_acceleration_m_s2": acceleration, "greatest_acceleration_at": sequence.names[at]}
        self.warnings += doubts(figures, settings, clock.has_stamps)

    def _poses_under(self, timing: SweepTiming) -> Pose:
        """Return (N, 4, 4) poses under a timing; corrects the clock if scans are missing."""
        names, given = self._sequence.names, self.clock.gaps
        steps, held, refinement = self._register(timing)
        if len(missing := np.flatnonzero(self.clock.gaps != given)):
            self.warnings.append(
                f"scans seem to be missing at {len(missing)} places (first: before {names[missing[0] + 1]}); "
                "without stamps, their number was estimated from the motion and taken into account."
            )
        if held:
            self.warnings.append(
                f"scans with too few points to register: {len(held)} (first: {names[held[0]]}); their "
                "poses are extrapolated."
            )
        if not self._settings.refine:
            return chain(np.eye(4), steps)
        poses, before, after = refinement.finish()
        self.figures.update(summarize(after))
        self.figures["before_refinement"] = summarize(before)
        self.figures["lengthened_m"] = refinement.lengthened
        self.figures.update(speed_figures(refinement.searches))
        return poses

    def _register(self, timing: SweepTiming) -> _FirstPoses:
        """Return every scan registered to the previous ones; repeated if scans turn out to be missing."""
        if self.clock.has_stamps:
            return self._register_once(timing)
        at_gaps = FacingGaps(timing.share, self._settings, self._pool)
        first = self._register_once(timing, at_gaps)
        gaps = find_missing(first.steps, self.clock.gaps, self.clock.period, at_gaps.shares())
        if (gaps == self.clock.gaps).all():
            return first
        self.clock = self.clock.with_gaps(gaps)
        return self._register_once(timing)

    def _register_once(self, timing: SweepTiming, at_gaps: FacingGaps | None = None) -> _FirstPoses:
        """Return every scan registered to the previous ones; also passes each to `at_gaps`."""
        gaps, steps, held = self.clock.gaps, [], []
        refinement = RollingRefinement(self.clock.period, timing.share, self._settings, self._pool)
        for i, scan in enumerate(register_scans(self._sequence, self._settings, timing, gaps)):
            steps.append(scan.T_last_this)
            if not scan.is_registered:
                held.append(i)
            if self._settings.refine or at_gaps is not None:
                surfels, gap = self._pool.submit(surfels_of, scan.points, scan.times), gaps[i - 1] if i else 1.0
                if self._settings.refine:
                    refinement.add(surfels, scan.twist, scan.T_last_this, gap)
                if at_gaps is not None:
                    at_gaps.add(surfels, scan.T_last_this, gap)
            if self._progress is not None:
                self._progress(i + 1, len(self._sequence))
        return _FirstPoses(np.array(steps[1:]).reshape(-1, 4, 4), held, refinement)


class _FirstPoses(NamedTuple):
    """Steps (N - 1, 4, 4) between scans, the scans with extrapolated motion, and all scans for refinement."""

    steps: Pose
    held: list[int]
    refinement: RollingRefinement
