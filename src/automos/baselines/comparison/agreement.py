"""How far methods agree on which points move, with or without ground truth."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.json_members import without_nan


@dataclass(frozen=True, eq=False)
class Agreement:
    """IoU of the points that each two methods label moving, over all points of all scans.

    Attributes
    ----------
    methods : tuple of str
        K names.
    iou : (K, K) float64
        In [0, 1], nan if neither calls anything moving.
    """

    methods: tuple[str, ...]
    iou: npt.NDArray[np.float64]

    def to_dict(self) -> dict[str, dict[str, float | None]]:
        """Return the matrix by names, None for nan."""
        rows = zip(self.methods, without_nan(self.iou.tolist()), strict=True)
        return {name: dict(zip(self.methods, row, strict=True)) for name, row in rows}


def measure_agreement(methods: Sequence[str], scans: Iterable[Sequence[npt.NDArray[np.bool_]]]) -> Agreement:
    """Return how far `methods` agree.

    scans : for each scan what each method says, in the methods' order: (N,) bool moving.
    """
    both = np.zeros((len(methods), len(methods)), np.int64)
    for masks in scans:
        said = np.stack(list(masks)).astype(np.float32)  # (K, N); float32 counts exactly up to 16 million points
        both += (said @ said.T).astype(np.int64)
    alone = np.diag(both)
    either = alone[:, None] + alone[None, :] - both
    with np.errstate(invalid="ignore"):
        return Agreement(tuple(methods), both / np.where(either > 0, either, np.nan))
