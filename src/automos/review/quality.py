"""Precision and recall of labels, with 95 % intervals, from a random sample that a person judged.

Every point is in one of three strata. *Moving*: labelled moving; random points of it, judged moving or not, give the
precision. *Fringe*: not labelled moving, but in or near the box of a moving object; random points of it show how much
of found objects was missed. *Rest*: all other points. Moving points are far too rare in the rest to be found by drawing
points, but a person who looks at a whole scan sees all of them at once. So moments are drawn from the rest, one in each
of several windows of equal length, and all missed points in them are counted.

    TP = N_moving p        FN = N_fringe q + sum_h M_h y_h        precision = p        recall = TP / (TP + FN)

p, q: shares of the looks; M_h: scans in window h; y_h: points missed in the scan drawn from it. The intervals of p and
q are Clopper and Pearson's (Biometrika 1934), which hold for any truth. The variance of the sum over windows is
estimated from differences of neighbours (Wolter, Introduction to Variance Estimation, 2007, 8.2). What may have been
missed in scans that were not drawn is added by the rule of three: if something is missed in a share s of the moments,
m of them all look clean with probability (1 - s)^m. The parts are combined by MOVER (Zou and Donner, Statistics in
Medicine 2008; Donner and Zou 2012 for the ratio).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.special import betaincinv, stdtrit

LEVEL = 0.95
"""Share of samples whose interval holds the truth."""
TAIL = 0.5 * (1.0 - LEVEL)


@dataclass(frozen=True)
class Estimate:
    """A value and the interval it is in with a confidence of `LEVEL`."""

    value: float
    low: float
    high: float

    def scaled(self, factor: float) -> Estimate:
        """Return it times `factor`, which is not negative."""
        return Estimate(factor * self.value, factor * self.low, factor * self.high)


@lru_cache(10_000)
def share(n_hits: int, n_looks: int) -> Estimate:
    """Return the share of a population of which `n_hits` of `n_looks` random draws were (Clopper and Pearson)."""
    if n_looks == 0:
        return Estimate(0.5, 0.0, 1.0)
    low = float(betaincinv(n_hits, n_looks - n_hits + 1, TAIL)) if n_hits else 0.0
    high = float(betaincinv(n_hits + 1, n_looks - n_hits, 1.0 - TAIL)) if n_hits < n_looks else 1.0
    return Estimate(n_hits / n_looks, low, high)


def total_of_moments(missed: npt.NDArray[np.float64], n_scans: npt.NDArray[np.int64], usual: float) -> Estimate:
    """Return the points missed in all scans.

    Parameters
    ----------
    missed : (m,) float64
        Points missed in the scan drawn from each window, in the order of time.
    n_scans : (m,) int64
        Scans in each window.
    usual : float
        Points that an object has in a scan: what is missed where nobody looked is taken to be of this size.
    """
    totals = n_scans * missed
    value, m = float(totals.sum()), len(totals)
    unseen = 1.0 - m / float(n_scans.sum())  # a recording of which every scan was looked at leaves nothing open
    if m > 1:
        variance = 0.5 * float((np.diff(totals) ** 2).sum()) * m / (m - 1) * unseen
        spread = float(stdtrit(max(m // 2, 1), 1.0 - TAIL)) * np.sqrt(variance)
    else:
        spread = value * unseen
    rare = (1.0 - TAIL ** (1.0 / m)) * float(n_scans.sum()) * usual * unseen
    low = max(float(missed.sum()), value - spread)
    return Estimate(value, min(low, value), value + float(np.hypot(spread, rare)))


def recall(true: Estimate, missed: list[Estimate]) -> Estimate | None:
    """Return the recall from the points found rightly and the parts of those missed; None if nothing was found."""
    if true.value <= 0.0:
        return None
    value = sum(part.value for part in missed)
    below = float(np.sqrt(sum((part.value - part.low) ** 2 for part in missed)))
    above = float(np.sqrt(sum((part.high - part.value) ** 2 for part in missed)))
    low, high = ratio(Estimate(value, max(value - below, 0.0), value + above), true)
    return Estimate(true.value / (true.value + value), 1.0 / (1.0 + high), 1.0 / (1.0 + low))


def ratio(over: Estimate, under: Estimate) -> tuple[float, float]:
    """Return the interval of the ratio of two independent estimates (MOVER-R); `under` is above 0."""
    a, b = over.value, under.value

    def end(one: float, other: float, sign: float) -> float:
        inner = (a * b) ** 2 - one * other * (2.0 * a - one) * (2.0 * b - other)
        bottom = other * (2.0 * b - other)
        return (a * b + sign * np.sqrt(max(inner, 0.0))) / bottom if bottom > 0.0 else np.inf

    return float(max(end(over.low, under.high, -1.0), 0.0)), float(end(over.high, under.low, 1.0))
