"""The steps of the odometry: sweep timing, poses, refinement, ground (paper III-A)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from automos.core.errors import InputError
from automos.core.geometry import Array, checked_poses, inverse
from automos.core.parallel import available_cores
from automos.core.scan import Pose, Sequence
from automos.core.views import distinct_scans
from automos.odometry.beam_offset import find_elevation, longest_path
from automos.odometry.clock import Clock, read_clock
from automos.odometry.doubts import doubts, vertical_doubts
from automos.odometry.elevation import Raised
from automos.odometry.kiss import register_scans
from automos.odometry.links import Window, measure_consistency, summarize
from automos.odometry.motion import chain, greatest_acceleration, step_twists
from automos.odometry.refine import RollingRefinement
from automos.odometry.speed import speed_figures
from automos.odometry.surfels import Surfels, scan_surfels, surfels_of
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.timing import TimingChoice, choose_timing
from automos.odometry.trajectory import Trajectory
from automos.odometry.vertical import MIN_SURFELS, Level, level_frame
from automos.settings import OdometrySettings

GROUND_SCANS = 20  # scans of a recording in which the ground is searched
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
    rate: float | None = None,
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
    rate : float, optional, scans a second of a recording without stamps.

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
        distinct = estimate_trajectory(distinct_scans(sequence, is_repeat), settings, None, progress, workers, rate)
        return distinct.with_repeats(is_repeat)
    # The pool's threads share the work; BLAS threads would only spin on the same cores for small matrices.
    with ThreadPoolExecutor(workers or available_cores()) as pool, threadpool_limits(1, "blas"):
        estimate = _Estimate(sequence, settings, read_clock(sequence, rate), pool, progress)
        # Steps 1 to 4 of docs/odometry.md: timing of the points, initial poses, speed, refinement.
        is_given = poses is not None
        if poses is None:
            poses, timing = estimate.from_scans()
        else:
            poses = checked_poses(poses, len(sequence))
            timing = estimate.timing_at(poses).timing
        elevation = estimate.raise_beams(poses, timing)
        if elevation and settings.refine and not is_given:
            poses = estimate.refined_again(poses, timing)
        motion = timing.share * step_twists(poses, estimate.clock.gaps)
        estimate.check(poses, timing)  # step 5
        level = _find_level(estimate.sequence, poses, timing, motion, settings)  # step 6
    estimate.warnings += vertical_doubts(level)
    diagnostics = {"warnings": estimate.warnings, **estimate.figures}
    return Trajectory(poses, estimate.clock.stamps, motion, timing, level.T_level_world, diagnostics, elevation)


def _find_level(
    sequence: Sequence, poses: Pose, timing: SweepTiming, motion: Array, settings: OdometrySettings
) -> Level:
    """Return the level frame, from a few scans of the recording."""
    ids = np.unique(np.linspace(0, len(sequence) - 1, GROUND_SCANS).round().astype(int)).tolist()
    surfels = {i: scan_surfels(sequence[i], motion[i], timing, settings) for i in ids}
    used = [i for i in ids if len(surfels[i]) >= MIN_SURFELS]
    return level_frame([(surfels[i].mean, surfels[i].covariance) for i in used], poses[used], settings)


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

    def raise_beams(self, poses: Pose, timing: SweepTiming) -> float:
        """Return the radians by which all beams point higher than the scans say, and raise those of `sequence`."""
        part = longest_path(poses[:, :3, 3])
        if len(poses) < 3 or self.sequence[0].n_sensors > 1:  # several LiDARs need not have the same
            return 0.0
        gaps = self.clock.gaps[part.start : part.stop - 1]
        twists = timing.share * step_twists(poses, self.clock.gaps)[part]
        surfels = list(self.pool.map(lambda i, twist: self._surfels(i, twist, timing), range(len(poses))[part], twists))
        angle = find_elevation(Window(surfels, twists, poses[part], gaps, self.clock.period, timing.share), self.pool)
        if angle:
            self.sequence = Raised(self.sequence, angle)
        self.figures["beams_raised_deg"] = round(float(np.degrees(angle)), 3)
        return angle

    def refined_again(self, poses: Pose, timing: SweepTiming) -> Pose:
        """Return (N, 4, 4) poses refined once more, of the same steps between other points."""
        twists, steps = timing.share * step_twists(poses, self.clock.gaps), inverse(poses[:-1]) @ poses[1:]
        refinement = RollingRefinement(self.clock, timing.share, self.settings, self.pool)
        for i, twist in enumerate(twists):
            surfels = self.pool.submit(self._surfels, i, twist, timing)
            step, gap = (steps[i - 1], self.clock.gaps[i - 1]) if i else (np.eye(4), 1.0)
            refinement.add(surfels, twist, step, gap)
        refined, consistency = refinement.finish()
        self.figures |= {**summarize(consistency), **speed_figures(refinement.searches)}
        return refined

    def _surfels(self, i: int, twist: Array, timing: SweepTiming) -> Surfels:
        return scan_surfels(self.sequence[i], twist, timing, self.settings)

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
