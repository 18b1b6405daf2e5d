"""Recall of moving objects, if the ground truth has instance ids.

IoU counts points, and a near van has a hundred times the points of a far pedestrian. Recall per object says how many
moving objects were found at all.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label, to_mos


@dataclass(frozen=True, eq=False)
class ObjectCounts:
    """Points of each moving object, and how many of them were called moving; counts add up with `+`.

    Attributes
    ----------
    label : (K,) uint32
        Increasing: class and instance id as in the truth. One object, as ids are kept over time.
    n_points : (K,) int64
        Points of the object.
    n_found : (K,) int64
        Those predicted moving.
    n_scans : (K,) int64
        Scans the object was seen in.
    """

    label: npt.NDArray[np.uint32] = field(default_factory=lambda: np.zeros(0, np.uint32))
    n_points: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    n_found: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    n_scans: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))

    def __len__(self) -> int:
        return len(self.label)

    def __add__(self, other: ObjectCounts) -> ObjectCounts:
        label, row = np.unique(np.concatenate([self.label, other.label]), return_inverse=True)

        def total(name: str) -> npt.NDArray[np.int64]:
            out = np.zeros(len(label), np.int64)
            np.add.at(out, row, np.concatenate([getattr(self, name), getattr(other, name)]))
            return out

        return ObjectCounts(label, total("n_points"), total("n_found"), total("n_scans"))

    @property
    def instance(self) -> npt.NDArray[np.int64]:
        """(K,) instance ids."""
        return (self.label >> 16).astype(np.int64)

    @property
    def recall(self) -> npt.NDArray[np.float64]:
        """(K,) share of each object's points that was found, in [0, 1]."""
        return self.n_found / self.n_points


def count_objects(prediction: npt.ArrayLike, truth: npt.ArrayLike) -> ObjectCounts:
    """Return the counts of one scan's moving objects.

    Parameters
    ----------
    prediction, truth : (N,) integers
        SemanticKITTI labels; objects are the instance ids in the truth's upper 16 bits.
    """
    labels = np.asarray(truth).astype(np.uint32)
    is_object = (to_mos(labels) == Label.MOVING) & (labels >> 16 > 0)
    is_found = to_mos(prediction)[is_object] == Label.MOVING
    label, row = np.unique(labels[is_object], return_inverse=True)
    n_points = np.bincount(row, minlength=len(label)).astype(np.int64)
    n_found = np.bincount(row[is_found], minlength=len(label)).astype(np.int64)
    return ObjectCounts(label, n_points, n_found, np.ones(len(label), np.int64))
