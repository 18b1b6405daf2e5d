"""Finding out when in the sweep each point was measured, where the recording does not say.

Wrongly timed sweeps are bent, and bent sweeps do not fold onto each other once the sensor has come some way: walls
half a second to two apart are then thicker than they need be, or not met at all. So each way to time the points is
tried at a few places at which the sensor moves, and the one that makes walls thinnest and best met is taken.
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from automos.errors import InputError
from automos.geometry import inverse, se3_log
from automos.odometry.clock import Clock
from automos.odometry.motion import SweepTiming, azimuth_times, compensate, step_twists
from automos.odometry.refine import refine_poses
from automos.odometry.register import register_scans
from automos.odometry.speed import chain, lengthen, missing_distance
from automos.odometry.stretch import Stretch
from automos.odometry.surfels import Surfels
from automos.odometry.sweeps import surfels_of, usable_points
from automos.scan import ArraySequence, Pose, Scan, Sequence
from automos.settings import OdometrySettings

_log = logging.getLogger(__name__)

Doubt = Callable[[SweepTiming], float]

SEAMS_DEG = (180.0, 0.0, 90.0, -90.0)
"""Azimuths at which sweeps are tried to start."""
NEAR = 15.0
"""Metres, distance of typical walls: how much turning bends a sweep compared with driving."""


def choose_timing(
    sequence: Sequence,
    settings: OdometrySettings,
    poses: Pose | None,
    clock: Clock,
    pool: ThreadPoolExecutor | None = None,
) -> SweepTiming:
    """Return how the time of each point within its sweep is known, as `settings.time` asks.

    Raises
    ------
    InputError
        When the file's times are asked for and there are none.
    """
    wanted = settings.time
    if wanted == "none" or (wanted == "auto" and sequence.is_compensated):
        return SweepTiming()
    from_file = _file_timing(sequence, clock)
    if wanted == "file":
        if from_file is None:
            raise InputError(f"{sequence.name} has no time per point; set odometry.time to auto, azimuth or none.")
        return from_file
    is_raw = sequence.is_compensated is False
    untimed = [] if is_raw or wanted == "azimuth" else [SweepTiming()]
    if wanted == "auto" and from_file is not None:
        # Some keep the times although the points are compensated, and a recording may have been turned round.
        guesses = [from_file, *untimed, replace(from_file, share=-from_file.share)]
        doubt = _doubt_of(_moving_stretches(sequence, settings, poses, clock, pool), settings)
        return _best_folding(guesses, doubt, settings.timing_gain, pool)
    if wanted == "auto" and not _sees_all_round(sequence):
        return SweepTiming()
    doubt = _doubt_of(_moving_stretches(sequence, settings, poses, clock, pool), settings)
    circle = [SweepTiming("azimuth", turn=turn, seam_deg=seam, share=1.0) for seam in SEAMS_DEG for turn in (-1, 1)]
    rough = _best_folding(circle, doubt, 0.0, pool)
    finer = [replace(rough, seam_deg=(rough.seam_deg + turn + 180.0) % 360.0 - 180.0) for turn in (-45.0, 45.0)]
    found = _best_folding([*untimed, rough, *finer], doubt, settings.timing_gain, pool)
    halved = replace(rough, share=0.5)  # every second scan was left out
    return _best_folding([found, halved], doubt, settings.timing_gain, pool)


def _file_timing(sequence: Sequence, clock: Clock) -> SweepTiming | None:
    """Return the timing the scans' own times give, None where they have none."""
    ids = np.unique(np.linspace(0, len(sequence) - 1, 11).round().astype(int))
    scans = [sequence[int(i)] for i in ids]
    spans = [float(np.nanmax(scan.time)) for scan in scans if scan.time is not None and scan.is_valid.any()]
    if not spans or np.median(spans) <= 0.0:
        return None
    duration = float(np.median(spans))
    period = duration if sequence.stamps is None or len(sequence) < 2 else clock.period
    return SweepTiming("file", duration=duration, share=duration / period)


def _sees_all_round(sequence: Sequence) -> bool:
    """Return whether a scan has points in nearly all directions, as a sensor that spins about its z axis has."""
    scan = sequence[len(sequence) // 2]
    x, y = scan.points[scan.is_valid, 0], scan.points[scan.is_valid, 1]
    return len(np.unique(np.floor(np.arctan2(y, x) * (18.0 / np.pi)))) >= 30


def _moving_stretches(
    sequence: Sequence, settings: OdometrySettings, poses: Pose | None, clock: Clock, pool: ThreadPoolExecutor | None
) -> list[Stretch]:
    """Return stretches of the recording in which the sensor moves, as surfels of the points as they came."""
    length = min(settings.timing_scans, len(sequence))
    if length < settings.timing_scans // 2:
        return []
    starts = list(dict.fromkeys(round(f * (len(sequence) - length)) for f in (0.5, 0.2, 0.8, 0.35, 0.65, 0.0, 1.0)))
    file_timing = _file_timing(sequence, clock) or SweepTiming()

    def look(start: int) -> Stretch | None:
        # Speeds are tried at one place only: where nothing moves, that would be done at all of them.
        trying = settings if start == starts[0] else settings.model_copy(update={"start_steps": ()})
        ids = range(start, start + length)
        part = None if poses is None else poses[start : start + length]
        return _moving_stretch(
            [sequence[i] for i in ids], part, clock.gaps[start : start + length - 1], file_timing, clock, trying
        )

    found: list[Stretch] = []
    at = 0
    while len(found) < settings.timing_stretches and at < len(starts):
        wanted = starts[at : at + settings.timing_stretches - len(found)]
        looks = map(look, wanted) if pool is None else pool.map(look, wanted)
        found += [stretch for stretch in looks if stretch is not None]
        at += len(wanted)
    return found


def _moving_stretch(
    scans: list[Scan],
    poses: Pose | None,
    gaps: npt.NDArray[np.float64],
    timing: SweepTiming,
    clock: Clock,
    settings: OdometrySettings,
) -> Stretch | None:
    """Return consecutive `scans` with poses that fold them, None where the sensor hardly moves."""
    T = poses
    if T is None:
        steps = [scan.T_last_this for scan in register_scans(ArraySequence(scans), settings, SweepTiming(), gaps)]
        T = chain(np.eye(4), np.array(steps[1:]))
    twists = se3_log(inverse(T[:-1]) @ T[1:])
    bend = np.linalg.norm(twists[:, :3], axis=1) + NEAR * np.linalg.norm(twists[:, 3:], axis=1)
    if bend.mean() < settings.timing_motion:
        return None
    raw = [usable_points(scan, timing, np.zeros(6), settings) for scan in scans]
    surfels = [surfels_of(*part, settings.timing_refinement) for part in raw]
    stretch = Stretch(surfels, np.zeros((len(scans), 6)), T, gaps, clock.period, 0.0)
    if poses is None:
        stretch = stretch.moved(lengthen(T, missing_distance(stretch, settings.refinement)))
    return refine_poses(stretch, np.zeros(len(scans), bool), settings.refinement)[0]


def _doubt_of(stretches: list[Stretch], settings: OdometrySettings) -> Doubt:
    """Return how badly the stretches fold under a guess, as a function that asks them once for each."""

    @functools.cache
    def doubt(guess: SweepTiming) -> float:
        return float(np.mean([_misfit(stretch, guess, settings) for stretch in stretches])) if stretches else 0.0

    return doubt


def _best_folding(
    guesses: list[SweepTiming], doubt: Doubt, gain: float, pool: ThreadPoolExecutor | None
) -> SweepTiming:
    """Return the guess under which scans fold best; the first one unless another is better by the share `gain`."""
    scores = np.array(list(map(doubt, guesses) if pool is None else pool.map(doubt, guesses)))
    scores[0] += np.log1p(-gain)
    best = guesses[int(np.argmin(scores))]
    _log.info("sweep timing %s of %s", best, dict(zip(map(str, guesses), np.exp(scores).round(4), strict=True)))
    return best


def _misfit(stretch: Stretch, guess: SweepTiming, settings: OdometrySettings) -> float:
    """Return how badly the stretch folds once the poses suit the guess."""
    twists = guess.share * step_twists(stretch.T_world_sensor, stretch.gaps)
    surfels = [_timed(s, guess, twist) for s, twist in zip(stretch.surfels, twists, strict=True)]
    timed = Stretch(surfels, twists, stretch.T_world_sensor, stretch.gaps, stretch.period, guess.share)
    return refine_poses(timed, np.zeros(len(timed), bool), settings.timing_refinement)[2].misfit or 0.0


def _timed(raw: Surfels, guess: SweepTiming, twist: npt.NDArray[np.float64]) -> Surfels:
    """Return surfels of the points as they came with times as guessed, compensated for `twist` (6,)."""
    if guess.source == "none":
        return raw
    times = raw.time if guess.source == "file" else azimuth_times(raw.mean, guess.turn, guess.seam_deg)
    return Surfels(compensate(raw.mean, times, twist), raw.covariance, raw.count, times)
