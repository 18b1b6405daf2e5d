"""The verdict on a track by the length of its trajectory (paper III-D, last paragraph)."""

from dataclasses import replace

import numpy as np

from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts
from automos.settings import VerdictSettings

NOW_SPEED = 0.5  # m/s, least speed of an object that moves in a scan


def with_speed_as_state(tracks: Tracks) -> Tracks:
    """Return `tracks` with probabilities of motion of 0 or 1, as the paper has none: whether the velocity is enough."""
    return replace(tracks, p_moving=(np.linalg.norm(tracks.velocity, axis=1) >= NOW_SPEED).astype(np.float64))


def judge_by_trajectory(tracks: Tracks, settings: VerdictSettings) -> Verdicts:
    """Return moving for every track whose trajectory is longer than the longest side of its box.

    The trajectory is, by setting, `net` (from the first observation to the last) or `accumulated` (the sum of all
    steps, the paper's wording, which adds up the jitter of a parked car). The longest side is that of the largest box
    of the track, so that an object whose visible part grows has not moved. A track of fewer than `min_observations`
    is static.
    The confidence is the distance of the trajectory from the threshold: 0.5 at it, 1 at twice it or at 0.
    """
    n = len(tracks)
    verdict, confidence = np.full(n, Verdict.STATIC, np.int8), np.ones(n)
    for k in range(n):
        rows = tracks.rows_of(k)
        seen = tracks.is_observed[rows]
        center = tracks.center[rows][seen]
        if settings.trajectory == "net":
            length = float(np.linalg.norm(center[-1] - center[0]))
        else:
            length = float(np.linalg.norm(np.diff(center, axis=0), axis=1).sum())
        ratio = length / float(tracks.size[rows][seen].max())
        if len(center) >= settings.min_observations and ratio > 1.0:
            verdict[k] = Verdict.MOVING
        confidence[k] = 0.5 + 0.5 * min(abs(ratio - 1.0), 1.0)
    return Verdicts(verdict, confidence)
