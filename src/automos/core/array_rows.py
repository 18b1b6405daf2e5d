"""Arrays of three axes: is a row of one a scan, or a beam of one scan's image? Where its points lie tells.

Every scan sees the same directions, so which one a point is of says nothing of its direction. A row of an image is of
one beam, or one moment of a turn, and says all of some part of it.
"""

import numpy as np
import numpy.typing as npt

_TELLS = 0.9
"""Share of some part of the directions that rows of images tell at least, and scans leave open."""
_MOST = 256
"""Rows, and points of each, that are looked at."""


def are_scans(array: npt.NDArray) -> bool | None:
    """Return whether each row of an array (R, N, 3 or more) is a scan, or part of one; None where that is open.

    Points are x, y, z in the sensor's frame; those at the origin or not finite are none.
    """
    points = array[:: max(len(array) // _MOST, 1), :: max(array.shape[1] // _MOST, 1), :3].astype(np.float64)
    distance = np.linalg.norm(points, axis=-1)
    is_point = np.isfinite(distance) & (distance > 0.0)
    row = np.broadcast_to(np.arange(len(points))[:, None], is_point.shape)[is_point]
    ray = points[is_point] / distance[is_point, None]
    ray -= ray.mean(axis=0) if len(ray) else 0.0
    sums = np.zeros((len(points), points.shape[2]))
    np.add.at(sums, row, ray)
    means = sums / np.maximum(np.bincount(row, minlength=len(points)), 1)[:, None]
    told = np.linalg.eigvals(np.linalg.pinv(ray.T @ ray) @ (means.T @ sums)).real.max()
    return None if 1.0 - _TELLS < told < _TELLS else bool(told < _TELLS)
