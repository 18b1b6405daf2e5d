"""IoU of the moving class, computed as in SemanticKITTI's moving-object benchmark.

The points of all scans go into one confusion matrix: the score of a recording is not the mean over its scans, and that
of several recordings not their mean. Points without ground truth do not count. As in the benchmark, the prediction
"unlabeled" is an error on a moving point (a false static) and counts neither way on a static one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from automos.core.label_files import to_mos
from automos.core.labels import Label

UNLABELED, STATIC, MOVING = 0, 1, 2
"""Rows and columns of the confusion matrix."""

RANGES = (0.0, 15.0, 30.0, 50.0, np.inf)
"""Metres from the sensor; near range in front of what most networks and maps are limited to (50 m)."""

_CLASS_OF_LABEL = np.zeros(256, np.uint8)
_CLASS_OF_LABEL[Label.STATIC] = STATIC
_CLASS_OF_LABEL[Label.MOVING] = MOVING


@dataclass(frozen=True)
class Scores:
    """Scores of the moving class. A ratio is nan if its denominator is 0.

    Attributes
    ----------
    true_dynamic, false_dynamic, false_static : int
        Number of points: TD, FD and FS of the paper (IV-A).
    n_points : int
        Points whose ground truth is static or moving.
    n_unlabeled : int
        Points of these that were predicted unlabeled.
    """

    true_dynamic: int
    false_dynamic: int
    false_static: int
    n_points: int
    n_unlabeled: int

    @property
    def iou(self) -> float:
        """TD / (TD + FD + FS), in [0, 1]."""
        return ratio(self.true_dynamic, self.true_dynamic + self.false_dynamic + self.false_static)

    @property
    def precision(self) -> float:
        """TD / (TD + FD), in [0, 1]."""
        return ratio(self.true_dynamic, self.true_dynamic + self.false_dynamic)

    @property
    def recall(self) -> float:
        """TD / (TD + FS), in [0, 1]."""
        return ratio(self.true_dynamic, self.true_dynamic + self.false_static)

    @property
    def ratios(self) -> dict[str, float]:
        """The three ratios by name."""
        return {"iou": self.iou, "precision": self.precision, "recall": self.recall}


@dataclass(frozen=True, eq=False)
class Counts:
    """Points by range, ground truth and prediction; counts of several scans or recordings add up with `+`.

    Attributes
    ----------
    confusion : (R + 1, 3, 3) int64
        Range bin, ground truth, prediction (UNLABELED, STATIC, MOVING). The last bin holds points whose range is
        unknown or not finite.
    n_scans : int
        Number of scans.
    """

    confusion: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros((len(RANGES), 3, 3), np.int64))
    n_scans: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(self.confusion + other.confusion, self.n_scans + other.n_scans)

    @property
    def scores(self) -> Scores:
        """The scores of all points."""
        return _score(self.confusion.sum(axis=0))

    @property
    def scores_by_range(self) -> dict[str, Scores]:
        """The scores of each range bin ("0-15 m"), in order."""
        return {name: _score(matrix) for name, matrix in zip(range_names(), self.confusion, strict=False)}


def count(prediction: npt.ArrayLike, truth: npt.ArrayLike, ranges: npt.ArrayLike | None = None) -> Counts:
    """Count the points of one scan by range, ground truth and prediction.

    Parameters
    ----------
    prediction, truth : (N,) integer
        SemanticKITTI labels. Only the lower 16 bits count: 9 to 99 are static, 251 to 259 moving.
    ranges : (N,) float, optional
        Distance from the sensor in metres, for scores by range.

    Returns
    -------
    Counts
        Counts of several scans add up with `+`; `.scores` has IoU, precision and recall.

    Raises
    ------
    ValueError
        The arrays differ in length.

    Examples
    --------
    >>> from automos.evaluation.moving import count
    >>> count([251, 251, 9, 9], [251, 9, 251, 9]).scores.iou  # one right, one false, one missed
    0.3333333333333333
    """
    predicted, true = _CLASS_OF_LABEL[to_mos(prediction)], _CLASS_OF_LABEL[to_mos(truth)]
    if predicted.shape != true.shape:
        raise ValueError(f"prediction and truth must be of one shape, got {predicted.shape} and {true.shape}")
    bins = np.full(len(true), len(RANGES) - 1)
    if ranges is not None:
        distance = np.asarray(ranges)
        if distance.shape != true.shape:
            raise ValueError(f"ranges must be {true.shape}, got {distance.shape}")
        # searchsorted puts nan and infinity behind every edge, among the far points
        bins = np.where(np.isfinite(distance), np.searchsorted(RANGES[1:-1], distance, side="right"), bins)
    cell = (bins * 3 + true) * 3 + predicted
    return Counts(np.bincount(cell, minlength=len(RANGES) * 9).reshape(-1, 3, 3).astype(np.int64), n_scans=1)


def range_names() -> list[str]:
    """Return the names of the range bins: "0-15 m", ..., "50+ m"."""
    return [f"{low:g}-{high:g} m" if np.isfinite(high) else f"{low:g}+ m" for low, high in pairwise(RANGES)]


def _score(matrix: npt.NDArray[np.int64]) -> Scores:
    return Scores(
        true_dynamic=int(matrix[MOVING, MOVING]),
        false_dynamic=int(matrix[STATIC, MOVING]),
        false_static=int(matrix[MOVING, STATIC] + matrix[MOVING, UNLABELED]),
        n_points=int(matrix[[STATIC, MOVING]].sum()),
        n_unlabeled=int(matrix[[STATIC, MOVING], UNLABELED].sum()),
    )


def ranges_of(points: npt.NDArray) -> npt.NDArray:
    """Return (N,) metres from the sensor to each of `points` (N, 3); not finite where a coordinate is not."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.linalg.norm(points, axis=1)


def percent(share: float) -> str:
    """Return a share as tables show it, in percent; "-" where there is none."""
    return "-" if np.isnan(share) else f"{100 * share:.1f}"


def ratio(part: float, whole: float) -> float:
    """Return `part` by `whole`, nan without a whole."""
    return float(part / whole) if whole else float("nan")
