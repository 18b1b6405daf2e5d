"""What one scan reports on the places of another's points (observed free, hit, or nothing), and the sum of all reports.

A place was *observed free* if the rays around it went on behind it and nothing but ground was nearer within a given
width, *weakly* if only the rays directly beside it did. It was *hit* if one of these rays ended at its range. Rays that
ended in front of it (occluded) report nothing; neither do missing returns, which have too many causes.

An object that moved came to its place and left it: its place was hit in between, and observed free before and after.
The best such interval is found for every point and weighed against "it was always there". Free-space observations of
foliage, edges and grazing surfaces do not add up, while those of a car that waited do.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.candidates.range_image import UNIT
from automos.cells import rough_turn_of, turn_of
from automos.kernels import kernel

Votes = npt.NDArray[np.int8]
UNSEEN, BLOCKED, EDGE, HIT, WEAK, THROUGH = range(6)
ONE = 64  # a full vote; votes are stored as int8 in fractions of it to save memory
_BLOCK = 512
_FAST = {"nsz", "arcp", "contract", "afn", "reassoc"}  # fast arithmetic, but for flags that assume finite numbers


@kernel
def look_through(points, T, image, tolerances):  # type: ignore[no-untyped-def]
    """Return another scan's report on the place of each point, and the range and miss of its rays.

    Parameters
    ----------
    points : (3, K) float32, contiguous.   T : (3, 4) float32, from their frame to the other sensor's at mid-sweep.
    image : RangeImage of the other scan.
    tolerances : (5,) float32, margin behind a point, its growth per metre, hit, its growth per metre, clear width.

    Returns
    -------
    codes : (K,) uint8.   ranges : (K,) float32, metres from the other sensor.
    misses : (K,) float32, metres from the point to the nearest row of rays; undefined where the code is `UNSEEN`.
    """
    margin, margin_per_metre, hit, hit_per_metre, clearance = tolerances
    pattern, pyramid, per_unit = image.pattern, image.pattern.pyramid, np.float32(1.0 / UNIT)
    h, w = pattern.n_rows, pattern.n_columns
    n_points = points.shape[1]
    codes = np.zeros(n_points, np.uint8)
    ranges, misses = np.empty(n_points, np.float32), np.empty(n_points, np.float32)
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
            misses[i] = abs(row - v - np.float32(0.5)) * np.float32(pattern.row_height) * r
            near, far = np.float32(image.around[v, u, 0]), np.float32(image.around[v, u, 1])
            if far == np.float32(0.0):
                continue
            q = r * per_unit
            behind = q + (margin + margin_per_metre * r) * per_unit
            tolerance = (hit + hit_per_metre * r) * per_unit
            if q - tolerance > far:
                codes[i] = BLOCKED
            elif q + tolerance >= near and (far - near < tolerance or _is_hit(image.rays, v, u, q, tolerance)):
                codes[i] = HIT
            elif behind >= np.float32(image.clear[v * w + u]) or not _is_surrounded(image.rays, v, u, behind):
                codes[i] = EDGE
            else:
                level = 0
                while level < len(pyramid.widths) - 1 and pyramid.widths[level] * r < clearance:
                    level += 1
                cell = (v >> pyramid.shifts[level, 0]) * pyramid.shapes[level, 1] + (u >> pyramid.shifts[level, 1])
                codes[i] = THROUGH if behind < image.clear[pyramid.offsets[level] + cell] else WEAK
    return codes, ranges, misses


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


@kernel
def weigh_looks(codes, ranges, misses, own_ranges, heights, trusts, row_height, near_miss, weak_weight):  # type: ignore[no-untyped-def]
    """Return one scan's report on each point as a vote: -ONE for a hit, up to ONE for observed free, 0 for nothing.

    A free-space observation counts less if the other sensor was more than twice as far away (its rays are sparser than
    the point's own), if no row of its rays came near the point (a parked car fits between two rows of a sparse sensor),
    and if the point is lower above the ground than two rows (a ray may have grazed the ground). A weak observation
    counts only if the other sensor was about as far away as the point's own, or farther.

    Parameters
    ----------
    codes, ranges, misses : (K,), the report as `look_through` returns it.
    own_ranges, heights : (K,) float32, metres, range from the points' own sensor and height above the ground.
    trusts : (K,) float64 in [0, 1], factor on the free-space observations of each point.
    row_height, near_miss, weak_weight : radians between rows, greatest miss for a full vote, factor on a weak one.
    """
    votes = np.zeros(len(codes), np.int8)
    for i in range(len(codes)):
        if codes[i] == HIT:
            votes[i] = -ONE
        elif codes[i] == THROUGH or codes[i] == WEAK:
            ratio = ranges[i] / max(own_ranges[i], 1.0)
            vote = min(1.0, 2.0 / max(ratio, 1e-3)) * min(1.0, near_miss / max(misses[i], 1e-3))
            if heights[i] > -0.3:  # the ground is uncertain further below
                vote *= min(max(0.5 * heights[i] / max(row_height * ranges[i], 1e-3), 0.0), 1.0)
            if codes[i] == WEAK:
                vote *= weak_weight * min(max((ratio - 0.4) / 0.4, 0.0), 1.0)
            votes[i] = np.int8(ONE * trusts[i] * vote + 0.5)
    return votes


def sum_votes(votes: Votes, n_before: int, stay_weight: float) -> npt.NDArray[np.float32]:
    """Return (K,) the evidence that each point came and left: the votes for that, minus `stay_weight` for every hit.

    `votes` (P, K) are those of `weigh_looks`, of scans in time order, `n_before` of them before the points' own.
    """
    came_and_left = _best_sum(votes[:n_before]) + _best_sum(votes[n_before:][::-1])
    return (came_and_left / ONE - stay_weight * count_hits(votes)).astype(np.float32)


def count_hits(votes: Votes) -> npt.NDArray[np.uint8]:
    """Return (K,) the number of hits among the `votes` (P, K) on each point."""
    return (votes < 0).sum(axis=0, dtype=np.uint8)


def _best_sum(votes: Votes) -> npt.NDArray[np.int16]:
    """Return (K,) the greatest partial sum of `votes` (P, K) on each point, taken in order; at least 0."""
    total, best = np.zeros((2, votes.shape[1]), np.int16)
    for of_scan in votes:
        total += of_scan
        np.maximum(best, total, out=best)
    return best
