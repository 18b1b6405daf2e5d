"""Scans that are missing, where no stamp says so: a step of twice the length amid even ones.

No vehicle doubles its speed for a tenth of a second. But registrations begin with the motion before, and amid traffic
that keeps pace they stay there: of the twofold step nothing shows. What faces along the path does not go along: it is
found again at a step of one, two or more gaps, over the step itself and over two neighbouring ones. Both are weighed
together, since in the open nothing faces along the path, and registrations are right there.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence as Several
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from automos.odometry.facing import EVIDENCE, expected_share, score_distances
from automos.odometry.speed_scores import WEIGHTS
from automos.odometry.submap import make_submap
from automos.odometry.surfels import Surfels
from automos.scan import Pose
from automos.settings import OdometrySettings

Array = npt.NDArray[np.float64]

N_AROUND = 3
"""Steps on either side from which the usual speed is taken."""
TRIED = np.arange(1.0, 7.0)
"""Gaps that a step may have: up to five scans in a row may be missing and still be counted."""
LAGS = (1, 2)
"""Steps over which things are found again: over more, errors of several steps add up."""
AROUND = 0.1 * np.arange(-2, 3)
"""Metres about the distance of so many gaps: the speed is only nearly that of the steps around."""
LEAST_STEP = 0.2
"""Metres, steps that are usually shorter than this look alike, single or twofold."""
USUAL_ACCELERATION = 3.0
"""m/s^2, by which the speed changes from scan to scan."""
STEP_NOISE = 0.05
"""Metres, error of a registration from scan to scan."""
MISTAKEN = 20.0
"""Logarithm of the odds that a registration counts for at most: it may follow traffic."""
SELDOM, EACH = 8.0, 2.0
"""The same of how much likelier it is that no scan is missing at a place; and for each that is missing there."""
REFOUND = 20.0
"""The same for all that faces along the path, found again: half as much over each of three pairs of scans outweighs a
registration and the rarity together."""
CHANCE = 0.15
"""Of what is found again, for each scan that is missing: posts along a road stand at the same distances."""


def find_missing(steps: Pose, gaps: Array, period: float, refound: Array | None = None) -> Array:
    """Return (N - 1,) the gaps between scans, estimated from the motion where there are no stamps.

    How many are missing is the hypothesis under which the speed changes least and most is found again. The less the
    scans before and after agree on the speed, the less a step's length counts.

    Parameters
    ----------
    steps : (N - 1, 4, 4) from each scan to the one before it, as registered.
    gaps : (N - 1,) taken where nothing else is clearly more likely.
    period : seconds between scans.
    refound : (N - 1, 6) how much of what faces along the path is found again, were each step of 1 to 6 gaps.
    """
    travelled, found = steps[:, :3, 3], gaps
    rarity = SELDOM + EACH * (TRIED - 1.0)
    certain = np.hypot(STEP_NOISE, USUAL_ACCELERATION * (period * TRIED) ** 2)
    for _ in range(2):  # neighbours may have gaps of their own
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
                continue  # twofold steps are hardly longer
            deviation = np.hypot(certain, 0.5 * TRIED * np.linalg.norm(after - before))  # both sides may be right
            off = np.linalg.norm(travelled[k] - TRIED[:, None] * usual, axis=1) / deviation
            cost = np.minimum(0.5 * off**2, MISTAKEN) + np.log(deviation) + rarity * (gaps[k] != TRIED)
            if refound is not None:
                cost -= REFOUND * np.maximum(refound[k] - CHANCE * (TRIED - 1.0), 0.0)
            found[k] = TRIED[np.argmin(cost)]
    return found


class FacingGaps:
    """Finds, scan by scan, at how many gaps what faces along the path is found again; holds a few scans only."""

    def __init__(self, share: float, settings: OdometrySettings, pool: ThreadPoolExecutor | None = None):
        """Take the share of the time between scans that a sweep lasts, and threads to work with."""
        self._share, self._settings, self._pool = share, settings, pool
        self._surfels: deque[Surfels | Future[Surfels]] = deque(maxlen=max(LAGS) + N_AROUND + 1)
        self._come: list[Array] = []
        self._steps: list[Pose] = []
        self._found: list[Array | Future[Array]] = []

    def add(self, surfels: Surfels | Future[Surfels], T_last_this: Pose, gap: float) -> None:
        """Add a scan: its surfels, its pose in and its gap to the scan before."""
        if self._surfels:
            self._steps.append(T_last_this)
            self._come.append(T_last_this[:3, 3] / gap)
        self._surfels.append(surfels)
        if len(self._surfels) == self._surfels.maxlen:  # all that is around the first of them is known
            self._ask(0)

    def shares(self) -> Array:
        """Return (N - 1, 6) what is found again at 1 to 6 gaps: of three pairs of scans, 1 each at most."""
        n = len(self._steps)
        for row in range(len(self._found), n):
            self._ask(row - n - 1)
        total = np.zeros((n + max(LAGS), len(TRIED)))
        for row, found in enumerate(self._found):
            total[row : row + max(LAGS)] += found.result() if isinstance(found, Future) else found
        return total[:n]

    def _ask(self, place: int) -> None:
        """Ask for the pairs of scans that begin with the one at `place` of those that are held."""
        scans = list(self._surfels)[place:][: 1 + max(LAGS)]
        row = len(self._found)
        steps = self._steps[row : row + len(scans) - 1]
        usual = [_usual(self._come, k) for k in range(row, row + len(steps))]
        asked = (scans, steps, usual, self._share, self._settings)
        self._found.append(_shares(*asked) if self._pool is None else self._pool.submit(_shares, *asked))


def _usual(travelled: list[Array], k: int) -> Array:
    """Return (3,) the metres per gap of the steps around the k-th."""
    around = [*travelled[max(k - N_AROUND, 0) : k], *travelled[k + 1 : k + 1 + N_AROUND]]
    return np.median(around, axis=0) if around else np.zeros(3)


def _shares(
    scans: Several[Surfels | Future[Surfels]],
    steps: list[Pose],
    usual: list[Array],
    share: float,
    settings: OdometrySettings,
) -> Array:
    """Return (2, 6) what is found again, were each of the steps that follow the first scan of 1 to 6 gaps."""
    found = np.zeros((max(LAGS), len(TRIED)))
    length = float(np.linalg.norm(usual[0]))
    if length < LEAST_STEP:
        return found
    forward = usual[0] / length
    surfels = [s.result() if isinstance(s, Future) else s for s in scans]
    submap = make_submap(surfels[:1], np.eye(4)[None])
    at_rest = score_distances(submap, surfels[0], np.eye(4), forward, np.zeros(1), 0.0, settings.overhead)
    whole = float(WEIGHTS @ at_rest[:, 0])
    T = np.eye(4)
    for n in range(1, len(surfels)):
        T = T @ steps[n - 1]
        travelled = np.array([step[:3, 3] @ forward for step in steps[:n]])
        single = np.array([each @ forward for each in usual[:n]])
        distances = (travelled.sum() - travelled + single * TRIED[:, None]).T[..., None] + AROUND  # (n, 6, 5)
        scores = WEIGHTS @ score_distances(
            submap, surfels[n], T, forward, distances.ravel(), share / n, settings.overhead
        )
        scores *= np.minimum(scores / np.maximum(whole * expected_share(distances.ravel()), 1e-9), 1.0)
        best = scores.reshape(distances.shape).max(axis=2)
        found[:n] += best / (best.max(axis=1, keepdims=True) + EVIDENCE)
    return found
