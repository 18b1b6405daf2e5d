"""Finding out when in the sweep each point was measured."""

from __future__ import annotations

import numpy as np

from automos.errors import InputError
from automos.odometry.clock import Clock
from automos.odometry.motion import SweepTiming
from automos.scan import Pose, Sequence
from automos.settings import OdometrySettings


def choose_timing(sequence: Sequence, settings: OdometrySettings, poses: Pose | None, clock: Clock) -> SweepTiming:
    """Return how the time of each point within its sweep is known, as `settings.time` asks."""
    if settings.time == "none" or (settings.time == "auto" and sequence.is_compensated) or len(sequence) < 2:
        return SweepTiming()
    file_timing = _file_timing(sequence)
    if settings.time in ("auto", "file") and file_timing is not None:
        return file_timing
    if settings.time == "file":
        raise InputError(f"{sequence.name} has no time per point; set odometry.time to auto, azimuth or none.")
    if settings.time == "azimuth":
        return SweepTiming("azimuth", turn=-1, seam_deg=180.0, share=1.0)
    return SweepTiming()


def _file_timing(sequence: Sequence) -> SweepTiming | None:
    """Return the timing the scans' own times give, None where they have none."""
    ids = np.unique(np.linspace(0, len(sequence) - 1, 11).round().astype(int))
    scans = [sequence[int(i)] for i in ids]
    spans = [float(np.nanmax(scan.time)) for scan in scans if scan.time is not None and len(scan)]
    if not spans or np.median(spans) <= 0.0:
        return None
    duration = float(np.median(spans))
    stamps = sequence.stamps
    gap = duration if stamps is None else float(np.median(np.diff(stamps)))
    return SweepTiming("file", duration=duration, share=duration / gap)
