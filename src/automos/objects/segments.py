"""Class-agnostic segments of a whole scan: connected components of its non-ground points.

Points are sorted into small cells in the ground plane. In a cell, points without a gap in height between them form a
*stack*, so that a tree's crown and the car beneath it are separate. Stacks are connected if their heights meet and the
rectangles about the points of their cells are near enough. Both gaps grow with the spacing of the rays. Union-find over
a few thousand stacks takes milliseconds. Points deep under the ground are mirror images and are left out.
"""

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel
from automos.settings import SegmentSettings

_BINS, HEIGHT_BIN = 64, np.float32(0.1)  # bins above the ground, and metres, their height
DEPTH = 1.5  # metres below the ground: deeper points are mirror images in a window or on a wet road


def segment_points(
    points: npt.NDArray, heights: npt.NDArray, ray_steps: tuple[float, float], settings: SegmentSettings
) -> npt.NDArray[np.int32]:
    """Return (M,) int32 segment ids, 0, 1, 2 ... in the order of their first point.

    Points beyond `max_range` and mirror images below the ground have -1.

    Parameters
    ----------
    points : (M, 3) float32, metres, z up, relative to the sensor.
    heights : (M,) float32, metres above the ground.
    ray_steps : (2,) float, radians between neighbouring rays, vertically and horizontally.
    """
    s, (row_height, column_width) = settings, (np.float32(step) for step in ray_steps)
    cell, height_gap, n = np.float32(s.cell), np.float32(s.gap), 2 * int(np.ceil(s.max_range / s.cell))
    ranges = np.sqrt(np.einsum("ij,ij->i", points, points))
    slot_of, bin_of, slot_of_cell, cells, masks, reach, bounds = _fill_cells(points, heights, ranges, cell, n)
    allowed = ((height_gap + np.float32(s.gap_rays) * row_height * reach) / HEIGHT_BIN).astype(np.int64) + 1
    first, low, high = _stack(masks, allowed, len(points))
    gap = np.maximum(np.float32(s.gap), np.float32(s.gap_rays) * column_width * reach)
    root = _join(n, cells, cell, slot_of_cell, bounds, gap, allowed, first, low, high)
    return _number(slot_of, bin_of, first, high, root)


@kernel
def _root(parent, i):  # type: ignore[no-untyped-def]
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def _fill_cells(points, heights, ranges, cell, n):  # type: ignore[no-untyped-def]
    """Return slot and height bin of each point, the slot of each cell, and what is known of each slot.

    Slots are the cells that hold points, in the order in which they were found; -1 stands for none. Known are the cell,
    its occupied bins, its range, and its points' least and greatest x and y.
    """
    m, n_cells, slot_of_cell = len(points), 0, np.full(n * n, -1, np.int32)
    slot_of, bin_of = np.full(m, -1, np.int32), np.empty(m, np.int64)
    cells, masks = np.empty(m, np.int32), np.zeros(m, np.uint64)
    # Longer than the diagonal of the area, so the range is exact unless a point is far above the sensor.
    reach = np.full(m, cell * np.float32(n))
    bounds = np.empty((m, 4), np.float32)
    for i in range(m):
        x, y = points[i, 0] / cell, points[i, 1] / cell
        if not (abs(x) < n and abs(y) < n):  # compared as floats, because huge numbers overflow integers
            continue
        if heights[i] < -DEPTH:
            continue
        u, v = int(np.floor(x)) + n // 2, int(np.floor(y)) + n // 2
        if not (0 <= u < n and 0 <= v < n):
            continue
        c = v * n + u
        slot = slot_of_cell[c]
        if slot < 0:
            slot = n_cells
            slot_of_cell[c] = slot
            cells[slot] = c
            bounds[slot, 0] = bounds[slot, 1] = points[i, 0]
            bounds[slot, 2] = bounds[slot, 3] = points[i, 1]
            n_cells += 1
        for k in range(2):
            bounds[slot, 2 * k] = min(bounds[slot, 2 * k], points[i, k])
            bounds[slot, 2 * k + 1] = max(bounds[slot, 2 * k + 1], points[i, k])
        reach[slot] = min(reach[slot], ranges[i])
        steps = heights[i] / HEIGHT_BIN
        b = int(min(steps, np.float32(_BINS - 1))) if steps > 0.0 else 0
        slot_of[i], bin_of[i] = slot, b
        masks[slot] |= np.uint64(1) << np.uint64(b)
    return slot_of, bin_of, slot_of_cell, cells[:n_cells], masks[:n_cells], reach[:n_cells], bounds[:n_cells]


@kernel
def _stack(masks, allowed, most):  # type: ignore[no-untyped-def]
    """Return the stacks (runs of bins without a large gap): the start of each cell's, their lowest and highest bins."""
    n_cells = len(masks)
    first = np.empty(n_cells + 1, np.int32)
    low, high = np.empty(most, np.int64), np.empty(most, np.int64)
    n_stacks = 0
    for slot in range(n_cells):
        first[slot] = n_stacks
        last = -1
        for b in range(_BINS):
            if (masks[slot] >> np.uint64(b)) & np.uint64(1):
                if last < 0 or b - last > allowed[slot]:
                    low[n_stacks] = b
                    n_stacks += 1
                high[n_stacks - 1] = b
                last = b
    first[n_cells] = n_stacks
    return first, low[:n_stacks], high[:n_stacks]


@kernel
def _join(n, cells, cell, slot_of_cell, bounds, gap, allowed, first, low, high):  # type: ignore[no-untyped-def]
    """Return the root of each stack; stacks of cells whose points are near enough are joined if their heights meet."""
    parent = np.arange(len(low))
    for slot in range(len(cells)):
        u, v = cells[slot] % n, cells[slot] // n
        k = int(min(gap[slot] / cell + np.float32(1.0), np.float32(n)))  # limited to the grid
        for dv in range(0, min(k, n - 1 - v) + 1):
            for du in range(max(-k, -u) if dv > 0 else 1, min(k, n - 1 - u) + 1):
                other = slot_of_cell[(v + dv) * n + u + du]
                if other < 0 or _distance(bounds[slot], bounds[other]) > gap[slot]:
                    continue
                for s in range(first[slot], first[slot + 1]):
                    for t in range(first[other], first[other + 1]):
                        if low[s] - high[t] <= allowed[slot] and low[t] - high[s] <= allowed[slot]:
                            a, b = _root(parent, s), _root(parent, t)
                            parent[max(a, b)] = min(a, b)
    for s in range(len(low)):
        parent[s] = _root(parent, s)
    return parent


@kernel
def _distance(a, b):  # type: ignore[no-untyped-def]
    """Return the distance of two rectangles (4,) in the ground plane: least and greatest x, least and greatest y."""
    dx = max(b[0] - a[1], a[0] - b[1], np.float32(0.0))
    dy = max(b[2] - a[3], a[2] - b[3], np.float32(0.0))
    return np.sqrt(dx * dx + dy * dy)


@kernel
def _number(slot_of, bin_of, first, high, root):  # type: ignore[no-untyped-def]
    """Return the segment of each point, -1 for none: roots of stacks, numbered in the order of their first point."""
    ids, number, n = np.full(len(slot_of), -1, np.int32), np.full(len(root), -1, np.int32), 0
    for i in range(len(slot_of)):
        if slot_of[i] < 0:
            continue
        stack = first[slot_of[i]]
        while high[stack] < bin_of[i]:
            stack += 1
        if number[root[stack]] < 0:
            number[root[stack]] = n
            n += 1
        ids[i] = number[root[stack]]
    return ids
