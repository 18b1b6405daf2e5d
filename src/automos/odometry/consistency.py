"""How far to trust poses, from the scans alone: how thick walls become when seen from places a second apart."""

from __future__ import annotations

import numpy as np

from automos.odometry.clock import Clock
from automos.odometry.links import Alignment, Consistency, choose_links, fit_links
from automos.odometry.motion import SweepTiming, step_twists
from automos.odometry.speed import MIN_STEP
from automos.odometry.stretch import Stretch
from automos.odometry.sweeps import surfels_of, usable_points
from automos.scan import Pose, Sequence
from automos.settings import OdometrySettings

SAMPLES = 3
"""Places of a recording where its poses are tried."""
SAMPLE_SECONDS = 2.5
"""Length of each."""


def measure_consistency(
    sequence: Sequence, poses: Pose, timing: SweepTiming, clock: Clock, settings: OdometrySettings
) -> Consistency:
    """Return how well scans lie on each other with `poses` (N, 4, 4), at a few places of the recording."""
    length = min(max(round(SAMPLE_SECONDS / clock.period), 3), len(sequence))
    firsts = np.unique(np.linspace(0, len(sequence) - length, SAMPLES).round().astype(int))
    twists = timing.share * step_twists(poses, clock.gaps)
    parts = []
    for first in firsts:
        ids = range(first, first + length)
        surfels = [surfels_of(*usable_points(sequence[i], timing, twists[i], settings)) for i in ids]
        inner = slice(first, first + length)
        gaps = clock.gaps[first : first + length - 1]
        stretch = Stretch(surfels, twists[inner], poses[inner], gaps, clock.period, timing.share)
        about = Alignment()
        links = list(choose_links(stretch, about))
        parts.append(fit_links(stretch, links, about.kernels[-1], about, None)[1])
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
