"""What a body is: car, large vehicle, two-wheeler, person or other, from what it showed of itself and its speed.

A body is seen from one side, so what it showed bounds its extent from below: an extent beyond a kind's speaks against
the kind as a Gaussian does, a smaller one only as an exponential does. Nothing in the method depends on the kind but
the extents that a body never showed.
"""

from collections.abc import Mapping
from enum import IntEnum

import numpy as np

from automos.core.geometry import Array
from automos.core.scan import Mask


class Kind(IntEnum):
    """The kinds of bodies."""

    CAR = 0
    LARGE_VEHICLE = 1
    TWO_WHEELER = 2
    PERSON = 3
    OTHER = 4


def likeliest(probabilities: Mapping[str, float]) -> Kind:
    """Return the likeliest of the kinds named in lower case, OTHER of none."""
    return Kind[max(probabilities, key=probabilities.__getitem__, default="other").upper()]


EXTENT = np.array([[4.5, 1.85, 1.6], [8.0, 2.6, 3.2], [1.8, 0.65, 1.5], [0.75, 0.7, 1.7]])
"""Metres, usual length, width and height of all kinds but the last, and `SPREAD`, their standard deviations."""
SPREAD = 0.25 * EXTENT
FASTEST = np.array([60.0, 40.0, 25.0, 4.0])  # m/s
HIDDEN = 4.0  # decrease of the log-likelihood by a whole length, width or height that a body did not show
UNLIKE = -9.0  # log-likelihood of what is of no kind


def kind_probabilities(shown: Array, speed: Array) -> Array:
    """Return (B, 5) the probability of each `Kind`, in their order.

    shown : (B, 3) metres, greatest length, width and height that a body showed.   speed : (B,) m/s, its greatest.
    """
    beyond = shown[:, None, :] - EXTENT
    score = np.where(beyond > 0.0, -0.5 * (beyond / SPREAD) ** 2, HIDDEN * beyond / EXTENT).sum(axis=2)
    score = np.where(speed[:, None] > FASTEST, -np.inf, score)
    score = np.hstack([score, np.full((len(shown), 1), UNLIKE)])
    odds = np.exp(score - score.max(axis=1, keepdims=True))
    return odds / odds.sum(axis=1, keepdims=True)


def whole_extent(shown: Array, is_whole: Mask, speed: Array) -> Array:
    """Return (B, 3) the extents of bodies: what they showed where `is_whole`, else at least their likeliest kind's."""
    kind = kind_probabilities(shown, speed).argmax(axis=1)
    usual, least = (np.vstack([extent, np.zeros(3)])[kind] for extent in (EXTENT, EXTENT - 2.0 * SPREAD))
    return np.where(is_whole & (shown >= least), shown, np.maximum(shown, usual))
