"""Which sides of a segment are hidden: where it ends, something nearer to the sensor begins.

What is seen of a body then ends where the nearer thing does, and not where the body does.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.cells import turn_of
from automos.core.kernels import kernel
from automos.core.range_image import SUPPORT, SUPPORT_PER_METRE

_LEAST_STEP = 0.003  # radians: finer grids only take longer
_COLUMNS = 3  # of a segment that are its edge, and beside it that are looked at


class Nearest(NamedTuple):
    """The M points of a scan on a grid of rays about the sensor, and the shortest range in each cell."""

    row: npt.NDArray[np.int32]  # (M,)
    column: npt.NDArray[np.int32]  # (M,)
    ranges: npt.NDArray[np.float32]  # (M,) metres
    image: npt.NDArray[np.float32]  # (H, W) metres, inf where there is no point


def nearest_points(points: npt.NDArray, ray_steps: tuple[float, float]) -> Nearest:
    """Return the ranges of `points` (M, 3), metres, z up, relative to the sensor, on a grid.

    ray_steps : (2,) radians between neighbouring rays, vertically and horizontally.
    """
    row_height, column_width = (max(float(step), _LEAST_STEP) for step in ray_steps)
    flat = np.hypot(points[:, 0], points[:, 1])
    row = np.floor(np.nan_to_num(np.arctan2(points[:, 2], flat)) / row_height).astype(np.int32)
    row -= row.min(initial=0)
    image = np.full((int(row.max(initial=0)) + 1, int(2.0 * np.pi / column_width)), np.float32(np.inf))
    column, ranges = _fill(points, row, image)
    return Nearest(row, column, ranges, image)


def hidden_sides(ids: npt.NDArray[np.int32], nearest: Nearest, n: int) -> npt.NDArray[np.bool_]:
    """Return (n, 2) whether something nearer is beside most of the left and of the right edge of segments 0 ... n - 1.

    ids : (M,) segment of each point, -1 for none.
    """
    return _hidden_sides(ids, *nearest, n)


@kernel
def _fill(points, row, image):  # type: ignore[no-untyped-def]
    """Return column and range of each point, and write the ranges into the `image`."""
    n_columns = image.shape[1]
    column, ranges = np.empty(len(points), np.int32), np.empty(len(points), np.float32)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        ranges[i] = np.sqrt(x * x + y * y + z * z)
        column[i] = int(turn_of(x, y) * np.float32(n_columns)) % n_columns
        image[row[i], column[i]] = min(image[row[i], column[i]], ranges[i])
    return column, ranges


@kernel
def _hidden_sides(ids, row, column, ranges, image, n):  # type: ignore[no-untyped-def]
    n_rows, n_columns = image.shape
    # Columns about the first point's, as a segment may lie across the end of the turn.
    start, off, ends = np.full(n, -1, np.int32), np.zeros(len(ids), np.int32), np.zeros((n, 2), np.int32)
    for i in range(len(ids)):
        s = ids[i]
        if s >= 0:
            if start[s] < 0:
                start[s] = column[i]
            off[i] = (column[i] - start[s] + n_columns + n_columns // 2) % n_columns - n_columns // 2
            ends[s, 0], ends[s, 1] = max(ends[s, 0], off[i]), min(ends[s, 1], off[i])
    seen, hidden = np.zeros((n, 2)), np.zeros((n, 2))
    for i in range(len(ids)):
        s = ids[i]
        if s < 0:
            continue
        nearer = ranges[i] - np.float32(SUPPORT) - np.float32(SUPPORT_PER_METRE) * ranges[i]
        for side in range(2):
            if abs(ends[s, side] - off[i]) >= _COLUMNS:
                continue
            step, is_behind = 1 if side == 0 else -1, False
            for k in range(1, _COLUMNS + 1):
                u = (start[s] + ends[s, side] + step * k + n_columns) % n_columns
                for v in range(max(row[i] - 1, 0), min(row[i] + 2, n_rows)):
                    is_behind |= image[v, u] < nearer
            seen[s, side] += 1.0
            hidden[s, side] += is_behind
    return hidden > 0.5 * seen
