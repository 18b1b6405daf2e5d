"""Upright boxes as rows of seven numbers: centre, size, yaw; metres and radians, level frame."""

import numpy as np
import numpy.typing as npt

from automos.core.upright_boxes import Boxes, points_in_boxes


def as_rows(boxes: Boxes) -> npt.NDArray[np.float64]:
    """Return (K, 7) the rows of boxes."""
    return np.column_stack([boxes.center, boxes.size, boxes.yaw])


def as_box(row: npt.NDArray[np.float64]) -> Boxes:
    """Return the box of one row (7,)."""
    return Boxes(row[None, :3], row[None, 3:6], row[6:], np.ones(1))


def is_inside(points: npt.NDArray, row: npt.NDArray[np.float64], margin: float = 0.0) -> npt.NDArray[np.bool_]:
    """Return which of `points` (N, 3) are in the box of one row (7,), or within `margin` metres of it."""
    return points_in_boxes(points, as_box(row), margin) >= 0
