"""Points in clouds of dust, smoke or spray, and in thick leaves: rays end there at random depths, on no surface.

On a surface, a ray's neighbours to both sides (left and right, or above and below) end beside it, even at grazing
incidence and along edges. In a cloud they seldom do. Such points belong to no object: a car that drives through dust
would be one segment with it, as large as the cloud, of which no motion can be seen. Nor do they report on the places of
other scans' points: where dust was, a car may pass at any time, and what is behind is observed between them.
"""

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel
from automos.core.scan import Mask, Points

MAX_BETWEEN = 0.3
"""Share of a cell's points that are between two neighbours, up to which the cell is in a cloud. In simulated streets,
most of the dust is in such cells, and hardly anything solid but what is seen through windows."""
MIN_POINTS = 50
"""Points in cells of a cloud that a column holds at least: fewer are a thin object, or too far away to decide."""
_REACH, _LAYERS = 64, 16
"""Cells of a metre from the sensor to each side, and above one another; a column has twice their side. Farther away,
rays are too far apart for a cloud."""


@kernel
def in_clouds(points: Points, is_between: npt.NDArray[np.uint8], is_object: Mask) -> Mask:
    """Return (M,) which object points of a scan are in clouds.

    points : (M, 3) float, metres, sensor frame.   is_between : (M,) whether rays on both sides ended beside each.
    """
    cell_of = np.full(len(points), -1, np.int32)
    count, between = np.zeros((2, 4 * _REACH * _REACH * _LAYERS), np.int32)
    for i in range(len(points)):
        x, y, z = points[i, 0] + _REACH, points[i, 1] + _REACH, points[i, 2] + _LAYERS // 2
        if is_object[i] and 0 <= x < 2 * _REACH and 0 <= y < 2 * _REACH and 0 <= z < _LAYERS:
            cell = (int(x) * 2 * _REACH + int(y)) * _LAYERS + int(z)
            cell_of[i] = cell
            count[cell] += 1
            between[cell] += is_between[i] != 0
    hazy, solid = np.zeros((2, _REACH, _REACH), np.int32)
    for i in range(len(points)):
        if cell_of[i] >= 0:
            x, y = _column_of(cell_of[i])
            is_hazy = between[cell_of[i]] <= MAX_BETWEEN * count[cell_of[i]]
            hazy[x, y] += is_hazy
            solid[x, y] += not is_hazy
    is_cloud = np.zeros((_REACH, _REACH), np.bool_)
    for x in range(_REACH):
        for y in range(_REACH):
            if hazy[x, y] >= MIN_POINTS:
                around = (slice(max(x - 1, 0), x + 2), slice(max(y - 1, 0), y + 2))
                # What is seen through a car's windows is like a cloud, but there is less of it than of the car.
                is_cloud[x, y] = hazy[around].sum() > 0.5 * solid[around].sum()
    is_in_cloud = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        if cell_of[i] >= 0 and between[cell_of[i]] <= MAX_BETWEEN * count[cell_of[i]]:
            is_in_cloud[i] = is_cloud[_column_of(cell_of[i])]
    return is_in_cloud


@kernel
def _column_of(cell):  # type: ignore[no-untyped-def]
    x, y = cell // _LAYERS // (2 * _REACH), cell // _LAYERS % (2 * _REACH)
    return x // 2, y // 2
