"""Class-agnostic segments of a whole scan: what stands apart from everything else is one thing.

Seen from above, points fall into small cells; in a cell, points that follow each other without a gap in height form a
*stack*, so that a tree's crown and the car beneath it are two. Stacks of neighbouring cells join where their heights
meet. Both gaps grow with the distance between rays. One pass of union-find over a few thousand stacks: milliseconds.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from automos.settings import SegmentSettings

_BINS = 64


def segment_points(
    points: npt.NDArray,
    heights: npt.NDArray,
    ranges: npt.NDArray,
    row_height: float,
    column_width: float,
    settings: SegmentSettings,
) -> npt.NDArray[np.int32]:
    """Return (M,) int32 segment ids, 0, 1, 2 ... in the order of their first point; -1 beyond the range looked at.

    Parameters
    ----------
    points : (M, 2 or more) metres, seen from above, relative to the sensor.
    heights : (M,) metres above the ground.
    ranges : (M,) metres from the sensor.
    row_height, column_width : radians between neighbouring rays, up and sideways.
    """
    n = 2 * int(np.ceil(settings.max_range / settings.cell))
    ids = np.full(len(points), -1, np.int32)
    _segment(
        points,
        heights,
        ranges,
        np.float32(settings.cell),
        n,
        np.float32(settings.height_bin),
        np.float32(settings.gap),
        np.float32(settings.gap_columns * column_width),
        np.float32(settings.height_gap),
        np.float32(settings.height_gap_rows * row_height),
        ids,
    )
    return ids


@numba.njit(cache=True, nogil=True)
def _root(parent, i):  # type: ignore[no-untyped-def]
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@numba.njit(cache=True, nogil=True)
def _segment(  # type: ignore[no-untyped-def]
    points, heights, ranges, cell, n, height_bin, gap, gap_per_metre, height_gap, height_gap_per_metre, ids
):
    # Which height bins of which cells hold points.
    m = len(points)
    cell_of = np.full(m, -1, np.int32)
    bin_of = np.empty(m, np.int64)
    slot_of_cell = np.full(n * n, -1, np.int32)
    cells = np.empty(m, np.int32)
    masks = np.zeros(m, np.uint64)
    reach = np.empty(m, np.float32)
    n_cells = 0
    for i in range(m):
        u = int(np.floor(points[i, 0] / cell)) + n // 2
        v = int(np.floor(points[i, 1] / cell)) + n // 2
        if not (0 <= u < n and 0 <= v < n):
            continue
        c = v * n + u
        slot = slot_of_cell[c]
        if slot < 0:
            slot = n_cells
            slot_of_cell[c] = slot
            cells[slot] = c
            reach[slot] = ranges[i]
            n_cells += 1
        b = min(max(int(heights[i] / height_bin), 0), 63)
        cell_of[i], bin_of[i] = slot, b
        masks[slot] |= np.uint64(1) << np.uint64(b)
    # Stacks: runs of bins without too large a gap.
    first = np.empty(n_cells + 1, np.int32)
    low, high = np.empty(m, np.int64), np.empty(m, np.int64)
    n_stacks = 0
    for slot in range(n_cells):
        first[slot] = n_stacks
        allowed = int((height_gap + height_gap_per_metre * reach[slot]) / height_bin) + 1
        mask = masks[slot]
        last = -1000
        for b in range(64):
            if (mask >> np.uint64(b)) & np.uint64(1):
                if b - last > allowed:
                    low[n_stacks] = b
                    n_stacks += 1
                high[n_stacks - 1] = b
                last = b
    first[n_cells] = n_stacks
    parent = np.arange(n_stacks)
    for slot in range(n_cells):
        c = cells[slot]
        u, v = c % n, c // n
        allowed = int((height_gap + height_gap_per_metre * reach[slot]) / height_bin) + 1
        radius = max(gap, gap_per_metre * reach[slot]) / cell
        k = int(radius)
        for dv in range(0, k + 1):
            for du in range(-k if dv > 0 else 1, k + 1):
                if du * du + dv * dv > radius * radius:
                    continue
                a, b = u + du, v + dv
                if not (0 <= a < n and b < n):
                    continue
                other = slot_of_cell[b * n + a]
                if other < 0:
                    continue
                for s in range(first[slot], first[slot + 1]):
                    for t in range(first[other], first[other + 1]):
                        if low[s] - high[t] <= allowed and low[t] - high[s] <= allowed:
                            ra, rb = _root(parent, s), _root(parent, t)
                            if ra != rb:
                                parent[max(ra, rb)] = min(ra, rb)
    # Number the segments and write them back.
    number = np.full(n_stacks, -1, np.int32)
    n_segments = 0
    for i in range(m):
        slot = cell_of[i]
        if slot < 0:
            continue
        s = first[slot]
        while high[s] < bin_of[i]:
            s += 1
        root = _root(parent, s)
        if number[root] < 0:
            number[root] = n_segments
            n_segments += 1
        ids[i] = number[root]
