"""The odometry, step by step: sweep timing, poses, refinement, ground (paper III-A)."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from automos.errors import InputError
from automos.geometry import inverse
from automos.odometry.clock import Clock, find_missing, read_clock
from automos.odometry.consistency import measure_consistency, summarize
from automos.odometry.distinct import DistinctScans, with_repeats
from automos.odometry.kiss import Registered
from automos.odometry.leaps import find_leaps, mend_leaps, replay
from automos.odometry.level import level_frame
from automos.odometry.loops import close_loops
from automos.odometry.motion import SweepTiming, step_twists
from automos.odometry.register import register_scans
from automos.odometry.speed import chain, rival_speed
from automos.odometry.sweeps import MIN_POINTS, surfels_of, usable_points
from automos.odometry.timing import choose_timing
from automos.odometry.trajectory import Trajectory
from automos.odometry.windows import RollingRefinement
from automos.scan import Points, Pose, Sequence
from automos.settings import OdometrySettings

_log = logging.getLogger(__name__)

Progress = Callable[[int, int], None]

GROUND_SCANS = 20
"""Scans in which the ground is looked for."""
CLEARLY_MORE = 5.0
"""Surfels overhead by which another speed must explain more to put the present one in doubt."""


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
    sequence : at least one scan.
    settings : the odometry's.
    poses : (N, 4, 4) T_world_sensor known to the user; then nothing is registered, and only the motion during each
        sweep and the ground are found.
    progress : called with the number of scans done and their total.
    workers : threads, 0: one per core; the result does not depend on their number.

    Raises
    ------
    InputError
        When the sequence is empty, or the poses are not one rigid transform per scan.
    """
    from threadpoolctl import threadpool_limits

    if len(sequence) == 0:
        raise InputError(f"{sequence.name} holds no scans; give a folder with at least one.")
    is_repeat = sequence.repeats
    if poses is None and is_repeat is not None and is_repeat[1:].any() and not is_repeat[0]:
        distinct = estimate_trajectory(DistinctScans(sequence, is_repeat), settings, None, progress, workers)
        return with_repeats(distinct, is_repeat)
    clock = read_clock(sequence)
    if poses is not None:
        poses = _checked_poses(poses, len(sequence))
    diagnostics: dict[str, Any] = {"warnings": []}
    # Our own threads share the work; BLAS's would wait for its small matrices by spinning on the same cores.
    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool, threadpool_limits(1, "blas"):
        choice = choose_timing(sequence, settings, poses, clock, pool)
        if poses is None:
            poses, clock = _register(sequence, settings, choice.timing, clock, pool, progress, diagnostics)
            if choice.timing.source == "none" and diagnostics.get("lengthened_m", 0.0) > 0.0:
                # Where a registration stands with the traffic, nothing bends: timing can be chosen only now.
                better = choose_timing(sequence, settings, poses, clock, pool)
                if better.timing != choice.timing:
                    choice, diagnostics["warnings"] = better, []
                    poses, clock = _register(sequence, settings, choice.timing, clock, pool, progress, diagnostics)
    timing = choice.timing
    diagnostics["timing"] = choice.to_dict()
    if "wall_thickness_m" not in diagnostics:
        links = measure_consistency(sequence, poses, timing, clock, settings)
        diagnostics.update(summarize(links))
    _judge(diagnostics, settings)
    T_level_world = _find_level(sequence, poses, timing, clock, settings, diagnostics)
    if settings.loop_closure:
        poses = close_loops(sequence, poses, T_level_world, timing, clock, settings, diagnostics)
    for warning in diagnostics["warnings"]:
        _log.warning("%s: %s", sequence.name, warning)
    motion = timing.share * step_twists(poses, clock.gaps)
    return Trajectory(poses, clock.stamps, motion, timing, T_level_world, diagnostics)


def _register(
    sequence: Sequence,
    settings: OdometrySettings,
    timing: SweepTiming,
    clock: Clock,
    pool: ThreadPoolExecutor,
    progress: Progress | None,
    diagnostics: dict[str, Any],
) -> tuple[Pose, Clock]:
    """Return the (N, 4, 4) poses from the scans alone, and the clock with the scans that are missing.

    Figures and warnings go to `diagnostics`.
    """
    held: list[str] = []

    def fold(scans: Iterable[Registered]) -> tuple[Pose, RollingRefinement]:
        steps = []
        refinement = RollingRefinement(clock.period, timing.share, settings, pool)
        for i, scan in enumerate(scans):
            steps.append(scan.T_last_this)
            if not scan.is_registered:
                held.append(sequence.names[i])
            if settings.refine:
                surfels = pool.submit(surfels_of, scan.points, scan.times)
                refinement.add(surfels, scan.twist, scan.T_last_this, clock.gaps[i - 1] if i else 1.0)
            if progress is not None:
                progress(i + 1, len(sequence))
        return np.array(steps[1:]).reshape(-1, 4, 4), refinement

    steps, refinement = fold(register_scans(sequence, settings, timing, clock.gaps))
    gaps = clock.gaps if clock.has_stamps else find_missing(steps, clock.gaps, clock.period)
    if len(missing := np.flatnonzero(gaps != clock.gaps)):
        diagnostics["warnings"].append(
            f"scans seem to be missing at {len(missing)} places (first: before {sequence.names[missing[0] + 1]}), "
            "and no stamps tell how many; the motion does, and the poses were made anew with it."
        )
        clock = clock.with_gaps(gaps)
        held.clear()
        steps, refinement = fold(register_scans(sequence, settings, timing, clock.gaps))
    if held:
        diagnostics["warnings"].append(
            f"{len(held)} scans have too few points to register (first: {held[0]}); their poses are extrapolated."
        )
    if not settings.refine:
        return chain(np.eye(4), steps), clock
    mended = mend_leaps(sequence, steps, timing, clock, settings)
    if mended is not steps:
        _, refinement = fold(replay(sequence, mended, timing, clock, settings))
    poses, before, after = refinement.finish()
    if leaps := find_leaps(inverse(poses[:-1]) @ poses[1:], clock):
        diagnostics["warnings"].append(
            f"the speed leaps at {len(leaps)} scans (first: {sequence.names[leaps[0]]}) as no vehicle's does: before "
            "that the poses may follow traffic rather than the world, and labels are not to be trusted."
        )
    diagnostics.update(summarize(after))
    diagnostics["before_refinement"] = summarize(before)
    diagnostics["lengthened_m"] = refinement.lengthened
    diagnostics["refound_overhead"], diagnostics["refound_at_rival"], faster = rival_speed(refinement.refound)
    if diagnostics["refound_at_rival"] > diagnostics["refound_overhead"] + CLEARLY_MORE:
        diagnostics["warnings"].append(
            "the speed is in doubt: what is higher than any vehicle is found again if the sensor is "
            f"{abs(faster):.0f} m/s {'faster' if faster > 0.0 else 'slower'} than found. The poses may follow traffic "
            "rather than the world, and labels are not to be trusted: give your own poses (--poses)."
        )
    return poses, clock


def _judge(diagnostics: dict[str, Any], settings: OdometrySettings) -> None:
    """Add a warning where the scans do not lie on each other."""
    thickness, disagreement = diagnostics["wall_thickness_m"], diagnostics["baseline_disagreement_m"]
    if thickness is None:
        return
    if thickness > settings.max_wall_thickness or disagreement > settings.max_disagreement:
        diagnostics["warnings"].append(
            f"scans a second apart do not fold onto each other: walls are {100 * thickness:.0f} cm thick and poses off "
            f"by {100 * disagreement:.0f} cm. The poses or the points' times are poor, and labels will be, too."
        )


def _checked_poses(poses: Pose, n: int) -> Pose:
    poses = np.asarray(poses, np.float64)
    if poses.shape != (n, 4, 4):
        raise InputError(f"poses must be ({n}, 4, 4), one per scan, got shape {poses.shape}; give one pose per scan.")
    R = poses[:, :3, :3]
    error = np.abs(R @ np.swapaxes(R, 1, 2) - np.eye(3)).max(axis=(1, 2))
    is_rigid = (error < 1e-2) & (np.linalg.det(R) > 0) & np.isfinite(poses).all(axis=(1, 2))
    if not is_rigid.all():
        row = int(np.argmin(is_rigid))
        raise InputError(
            f"pose {row} is no rigid transform (rotation times its transpose is off by {error[row]:.3g}); check "
            "the pose file's format."
        )
    u, _, vt = np.linalg.svd(R)  # files round
    poses = poses.copy()
    poses[:, :3, :3] = u @ vt
    return inverse(poses[0]) @ poses


def _find_level(
    sequence: Sequence,
    poses: Pose,
    timing: SweepTiming,
    clock: Clock,
    settings: OdometrySettings,
    diagnostics: dict[str, Any],
) -> Pose:
    twists = timing.share * step_twists(poses, clock.gaps)
    clouds: list[Points] = []
    used: list[int] = []
    for i in np.unique(np.linspace(0, len(sequence) - 1, GROUND_SCANS).round().astype(int)):
        points, _ = usable_points(sequence[int(i)], timing, twists[i], settings)
        if len(points) >= MIN_POINTS:
            clouds.append(points)
            used.append(int(i))
    T_level_world, has_ground = level_frame(clouds, poses[used], settings)
    if not has_ground:
        diagnostics["warnings"].append(
            "no ground found near the sensor; its own z axis is taken for up and its height for zero."
        )
    return T_level_world
