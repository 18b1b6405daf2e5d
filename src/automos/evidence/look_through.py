"""What one scan reports on the places of another's points: observed free, hit, or nothing.

A place was *observed free* if the rays around it went on behind it and nothing but ground was nearer within a given
width, *weakly* if only the rays directly beside it did. It was *hit* if one of these rays ended at its range; if only
rays that met the ground did, that is *beneath* the place, as rows of rays are far apart. Rays that ended in front of it
(occluded) report nothing; neither do missing returns, which have too many causes.
"""

import numpy as np

from automos.core.cells import rough_turn_of, turn_of
from automos.core.kernels import kernel
from automos.core.range_image import UNIT
from automos.settings import FreeSpaceSettings

UNSEEN, BLOCKED, EDGE, BENEATH, HIT, WEAK, THROUGH = range(7)
_BLOCK = 512
_FAST = {"nsz", "arcp", "contract", "afn", "reassoc"}  # fast arithmetic, but for flags that assume finite numbers


def tolerances_of(settings: FreeSpaceSettings, doubt: tuple[float, float] = (0.0, 0.0)) -> tuple[np.float32, ...]:
    """Return the tolerances of `look_through` where poses may be off by `doubt`, metres and radians."""
    s = settings
    return tuple(np.float32(x) for x in (s.hit, s.hit_per_metre, s.clear_width, *doubt))


@kernel
def look_through(points, T, image, tolerances):  # type: ignore[no-untyped-def]
    """Return another scan's report on the place of each point, and the range to it.

    Parameters
    ----------
    points : (3, K) float32, contiguous.   T : (3, 4) float32, from their frame to the other sensor's at mid-sweep.
    image : RangeImage of the other scan.
    tolerances : (5,) float32, distance within which a ray hits a point, its growth per metre, clear width, and how much
        farther rays must go on behind, and by how much more per metre.

    Returns
    -------
    codes : (K,) uint8.   ranges : (K,) float32, metres from the other sensor.

    Equation: vote
    """
    hit, hit_per_metre, clearance, doubt, doubt_per_metre = tolerances
    pattern, pyramid, per_unit = image.pattern, image.pattern.pyramid, np.float32(1.0 / UNIT)
    h, w = pattern.n_rows, pattern.n_columns
    n_points = points.shape[1]
    codes = np.zeros(n_points, np.uint8)
    ranges = np.empty(n_points, np.float32)
    buffers, bins, columns = np.empty((5, _BLOCK), np.float32), np.empty(_BLOCK, np.int32), np.empty(_BLOCK, np.int32)
    for start in range(0, n_points, _BLOCK):
        stop = min(start + _BLOCK, n_points)
        _aim(points, start, stop - start, T, image.motion, pattern, buffers, bins, columns)
        for i in range(start, stop):
            r, row, u = buffers[3, i - start], buffers[4, i - start], columns[i - start]
            ranges[i] = r
            if not (r >= np.float32(1.0) and np.float32(0.0) <= row < h):
                continue
            v = int(row)
            near, far = np.float32(image.around[v, u, 0]), np.float32(image.around[v, u, 1])
            if far == np.float32(0.0):
                continue
            q = r * per_unit
            tolerance = (hit + hit_per_metre * r) * per_unit
            behind = q + tolerance + (doubt + doubt_per_metre * r) * per_unit
            if q - tolerance > far:
                codes[i] = BLOCKED
            elif q + tolerance >= near and (far - near < tolerance or _is_hit(image.rays, v, u, q, tolerance)):
                codes[i] = HIT if q + tolerance >= np.float32(image.clear[v * w + u]) else BENEATH
            elif behind >= np.float32(image.clear[v * w + u]) or not _is_surrounded(image.rays, v, u, behind):
                codes[i] = EDGE
            else:
                level = 0
                while level < len(pyramid.widths) - 1 and pyramid.widths[level] * r < clearance:
                    level += 1
                cell = (v >> pyramid.shifts[level, 0]) * pyramid.shapes[level, 1] + (u >> pyramid.shifts[level, 1])
                codes[i] = THROUGH if behind < image.clear[pyramid.offsets[level] + cell] else WEAK
    return codes, ranges


@kernel
def _is_hit(rays, v, u, q, tolerance):  # type: ignore[no-untyped-def]
    """Whether a ray of the 3 x 3 cells around (v, u) ended at range `q`."""
    h, w, _ = rays.shape
    for b in range(max(v - 1, 0), min(v + 2, h)):
        for a in range(u - 1, u + 2):
            a = a - w if a >= w else a  # negative columns wrap around in NumPy
            if abs(np.float32(rays[b, a, 0]) - q) < tolerance or abs(np.float32(rays[b, a, 1]) - q) < tolerance:
                return True
    return False


@kernel
def _is_surrounded(rays, v, u, q):  # type: ignore[no-untyped-def]
    """Whether rays on all four sides (or in the middle) of (v, u) went on beyond range `q`.

    Otherwise, where paint or glass returned nothing, a ray over the roof would decide for the whole car.
    """
    h, w, _ = rays.shape
    above = below = left = right = False
    n = 0
    for b in range(max(v - 1, 0), min(v + 2, h)):
        for a in range(u - 1, u + 2):
            if np.float32(rays[b, a - w if a >= w else a, 1]) > q:
                n += 1
                below |= b <= v
                above |= b >= v
                left |= a <= u
                right |= a >= u
    return n >= 4 and above and below and left and right


@kernel(fastmath=_FAST)
def _aim(points, start, n, T, motion, pattern, buffers, bins, columns):  # type: ignore[no-untyped-def]
    """Write row, column and range on the other scan's grid for `n` points from `start` on.

    Loops of arithmetic are separate from loops of table look-ups, so that the compiler can vectorise the former.
    """
    T00, T01, T02, T03 = T[0, 0], T[0, 1], T[0, 2], T[0, 3]
    T10, T11, T12, T13 = T[1, 0], T[1, 1], T[1, 2], T[1, 3]
    T20, T21, T22, T23 = T[2, 0], T[2, 1], T[2, 2], T[2, 3]
    vx, vy, vz, wx, wy, wz = motion[0], motion[1], motion[2], motion[3], motion[4], motion[5]
    xs, ys, zs, ranges, rows = buffers[0], buffers[1], buffers[2], buffers[3], buffers[4]
    px, py, pz = points[0], points[1], points[2]
    n_times, n_columns = np.float32(len(pattern.sweep_time)), np.float32(pattern.n_columns)
    n_bins = len(pattern.row_of_sine)
    half = np.float32((n_bins - 1) / 2)
    for i in range(n):
        a, b, c = px[start + i], py[start + i], pz[start + i]
        x = T00 * a + T01 * b + T02 * c + T03
        y = T10 * a + T11 * b + T12 * c + T13
        xs[i], ys[i], zs[i] = x, y, T20 * a + T21 * b + T22 * c + T23
        bins[i] = np.int32(rough_turn_of(x, y) * n_times)
    for i in range(n):
        ranges[i] = pattern.sweep_time[np.uint32(bins[i])]
    for i in range(n):  # relative to the sensor's pose when it observed this direction
        s, x, y, z = ranges[i], xs[i], ys[i], zs[i]
        nx = x - s * (vx + wy * z - wz * y)
        ny = y - s * (vy + wz * x - wx * z)
        nz = z - s * (vz + wx * y - wy * x)
        r = np.sqrt(nx * nx + ny * ny + nz * nz)
        ranges[i] = r
        at = (nz / max(r, np.float32(1e-6)) + np.float32(1.0)) * half
        bins[i] = np.int32(at) if np.float32(0.0) <= at < n_bins else np.int32(0)
        columns[i] = np.int32(turn_of(nx, ny) * n_columns)
    for i in range(n):
        rows[i] = pattern.row_of_sine[np.uint32(bins[i])]
