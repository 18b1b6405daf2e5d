"""The steps of the odometry: sweep timing, poses, refinement, ground (paper III-A)."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from automos.core.arrays import some_of
from automos.core.blas import one_blas_thread
from automos.core.errors import InputError
from automos.core.geometry import Array, checked_poses, inverse
from automos.core.parallel import available_cores
from automos.core.scan import Pose, Scan, Sequence
from automos.core.views import distinct_scans
from automos.odometry.beam_offset import find_elevation, longest_path
from automos.odometry.clock import Clock, read_clock
from automos.odometry.doubts import doubts, vertical_doubts
from automos.odometry.elevation import Raised
from automos.odometry.estimator import Moved, Odometry
from automos.odometry.links import Consistency, measure_consistency, summarize
from automos.odometry.motion import MIN_POINTS, greatest_acceleration, step_twists
from automos.odometry.moving_windows import WINDOW_SCANS
from automos.odometry.speed import speed_figures
from automos.odometry.surfels import scan_surfels
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.timing import choose_timing
from automos.odometry.trajectory import Trajectory
from automos.odometry.vertical import Level, level_frame
from automos.odometry.window import Window
from automos.settings import OdometrySettings

Progress = Callable[[int, int], None]


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
    if len(sequence) == 0:
        raise InputError(f"{sequence.name} holds no scans; give a folder with at least one scan.")
    is_repeat = sequence.repeats
    if poses is None and is_repeat is not None and is_repeat[1:].any() and not is_repeat[0]:
        distinct = estimate_trajectory(distinct_scans(sequence, is_repeat), settings, None, progress, workers, rate)
        return distinct.with_repeats(is_repeat)
    with ThreadPoolExecutor(workers or available_cores()) as pool, one_blas_thread():
        estimate = _Estimate(sequence, settings, read_clock(sequence, rate), pool, progress)
        # Steps 1 to 4 of docs/odometry.md: timing of the points, initial poses, speed, refinement.
        if poses is None:
            poses, timing, elevation = estimate.from_scans()
        else:
            poses = checked_poses(poses, len(sequence))
            timing, elevation = estimate.at_given(poses)
        estimate.sequence = Raised(sequence, elevation) if elevation else sequence
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
    ids = some_of(len(sequence), WINDOW_SCANS).tolist()
    surfels = {i: scan_surfels(sequence[i], motion[i], timing, settings) for i in ids}
    used = [i for i in ids if len(surfels[i]) >= MIN_POINTS]
    return level_frame([(surfels[i].mean, surfels[i].covariance) for i in used], poses[used], settings)


@dataclass
class PosesSoFar:
    """The poses of a recording while it is followed."""

    poses: dict[float, Pose] = field(default_factory=dict)  # (4, 4) T_world_sensor by stamp
    _again: dict[float, Pose] = field(default_factory=dict)

    def add(self, moved: Moved) -> None:
        """Take what is known after one more scan."""
        self._again |= {timed.stamp: posed.T_world_sensor for timed, posed in moved.again}
        if moved.T_before_now is not None:
            T = inverse(moved.T_before_now)
            self.poses = {stamp: self._again.get(stamp, T @ pose) for stamp, pose in self.poses.items()}
            self._again = {}
        self.poses |= moved.refined


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

    def at_given(self, poses: Pose) -> tuple[SweepTiming, float]:
        """Return the timing of sweeps and the elevation of the beams at given (N, 4, 4) `poses`."""
        sequence, settings, clock = self.sequence, self.settings, self.clock
        choice = choose_timing(sequence, settings, poses, clock, self.pool)
        part, share, elevation = longest_path(poses[:, :3, 3]), choice.timing.share, 0.0
        if len(poses) > 2 and sequence[0].n_sensors == 1:  # several LiDARs need not have the same
            twists, gaps = share * step_twists(poses, clock.gaps)[part], clock.gaps[part.start : part.stop - 1]
            make = partial(scan_surfels, timing=choice.timing, settings=settings)
            surfels = list(self.pool.map(lambda i, twist: make(sequence[i], twist), range(len(poses))[part], twists))
            elevation = find_elevation(Window(surfels, twists, poses[part], gaps, clock.period, share), self.pool)
        self.figures |= {"timing": choice.to_dict(), "beams_raised_deg": round(float(np.degrees(elevation)), 3)}
        return choice.timing, elevation

    def from_scans(self) -> tuple[Pose, SweepTiming, float]:
        """Return (N, 4, 4) poses, the timing and the elevation of the beams, from the scans alone."""
        sequence, settings, clock, n = self.sequence, self.settings, self.clock, len(self.sequence)
        named = settings.time in ("file", "order")
        known = choose_timing(sequence, settings, np.tile(np.eye(4), (n, 1, 1)), clock).timing if named else None
        odometry = Odometry(settings, self.pool, known, sequence.is_compensated, np.inf, clock.has_stamps)
        so_far = PosesSoFar()
        for i, stamp in enumerate(clock.stamps.tolist()):
            read = partial(_stamped, sequence, i, stamp)
            so_far.add(odometry.push(read(), read))
            if self.progress is not None:
                self.progress(i + 1, n)
        so_far.add(odometry.finish())
        path = odometry.path
        if odometry.timing_found is not None:
            self.figures["timing"] = odometry.timing_found.to_dict()
        names = dict(zip(clock.stamps.tolist(), sequence.names, strict=True))
        if missing := path.missing:
            self.clock = clock.with_gaps(np.array([missing.get(stamp, 1.0) for stamp in list(names)[1:]]))
            self.warnings.append(
                f"scans seem to be missing at {len(missing)} places (first: before {names[min(missing)]}); "
                "without stamps, their number was estimated from the motion and taken into account."
            )
        if held := path.empty:
            self.warnings.append(
                f"scans with too few points to register: {len(held)} (first: {names[held[0]]}); their "
                "poses are extrapolated."
            )
        if path.searches:
            self.figures |= {**summarize(Consistency.concatenate(path.consistency)), **speed_figures(path.searches)}
        self.figures["beams_raised_deg"] = round(float(np.degrees(path.elevation)), 3)
        return np.array(list(so_far.poses.values())), path.timing, path.elevation

    def check(self, poses: Pose, timing: SweepTiming) -> None:
        """Measure how well scans align with (N, 4, 4) `poses`, and add the warnings that follow."""
        sequence, settings, clock, figures = self.sequence, self.settings, self.clock, self.figures
        if "wall_thickness_m" not in figures:
            figures.update(summarize(measure_consistency(sequence, poses, timing, clock.gaps, clock.period, settings)))
        acceleration, at = greatest_acceleration(poses, clock.stamps)
        figures |= {"greatest_acceleration_m_s2": acceleration, "greatest_acceleration_at": sequence.names[at]}
        self.warnings += doubts(figures, settings, clock.has_stamps)


def _stamped(sequence: Sequence, i: int, stamp: float) -> Scan:
    return replace(sequence[i], stamp=stamp)
