"""Shapes of point distributions: eigenvalues and eigenvectors of 3 x 3 covariances, compiled.

A covariance is given as its six values xx, xy, xz, yy, yz, zz.
"""

import numpy as np

from automos.core.kernels import kernel


@kernel
def variance_along(c, a):  # type: ignore[no-untyped-def]
    """Return a^T C a for the covariance `c` (6,) and the direction `a` (3,)."""
    xx, xy, xz, yy, yz, zz = c
    x = a[0] * xx + a[1] * xy + a[2] * xz
    y = a[0] * xy + a[1] * yy + a[2] * yz
    z = a[0] * xz + a[1] * yz + a[2] * zz
    return a[0] * x + a[1] * y + a[2] * z


@kernel
def total_variance(c):  # type: ignore[no-untyped-def]
    """Return the sum of the variances along all axes."""
    xx, _, _, yy, _, zz = c
    return xx + yy + zz


@kernel
def eigenvalues(c):  # type: ignore[no-untyped-def]
    """Return the eigenvalues, ascending, of a symmetric 3 x 3 matrix (xx, xy, xz, yy, yz, zz), by Viete's formula."""
    xx, xy, xz, yy, yz, zz = c
    middle = (xx + yy + zz) / 3.0
    x, y, z = xx - middle, yy - middle, zz - middle
    scale = np.sqrt((x * x + y * y + z * z + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if scale < 1e-15:
        return middle, middle, middle
    determinant = x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz)
    angle = np.arccos(min(max(0.5 * determinant / scale**3, -1.0), 1.0)) / 3.0
    high, low = middle + 2.0 * scale * np.cos(angle), middle + 2.0 * scale * np.cos(angle + 2.0 * np.pi / 3.0)
    return max(low, 0.0), max(3.0 * middle - low - high, 0.0), high


@kernel(error_model="numpy")
def eigenvector(c, value, out):  # type: ignore[no-untyped-def]
    """Write the unit eigenvector of a distinct eigenvalue: it is perpendicular to the rows of C - value."""
    xx, xy, xz, yy, yz, zz = c
    x, y, z = xx - value, yy - value, zz - value
    best = -1.0
    for k in range(3):
        if k == 0:
            a, b, d = xy * yz - xz * y, xz * xy - x * yz, x * y - xy * xy
        elif k == 1:
            a, b, d = xy * z - xz * yz, xz * xz - x * z, x * yz - xy * xz
        else:
            a, b, d = y * z - yz * yz, yz * xz - xy * z, xy * yz - y * xz
        square = a * a + b * b + d * d
        if square > best:
            best = square
            length = np.sqrt(max(square, 1e-60))
            out[0], out[1], out[2] = a / length, b / length, d / length


@kernel(error_model="numpy")
def across(c, along, first, second):  # type: ignore[no-untyped-def]
    """Write the directions of least and most variance perpendicular to `along` (not the x axis); return both."""
    length = np.sqrt(along[1] * along[1] + along[2] * along[2])
    ex, ey, ez = 0.0, along[2] / length, -along[1] / length
    fx, fy, fz = along[1] * ez - along[2] * ey, along[2] * ex - along[0] * ez, along[0] * ey - along[1] * ex
    first[0], first[1], first[2] = ex, ey, ez
    second[0], second[1], second[2] = fx, fy, fz
    a, d = variance_along(c, first), variance_along(c, second)
    first[0], first[1], first[2] = ex + fx, ey + fy, ez + fz
    b = 0.5 * (variance_along(c, first) - a - d)
    angle = 0.5 * np.arctan2(2.0 * b, a - d)
    cos, sin = np.cos(angle), np.sin(angle)
    second[0], second[1], second[2] = cos * ex + sin * fx, cos * ey + sin * fy, cos * ez + sin * fz
    first[0], first[1], first[2] = cos * fx - sin * ex, cos * fy - sin * ey, cos * fz - sin * ez
    return max(variance_along(c, first), 0.0), max(variance_along(c, second), 0.0)
