"""The objects of one scan: boxes, verdicts and velocities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.upright_boxes import Boxes


@dataclass(frozen=True, eq=False)
class ScanBoxes:
    """The objects of one scan.

    Attributes
    ----------
    boxes : Boxes
        K boxes in the requested frame; the score is the confidence of the verdict.
    ids : (K,) int64
        Track ids, from 1.
    verdict : (K,) int8
        Index into `VERDICTS`.
    velocity : (K, 3) float64
        Metres per second, in the same frame.
    observed : (K,) bool
        False if the object has no points in this scan and its box was interpolated.
    """

    boxes: Boxes
    ids: npt.NDArray[np.int64]
    verdict: npt.NDArray[np.int8]
    velocity: npt.NDArray[np.float64]
    observed: npt.NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.ids)
