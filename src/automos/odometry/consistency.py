"""Quality of poses from the scans alone: the thickness of walls observed from positions a second apart."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from automos.odometry.clock import Clock
from automos.odometry.links import Alignment, Consistency, Window, choose_links, fit_links
from automos.odometry.motion import SweepTiming, step_twists, usable_points
from automos.odometry.speed import MIN_STEP, Landmarks, SpeedSearch
from automos.odometry.surfels import surfels_of
from automos.scan import Pose, Sequence
from automos.settings import OdometrySettings

Array = npt.NDArray[np.float64]

SAMPLES = 3
"""Parts of a recording in which poses are checked."""
SAMPLE_SECONDS = 2.5
"""Length of each part."""
AHEAD = 0.1
"""Share of the landmarks re-observed at the rival speed by which it must lead to put the current speed in doubt."""
ACCELERATION_SECONDS = 0.5
"""Interval over which accelerations are measured: within shorter ones, a handheld sensor shakes more than a vehicle."""
MAX_ACCELERATION = 8.0
"""m/s², an emergency stop. Poses that switch between following the world and the traffic exceed it."""
WITHOUT_CLOCK = 4.0
"""Factor by which accelerations may be overestimated without stamps: the slowest sensors rotate at 5 Hz."""


def measure_consistency(
    sequence: Sequence, poses: Pose, timing: SweepTiming, clock: Clock, settings: OdometrySettings
) -> Consistency:
    """Return how well scans align with `poses` (N, 4, 4), in a few parts of the recording."""
    length = min(max(round(SAMPLE_SECONDS / clock.period), 3), len(sequence))
    firsts = np.unique(np.linspace(0, len(sequence) - length, SAMPLES).round().astype(int))
    twists = timing.share * step_twists(poses, clock.gaps)
    parts, about = [], Alignment()
    for first in firsts:
        ids = range(first, first + length)
        surfels = [surfels_of(*usable_points(sequence[i], timing, twists[i], settings)) for i in ids]
        inner = slice(first, first + length)
        gaps = clock.gaps[first : first + length - 1]
        window = Window(surfels, twists[inner], poses[inner], gaps, clock.period, timing.share)
        parts.append(fit_links(window, list(choose_links(window, about)), about.kernels[-1], about, None)[1])
    return Consistency.concatenate(parts)


def summarize(links: Consistency) -> dict[str, float | None]:
    """Return the figures over baselines of about a second; None if there are no such baselines.

    wall_thickness_m : distance of surfels from surfaces observed a second before or after.
    baseline_disagreement_m : correction of a scan that a baseline of a second alone would make.
    baseline_disagreement_percent : the same relative to the distance travelled; 0 at standstill.
    """
    is_second = (links.lag > 0.6) & (links.lag < 1.5)
    if not is_second.any():
        return {"wall_thickness_m": None, "baseline_disagreement_m": None, "baseline_disagreement_percent": None}
    distance = float(np.median(links.distance[is_second]))
    disagreement = float(np.median(links.disagreement[is_second]))
    return {
        "wall_thickness_m": float(np.median(links.thickness[is_second])),
        "baseline_disagreement_m": disagreement,
        "baseline_disagreement_percent": 100.0 * disagreement / distance if distance > MIN_STEP else 0.0,
    }


def greatest_acceleration(poses: Pose, times: Array) -> tuple[float, int]:
    """Return the greatest acceleration, m/s², of (N, 4, 4) `poses` over half a second, and its middle scan.

    times : (N,) seconds.
    """
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


def speed_figures(searches: list[SpeedSearch]) -> dict[str, Any]:
    """Return the certainty of the speed: how many landmarks, which cannot be traffic, are re-observed.

    landmarks_refound, landmarks_expected : re-observed, and the least number expected from nearly the same position.
    refound_at_rival : re-observed at the rival speeds, which are `rival_faster_m_s` higher on average.
    is_speed_doubted : whether too few are re-observed, or clearly more at the rival speeds.
    """
    here = Landmarks.concatenate([search.landmarks for search in searches])
    there = Landmarks.concatenate([search.landmarks_at_rival for search in searches])
    refound, expected, at_rival = here.refound.sum(), here.expected.sum(), there.refound.sum()
    is_rival_ahead = there.explains_more_than(here) and at_rival - refound > AHEAD * at_rival
    return {
        "landmarks_refound": float(refound),
        "landmarks_expected": float(expected),
        "refound_at_rival": float(at_rival),
        "rival_faster_m_s": float(np.mean(there.speeds - here.speeds)) if len(here.speeds) else 0.0,
        "is_speed_doubted": bool(is_rival_ahead or here.are_missed),
    }


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
