"""The labels and their numbers (SemanticKITTI's)."""

from enum import IntEnum

import numpy as np
import numpy.typing as npt


class Label(IntEnum):
    """Label of a point, with the number that SemanticKITTI uses in the lower 16 bits of its label files.

    Attributes
    ----------
    UNLABELED : int
        0: no measurement, on the ego body, or not known.
    STATIC : int
        9: does not move.
    MOVING : int
        251: moves, or moved at some time while it was observed (the default meaning).
    """

    UNLABELED = 0
    STATIC = 9
    MOVING = 251


def as_probability(confidence: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """Return (N,) `confidence`, which is stored in a byte, as the probability in [0, 1] that a label is right."""
    return confidence.astype(np.float32) / np.float32(255.0)
