"""How far to trust poses, from the scans alone: how thick walls become when seen from places a second apart."""

from __future__ import annotations

from typing import Any

import numpy as np

from automos.odometry.clock import Clock
from automos.odometry.links import Alignment, Consistency, Window, choose_links, fit_links
from automos.odometry.motion import SweepTiming, step_twists, usable_points
from automos.odometry.speed import MIN_STEP
from automos.odometry.surfels import surfels_of
from automos.scan import Pose, Sequence
from automos.settings import OdometrySettings

SAMPLES = 3
"""Places of a recording where its poses are tried."""
SAMPLE_SECONDS = 2.5
"""Length of each."""
CLEARLY_MORE = 5.0
"""Surfels overhead by which another speed must explain more to put the present one in doubt."""


def measure_consistency(
    sequence: Sequence, poses: Pose, timing: SweepTiming, clock: Clock, settings: OdometrySettings
) -> Consistency:
    """Return how well scans lie on each other with `poses` (N, 4, 4), at a few places of the recording."""
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
    """Return the figures over baselines of about a second; None where there are no such.

    wall_thickness_m : how far surfels lie off surfaces seen a second before or after.
    baseline_disagreement_m : by how much a scan would move to suit what was seen a second apart alone.
    baseline_disagreement_percent : the same over the distance driven meanwhile; 0 while standing.
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


def doubts(figures: dict[str, Any], settings: OdometrySettings) -> list[str]:
    """Return warnings, in sentences, that the `figures` of a run call for."""
    found = []
    if figures.get("refound_at_rival", 0.0) > figures.get("refound_overhead", 0.0) + CLEARLY_MORE:
        faster = figures["rival_faster_m_s"]
        found.append(
            "the speed is in doubt: what is higher than any vehicle is found again if the sensor is "
            f"{abs(faster):.0f} m/s {'faster' if faster > 0.0 else 'slower'} than found. The poses may follow traffic "
            "rather than the world, and labels are not to be trusted: give your own poses (--poses)."
        )
    thickness, disagreement = figures["wall_thickness_m"], figures["baseline_disagreement_m"]
    if thickness is not None and (thickness > settings.max_wall_thickness or disagreement > settings.max_disagreement):
        found.append(
            f"scans a second apart do not align with each other: walls are {100 * thickness:.0f} cm thick and poses "
            f"off by {100 * disagreement:.0f} cm. The poses or the points' times are poor, and labels will be, too."
        )
    return found
