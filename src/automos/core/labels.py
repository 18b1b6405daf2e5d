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


OUTLIER = 1
"""SemanticKITTI's number for drops, dust and false returns in the air. Its moving-object benchmark leaves them out."""


def to_mos(semantic: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """Return SemanticKITTI labels mapped as its moving-object benchmark maps them (semantic-kitti-mos.yaml).

    Parameters
    ----------
    semantic : (N,) integers; the lower 16 bits are the class, the upper 16 the instance.

    Returns
    -------
    (N,) uint8 with the values of `Label`: 9..99 are STATIC, 251..259 MOVING, everything else UNLABELED.
    """
    classes = np.asarray(semantic).astype(np.uint32) & 0xFFFF
    moves, stands = _moves(classes), (classes >= Label.STATIC) & (classes < 100)
    return np.select([moves, stands], [Label.MOVING, Label.STATIC], Label.UNLABELED).astype(np.uint8)


def find_unknown(semantic: npt.NDArray[np.uint32]) -> int | None:
    """Return a class among `semantic` (N,) that SemanticKITTI does not have (0 to 99, 251 to 259); None if all are."""
    classes = semantic & 0xFFFF
    is_known = (classes < 100) | _moves(classes)
    return None if is_known.all() else int(classes[is_known.argmin()])


def _moves(classes: npt.NDArray[np.integer]) -> npt.NDArray[np.bool_]:
    return (classes >= Label.MOVING) & (classes < 260)


def as_probability(confidence: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """Return (N,) `confidence`, which is stored in a byte, as the probability in [0, 1] that a label is right."""
    return confidence.astype(np.float32) / np.float32(255.0)


def pack(labels: npt.NDArray, instances: npt.NDArray | None = None) -> npt.NDArray[np.uint32]:
    """Return (N,) uint32 labels as SemanticKITTI stores them: class below, instance id in the upper 16 bits."""
    packed = labels.astype(np.uint32)
    if instances is not None:
        # 16 bits are all the format has; ids beyond it wrap but never to 0, which means "no instance".
        ids = instances.astype(np.int64)
        packed |= np.where(ids > 0, (ids - 1) % 0xFFFF + 1, 0).astype(np.uint32) << np.uint32(16)
    return packed
