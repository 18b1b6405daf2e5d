"""When the scans of a recording were taken: their stamps, or else their number and how many are missing between them.

A missing scan without a stamp shows as a step of twice the length among even ones. But registrations start with the
previous motion, and in traffic that keeps pace they stay there. Surfaces facing along the path do not move with the
traffic: they are re-observed at a step of one, two or more gaps. Both cues are combined, since in open terrain no
surface faces along the path, but registrations are right there.
"""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from automos.arrays import as_array
from automos.errors import InputError
from automos.geometry import Array
from automos.odometry.facing import EVIDENCE, WEIGHTS, facing_surfaces, score_distances, weighed_down
from automos.odometry.surfels import Surfels
from automos.scan import LATEST, Pose, Sequence
from automos.settings import OdometrySettings

USUAL_PERIOD = 0.1
"""Seconds between scans if the recording has no clock."""
MOST_UNEVEN = 1e-7
"""Least ratio of the shortest time between scans to the usual one: no clock resolves both."""
SHORTEST_PERIOD = 1e-3
"""Seconds: no sensor has a shorter period."""
STAMP_DIGITS = 9
"""Decimals of a stamp (nanoseconds), so that the same clock read from two formats is identical to the last bit."""

N_AROUND = 3
"""Steps on either side that define the usual speed."""
TRIED = np.arange(1.0, 7.0)
"""Hypotheses on the gaps of a step: up to five consecutive missing scans are detected."""
LAGS = 2
"""Steps over which surfaces are re-observed, at most: over more, errors of several steps add up."""
AROUND = 0.1 * np.arange(-2, 3)
"""Metres around the distance of so many gaps: the speed only approximates that of the steps around."""
LEAST_STEP = 0.2
"""Metres; if steps are usually shorter, double steps cannot be distinguished from single ones."""
USUAL_ACCELERATION = 3.0
"""m/s², usual change of the speed from scan to scan."""
STEP_NOISE = 0.05
"""Metres, error of a registration from scan to scan."""
MISTAKEN = 20.0
"""Greatest log-odds that a registration contributes: it may follow traffic."""
SELDOM, EACH = 8.0, 2.0
"""Prior log-odds that no scan is missing at a place, and for each further missing scan."""
REFOUND = 20.0
"""Log-odds if all surfaces facing along the path are re-observed: half as much over each of three pairs of scans
outweighs a registration and the prior together."""
CHANCE = 0.15
"""Share re-observed by chance for each missing scan: posts along a road are evenly spaced."""


@dataclass(frozen=True, eq=False)
class Clock:
    """When the scans of a recording were taken.

    Gaps are 1 unless a scan is clearly missing: else, stamps rounded to two decimals would cause speed errors of 10 %.
    """

    stamps: Array  # (N,) seconds
    period: float  # seconds, the usual time between scans
    gaps: Array  # (N - 1,) time between neighbouring scans over `period`
    has_stamps: bool  # False if scans are only counted: then `find_missing` estimates how many are missing

    def with_gaps(self, gaps: Array) -> Clock:
        """Return the clock of the same scans if they are `gaps` (N - 1,) periods apart."""
        return replace(self, stamps=self.stamps[0] + self.period * np.append(0.0, np.cumsum(gaps)), gaps=gaps)


def read_clock(sequence: Sequence) -> Clock:
    """Return the clock of `sequence`; ten scans per second if it has none.

    Raises
    ------
    InputError
        The stamps are not one per scan, do not increase, or are not seconds.
    """
    n, given = len(sequence), sequence.stamps
    stamps = USUAL_PERIOD * np.arange(n, dtype=np.float64) if given is None else as_array(given, "f8", (n,), "stamps")
    if not (np.abs(stamps) < LATEST).all():
        odd = stamps[int(np.argmin(np.abs(stamps) < LATEST))]
        raise InputError(f"{sequence.name} has an invalid stamp of {odd:g} s: give stamps in seconds, or none")
    stamps = np.round(stamps, STAMP_DIGITS)
    if len(stamps) < 2:
        return Clock(stamps, USUAL_PERIOD, np.ones(0), given is not None)
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    if not (steps > MOST_UNEVEN * usual).all() or usual < SHORTEST_PERIOD:
        least = int(np.argmin(steps))
        raise InputError(
            f"{sequence.name}: scan {least + 1} is {steps[least]:g} s after the previous scan (usual period: "
            f"{usual:g} s): stamps must be in seconds and increase; give valid stamps, or none"
        )
    is_gap = steps > 1.5 * usual
    period = float(steps[~is_gap].mean())
    return Clock(stamps, period, np.where(is_gap, steps / period, 1.0), given is not None)


def find_missing(steps: Pose, gaps: Array, period: float, refound: Array | None = None) -> Array:
    """Return (N - 1,) the gaps under which the speed changes least and most surfaces are re-observed.

    The less the scans before and after agree on the speed, the less a step's length counts.

    Parameters
    ----------
    steps : (N - 1, 4, 4) float64, from each scan to the previous one, as registered.
    gaps : (N - 1,) float64, kept unless another hypothesis is clearly more likely.
    period : float, seconds between scans.
    refound : (N - 1, 6) float64, optional, re-observed share of surfaces facing along the path, for steps of 1-6 gaps.
    """
    travelled, found = steps[:, :3, 3], gaps
    rarity = SELDOM + EACH * (TRIED - 1.0)
    certain = np.hypot(STEP_NOISE, USUAL_ACCELERATION * (period * TRIED) ** 2)
    for _ in range(2):  # neighbouring steps may have gaps, too
        velocity, found = travelled / found[:, None], gaps.copy()
        for k in range(len(travelled)):
            sides = [velocity[max(k - N_AROUND, 0) : k], velocity[k + 1 : k + 1 + N_AROUND]]
            medians = [np.median(side, axis=0) for side in sides if len(side) == N_AROUND]
            if not medians:
                continue
            before, after = medians[0], medians[-1]
            usual = 0.5 * (before + after)
            length = np.linalg.norm(usual)
            if length < LEAST_STEP:
                continue  # double steps are hardly longer
            deviation = np.hypot(certain, 0.5 * TRIED * np.linalg.norm(after - before))  # either side may be right
            off = np.linalg.norm(travelled[k] - TRIED[:, None] * usual, axis=1) / deviation
            cost = np.minimum(0.5 * off**2, MISTAKEN) + np.log(deviation) + rarity * (gaps[k] != TRIED)
            if refound is not None:
                cost -= REFOUND * np.maximum(refound[k] - CHANCE * (TRIED - 1.0), 0.0)
            found[k] = TRIED[np.argmin(cost)]
    return found


class FacingGaps:
    """Finds, scan by scan, after how many gaps surfaces facing along the path are re-observed; holds few scans."""

    def __init__(self, share: float, settings: OdometrySettings, pool: ThreadPoolExecutor):
        """Take the sweep duration over the time between scans, and threads."""
        self._share, self._settings, self._pool = share, settings, pool
        self._surfels: deque[Future[Surfels]] = deque(maxlen=LAGS + N_AROUND + 1)
        self._velocities: list[Array] = []
        self._steps: list[Pose] = []
        self._found: list[Future[Array]] = []

    def add(self, surfels: Future[Surfels], T_last_this: Pose, gap: float) -> None:
        """Add a scan: its surfels, its pose in the previous scan's frame, and the gap between them."""
        if self._surfels:
            self._steps.append(T_last_this)
            self._velocities.append(T_last_this[:3, 3] / gap)
        self._surfels.append(surfels)
        if len(self._surfels) == self._surfels.maxlen:  # all steps around the first scan are known
            self._start_scoring(0)

    def shares(self) -> Array:
        """Return (N - 1, 6) the re-observed share at 1 to 6 gaps, summed over three pairs of scans (1 each at most)."""
        n = len(self._steps)
        for row in range(len(self._found), n):
            self._start_scoring(row - n - 1)
        total = np.zeros((n + LAGS, len(TRIED)))
        for row, found in enumerate(self._found):
            total[row : row + LAGS] += found.result()
        return total[:n]

    def _start_scoring(self, place: int) -> None:
        """Start scoring the pairs of scans that begin with number `place` of the held scans."""
        scans = list(self._surfels)[place:][: 1 + LAGS]
        row = len(self._found)
        steps = self._steps[row : row + len(scans) - 1]
        usual = [_usual(self._velocities, k) for k in range(row, row + len(steps))]
        self._found.append(self._pool.submit(_shares, scans, steps, usual, self._share, self._settings.overhead))


def _usual(velocities: list[Array], k: int) -> Array:
    """Return (3,) the median metres per gap of the steps around the k-th."""
    around = [*velocities[max(k - N_AROUND, 0) : k], *velocities[k + 1 : k + 1 + N_AROUND]]
    return np.median(around, axis=0) if around else np.zeros(3)


def _shares(
    scans: list[Future[Surfels]], steps: list[Pose], usual: list[Array], share: float, overhead: float
) -> Array:
    """Return (2, 6) the re-observed share if each of the steps after the first scan has 1 to 6 gaps."""
    found = np.zeros((LAGS, len(TRIED)))
    length = float(np.linalg.norm(usual[0]))
    if length < LEAST_STEP:
        return found
    forward = usual[0] / length
    surfels = [scan.result() for scan in scans]
    submap, whole = facing_surfaces(surfels[0], forward, overhead)
    T = np.eye(4)
    for n in range(1, len(surfels)):
        T = T @ steps[n - 1]
        travelled = np.array([step[:3, 3] @ forward for step in steps[:n]])
        single = np.array([each @ forward for each in usual[:n]])
        distances = (travelled.sum() - travelled + single * TRIED[:, None]).T[..., None] + AROUND  # (n, 6, 5)
        refound = score_distances(submap, surfels[n], T, forward, distances.ravel(), share / n, overhead)
        scores = weighed_down(WEIGHTS @ refound, float(WEIGHTS @ whole), distances.ravel())
        best = scores.reshape(distances.shape).max(axis=2)
        found[:n] += best / (best.max(axis=1, keepdims=True) + EVIDENCE)
    return found
