"""Missing scans of a recording without stamps, counted from the motion.

A missing scan shows as a step of twice the length among even ones. But registrations start with the previous motion,
and in traffic that keeps pace they stay there. Surfaces facing along the path do not move with the traffic: they are
re-observed at a step of one, two or more gaps. Both cues are combined, since in open terrain no surface faces along the
path, but registrations are right there. The speed is searched first: where registrations follow the traffic, no step of
theirs stands out.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from automos.core.geometry import Array, inverse
from automos.core.scan import Pose
from automos.odometry.facing import BESIDE, EVIDENCE, facing_surfaces, score_distances, weighed_down
from automos.odometry.isolated import count_met_again, isolated_points
from automos.odometry.likely_speed import to_likely_speed
from automos.odometry.motion import MIN_STEP
from automos.odometry.speed import direction_of, lengthen
from automos.odometry.submap import CLOSE, NOISE
from automos.odometry.window import ROUNDS, Window
from automos.settings import OdometrySettings

N_AROUND = 3  # steps on either side that define the usual speed
TRIED = np.arange(1.0, 7.0)  # hypotheses on the gaps of a step: up to five consecutive missing scans are detected
LAGS = 2  # steps over which surfaces are re-observed, at most: over more, errors of several steps add up
SELDOM = 8.0  # prior log-odds that no scan is missing at a place, and one more for each further missing scan
REFOUND = 30.0
"""Log-odds if over one of three pairs of scans, all that faces along the path is re-observed; and the greatest that a
registration contributes: it may follow traffic."""


def count_missing(window: Window, settings: OdometrySettings, pool: ThreadPoolExecutor | None = None) -> Array:
    """Return (N - 1,) the likely gaps between the scans, at the likely speed."""
    given = window.gaps
    for _ in range(ROUNDS):
        window = to_likely_speed(window, settings, pool)
        refound = refound_after(window, settings.overhead, pool)
        before = window.gaps
        gaps = find_missing(window.steps, given, window.period, settings.usual_acceleration, refound)
        if (gaps == before).all():
            break
        window = with_gaps(window, gaps)
    return gaps


def with_gaps(window: Window, gaps: Array) -> Window:
    """Return the scans with other `gaps` (N - 1,), and where these differ, with steps as long as others by the gap."""
    travelled = window.steps[:, :3, 3]
    missing = _usual(travelled / gaps[:, None]) * gaps[:, None] - travelled
    T = lengthen(window.T_world_sensor, np.where((gaps != window.gaps)[:, None], missing, 0.0))
    return replace(window, gaps=gaps).moved(T)


def find_missing(
    steps: Pose, gaps: Array, period: float, usual_acceleration: float, refound: Array | None = None
) -> Array:
    """Return (N - 1,) the gaps under which the speed changes least and most surfaces are re-observed.

    The less the scans before and after agree on the speed, the less a step's length counts.

    Parameters
    ----------
    steps : (N - 1, 4, 4) float64, from each scan to the previous one, as registered or at a likely speed.
    gaps : (N - 1,) float64, kept unless another hypothesis is clearly more likely.
    period : float, seconds between scans.
    usual_acceleration : float, m/s², usual change of the speed from scan to scan.
    refound : (N - 1, 6) float64, optional, re-observed share of surfaces facing along the path, for steps of 1-6 gaps.

    Equation: missing
    """
    travelled, found = steps[:, :3, 3], gaps
    rarity = SELDOM + (TRIED - 1.0)
    certain = np.hypot(NOISE, usual_acceleration * (period * TRIED) ** 2)
    for _ in range(2):  # neighbouring steps may have gaps, too
        medians = np.median(_windows(travelled / found[:, None], N_AROUND), axis=-1)  # NaN of fewer
        before, after = medians[: len(gaps)], medians[N_AROUND + 1 :]
        before, after = np.where(np.isnan(before), after, before), np.where(np.isnan(after), before, after)
        usual = 0.5 * (before + after)
        apart = np.linalg.norm(after - before, axis=1)[:, None]
        deviation = np.hypot(certain, 0.5 * TRIED * apart)  # either side may be right
        off = np.linalg.norm(travelled[:, None] - TRIED[:, None] * usual[:, None], axis=2) / deviation
        cost = np.minimum(0.5 * off**2, 0.5 * REFOUND) + np.log(deviation) + rarity * (gaps[:, None] != TRIED)
        if refound is not None:
            cost -= REFOUND * refound
        is_long = np.linalg.norm(usual, axis=1) >= MIN_STEP  # else double steps are hardly longer
        found = np.where(is_long, TRIED[np.argmin(cost, axis=1)], gaps)
    return found


def refound_after(window: Window, overhead: float, pool: ThreadPoolExecutor | None) -> Array:
    """Return (N - 1, 6) what faces along the path and is re-observed if a step has 1 to 6 gaps.

    The sum over the pairs of scans that a step is part of (at most `LAGS` steps apart) of a share of 1 at most.
    """
    steps, T, surfels = window.steps, window.T_world_sensor, window.surfels
    found = np.zeros((len(steps) + LAGS, len(TRIED)))
    if (forward := direction_of(steps)) is None:
        return found[: len(steps)]
    # The usual speed, for the other step of a pair as well: a single registered step may be too short.
    single = _usual(steps[:, :3, 3] / window.gaps[:, None]) @ forward
    around = CLOSE * np.arange(-2, 3)  # metres: the speed only approximates that of the steps around
    alone = cache(lambda i: isolated_points(surfels[i], forward, overhead, BESIDE))

    def shares(first: int) -> Array:
        """Return (2, 6) the shares for the steps after a scan."""
        share_of = np.zeros((LAGS, len(TRIED)))
        if single[first] < MIN_STEP:
            return share_of
        submap, whole = facing_surfaces(surfels[first], forward, overhead)
        for last in range(first + 1, min(first + LAGS, len(steps)) + 1):
            each, n = slice(first, last), last - first
            lengths = single[each] * window.gaps[each]
            others = lengths.sum() - lengths
            distances = (others + single[each] * TRIED[:, None]).T[..., None] + around  # (n, 6, 5)
            pair, tried = inverse(T[first]) @ T[last], distances.ravel()
            refound = score_distances(submap, surfels[last], pair, forward, tried, window.share / n, overhead)
            refound[1] += count_met_again(alone(first), alone(last), pair, forward, tried, window.share / n)
            scores = weighed_down(refound.sum(axis=0), float(whole.sum()), tried)
            best = scores.reshape(distances.shape).max(axis=2)
            share_of[:n] += best / (best.max(axis=1, keepdims=True) + EVIDENCE)
        return share_of

    firsts = range(len(steps))
    for first, share_of in enumerate(map(shares, firsts) if pool is None else pool.map(shares, firsts)):
        found[first : first + LAGS] += share_of
    return found[: len(steps)]


def _usual(velocities: Array) -> Array:
    """Return (M, 3) the median of the `velocities` (M, 3) around each; zero if there is only one."""
    if len(velocities) == 1:
        return np.zeros_like(velocities)
    return np.nanmedian(np.delete(_windows(velocities, 2 * N_AROUND + 1), N_AROUND, axis=-1), axis=-1)


def _windows(velocities: Array, n: int) -> Array:
    """Return all `n` successive ones of the `velocities` (M, 3), as if there were `N_AROUND` NaN at both ends."""
    padded = np.pad(velocities, ((N_AROUND, N_AROUND), (0, 0)), constant_values=np.nan)
    return sliding_window_view(padded, n, axis=0)
