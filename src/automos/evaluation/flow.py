"""End-point errors of scene flow, in metres until the next scan.

Only the points' own motion is compared; the sensor's motion is removed from both. Two metrics are in use. *Three-way*:
the mean errors of moving object points, static object points and background points, each on its own, because nine
points in ten are static. *Bucket-normalised*: moving points by their true speed, the error of each bucket divided by
its speed, so that a pedestrian counts as much as a car; 0 is exact, 1 is the score of "nothing moves". (Argoverse 2's
first and second scene-flow challenge; labels here have no classes, so each bucket covers all objects.)
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from rich.table import Table

from automos.core.scan import Sequence

CLOSE = 35.0
"""Metres from the sensor, along x and y, up to which points count."""
DYNAMIC = 0.5
"""Metres per second from which a point counts as moving."""
SPEEDS = np.append(np.linspace(0.0, 20.0, 51), np.inf)
"""Edges of the buckets, metres per second; the first bucket is of what stands."""

Metres = npt.NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class FlowCounts:
    """Sums over points; those of several scans or recordings add up with `+`.

    Attributes
    ----------
    threeway : (3, 2) float64
        Points and sum of errors (m): moving objects, standing objects, background.
    buckets : (B, 3) float64
        Points on objects, sum of errors (m), sum of true motion (m), by true speed.
    """

    threeway: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros((3, 2)))
    buckets: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros((len(SPEEDS) - 1, 3)))

    def __add__(self, other: Self) -> Self:
        return type(self)(self.threeway + other.threeway, self.buckets + other.buckets)

    @property
    def epe(self) -> dict[str, float]:
        """Mean end-point errors, metres: moving, standing, background, and `three_way`, their mean."""
        n, total = self.threeway.T
        means = np.divide(total, n, out=np.full(3, np.nan), where=n > 0)
        three = float(np.nanmean(means)) if (n > 0).any() else float("nan")
        return {**dict(zip(("moving", "standing", "background"), means.tolist(), strict=True)), "three_way": three}

    @property
    def normalised(self) -> float:
        """Mean over the buckets of moving points of error by speed; nan if nothing moves."""
        n, error, motion = self.buckets[1:].T
        return float((error[n > 0] / motion[n > 0]).mean()) if (n > 0).any() else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Return all scores as plain numbers, None where there was nothing to score."""
        scores = {**{f"epe_{name}": value for name, value in self.epe.items()}, "normalised": self.normalised}
        return {name: None if np.isnan(value) else round(value, 6) for name, value in scores.items()}

    def table(self) -> Table:
        """Return the scores as a table."""
        epe = self.epe
        table = Table(title="Scene flow: end-point error of each point's own motion")
        for heading in ("moving m", "standing m", "background m", "three-way m", "normalised"):
            table.add_column(heading, justify="right")
        table.add_row(*(f"{epe[name]:.3f}" for name in epe), f"{self.normalised:.3f}")
        return table


def count_flow(motion: Metres, truth: Metres, is_object: npt.NDArray[np.bool_], seconds: float) -> FlowCounts:
    """Return the counts of one scan.

    Parameters
    ----------
    motion, truth : (N, 3) array
        Metres until the next scan, beyond the sensor's; rows with a NaN in the truth do not count.
    is_object : (N,) bool
        Whether the truth knows an object there.
    seconds : float
        Until the next scan.
    """
    known = np.isfinite(truth).all(axis=1)
    motion, truth = motion[known], truth[known]
    error, length = np.linalg.norm(motion - truth, axis=1), np.linalg.norm(truth, axis=1)
    is_object = is_object[known] | (length > 0.0)
    kind = np.where(is_object, np.where(length >= DYNAMIC * seconds, 0, 1), 2)
    threeway = np.stack([np.bincount(kind, weights, minlength=3) for weights in (None, error)], axis=1)
    bucket = np.searchsorted(SPEEDS, length[is_object] / seconds, side="right") - 1
    sums = (None, error[is_object], length[is_object])
    buckets = np.stack([np.bincount(bucket, weights, minlength=len(SPEEDS) - 1) for weights in sums], axis=1)
    return FlowCounts(threeway.astype(np.float64), buckets.astype(np.float64))


def evaluate_flow(sequence: Sequence, motion_of: Callable[[int], Metres]) -> FlowCounts:
    """Return the counts of all scans of `sequence` with known motion; `motion_of` gives the estimate."""
    counts, stamps = FlowCounts(), sequence.stamps
    for i in range(len(sequence) - 1):
        truth = sequence.truth_motion(i)
        if truth is None:
            continue
        points, labels = sequence[i].points, sequence.truth(i)
        is_object = np.zeros(len(points), bool) if labels is None else labels >> 16 > 0
        is_close = (np.abs(points[:, :2]) <= CLOSE).all(axis=1)
        seconds = 0.1 if stamps is None else float(stamps[i + 1] - stamps[i])
        counts += count_flow(motion_of(i)[is_close], truth[is_close], is_object[is_close], seconds)
    return counts
