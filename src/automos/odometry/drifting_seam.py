"""The azimuth seam of each scan, if the stream was cut by time and the order of its points is lost.

A scan of less than a turn misses a sector, a scan of more than a turn contains a sector twice. The next scan starts
where this one ends, so the sector drifts by its own width, which reveals the direction of rotation and the turns per
scan. A doubled sector has twice the points in each direction that returns any, whatever the scene.
"""

import numpy as np
import numpy.typing as npt

from automos.core.cells import turn_of
from automos.core.kernels import kernel
from automos.core.scan import MIN_RANGE, Mask, Points, Sequence
from automos.odometry.point_order import SAME_TIME, azimuths, sample_pairs

N_SECTORS = 360
"""Sectors in which points are counted, and bins of the sine of their elevation: a degree holds several firings of every
beam and is accurate enough."""
MIN_EXPLAINED = 0.6
"""Share of the variance of points per direction that a sector must explain: doubled 0.7 to 0.95, others 0.1 to 0.5."""
SAME_WIDTH = 0.3
"""Share of its width by which the drift of a sector may differ from its width."""
STAGGER = 0.03
"""Turns by which the drift may also be greater: azimuth offsets of beams, up to five degrees, blur the edges."""


def learn_drifting_seam(sequence: Sequence) -> tuple[int, float] | None:
    """Return the direction of rotation (+1, -1) and the turns per scan; None if no sector drifts."""
    ids = sample_pairs(sequence)
    for edges, sign in ((gap_edges, -1), (doubled_edges, 1)):
        steps = [_step(edges(sequence[i].points), edges(sequence[i + 1].points), sign) for i in ids]
        turn = max((-1, 0, 1), key=[np.sign(step) for step in steps].count) if steps else 0
        if turn:
            return turn, 1.0 + sign * float(np.median([abs(step) for step in steps if np.sign(step) == turn]))
    return None


def _step(edges: tuple[float, float], following: tuple[float, float], sign: int) -> float:
    """Return the turns by which a sector drifts to the next scan, positive counter-clockwise; 0 if not by its width.

    `sign` is 1 for a doubled sector, which drifts in the direction of rotation, -1 for a missing one, which drifts
    against it. The returned step is that of the sensor.
    """
    width = 0.5 * (edges[1] - edges[0] + following[1] - following[0])
    if not SAME_TIME < width < 1.0:
        return 0.0
    shift = 0.5 * (following[0] + following[1] - edges[0] - edges[1])
    allowed = SAME_WIDTH * min(width, 1.0 - width)
    for turn in (1, -1):
        step = sign * turn * shift
        step -= round(step - width)  # of the equivalent steps on the circle, the one closest to the width
        if -allowed < step - width < allowed + STAGGER:
            return turn * step
    return 0.0


def drifting_times(points: Points, turn: int, turns: float) -> tuple[npt.NDArray[np.float32], Mask]:
    """Return when `points` (N, 3) were measured in a scan of `turns` with any seam, and which may be a turn later.

    The (N,) times are in [-0.5, 0.5] of the scan, the earlier of two where a point may have either.
    """
    points = np.ascontiguousarray(points)
    low, high = gap_edges(points) if turns <= 1.0 else doubled_edges(points, turns - 1.0)
    middle, width = 0.5 * (low + high), max(high - low, abs(turns - 1.0))
    if turns <= 1.0:  # from one edge of the gap to the other
        turned, span = turns_from(points, turn, middle, 0.0) - np.float32(0.5 * width), 1.0 - width
        return np.clip(turned / np.float32(span), 0.0, 1.0) - np.float32(0.5), np.zeros(len(points), bool)
    blur = 1.0 / N_SECTORS  # accuracy of the edges
    turned, span = turns_from(points, turn, middle - turn * (0.5 * width + blur), 0.0), 1.0 + width
    times = np.maximum((turned - np.float32(blur)) / np.float32(span), 0.0) - np.float32(0.5)
    return times, turned < width + 2.0 * blur


def gap_edges(points: Points) -> tuple[float, float]:
    """Return the azimuths, in turns, between which the widest sector without points lies; the end may exceed 0.5."""
    turn = azimuths(points)[1] + 0.5
    seen = np.unique(np.minimum((turn * N_SECTORS).astype(int), N_SECTORS - 1))
    if len(seen) == 0:
        return 0.0, 0.0
    width = np.diff(np.append(seen, seen[0] + N_SECTORS))
    k = int(np.argmax(width))
    return float((seen[k] + 1) / N_SECTORS - 0.5), float((seen[k] + width[k]) / N_SECTORS - 0.5)


def doubled_edges(points: Points, width: float | None = None) -> tuple[float, float]:
    """Return the azimuths, in turns, between which the sector with the most points per direction lies.

    Its width is `width` turns, or else the one that explains most variance (0 if none explains enough). The end may
    exceed 0.5.
    """
    n, n_seen = _count_directions(np.ascontiguousarray(points))
    density = n / np.maximum(n_seen, 1)
    sums = np.concatenate([[0.0], np.cumsum(np.tile(density, 2))])
    some = range(2, N_SECTORS - 2) if width is None else [min(max(round(width * N_SECTORS), 1), N_SECTORS - 1)]
    widths = np.array(some)[:, None]
    first = np.arange(N_SECTORS)
    inside = sums[first + widths] - sums[first]
    # Between-class variance of the two parts of the circle.
    more = inside / widths - (density.sum() - inside) / (N_SECTORS - widths)
    explained = np.maximum(more, 0.0) ** 2 * widths * (N_SECTORS - widths)
    k, low = np.unravel_index(int(np.argmax(explained)), explained.shape)
    is_clear = explained[k, low] > MIN_EXPLAINED * density.var() * N_SECTORS**2
    start, length = low / N_SECTORS - 0.5, float(widths[k, 0]) / N_SECTORS
    return float(start), float(start + (length if is_clear or width is not None else 0.0))


@kernel
def _count_directions(points):  # type: ignore[no-untyped-def]
    """Return (N_SECTORS,) points in each sector, and the number of occupied elevation bins."""
    is_seen = np.zeros((N_SECTORS, N_SECTORS), np.bool_)
    n, n_seen = np.zeros(N_SECTORS, np.int64), np.zeros(N_SECTORS, np.int64)
    for i in range(len(points)):
        x, y, z = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        r = np.sqrt(x * x + y * y + z * z)
        if MIN_RANGE < r < 1e6:  # never true of NaN
            sector = min(int(turn_of(points[i, 0], points[i, 1]) * N_SECTORS), N_SECTORS - 1)
            height = min(max(int((z / r + 1.0) * (0.5 * N_SECTORS)), 0), N_SECTORS - 1)
            n[sector] += 1
            if not is_seen[sector, height]:
                is_seen[sector, height] = True
                n_seen[sector] += 1
    return n, n_seen


@kernel
def turns_from(points, turn, start, lead):  # type: ignore[no-untyped-def]
    """Return (N,) float32 turns from azimuth `start` to each point, in [0, 1), minus `lead`."""
    out = np.empty(len(points), np.float32)
    for i in range(len(points)):
        turned = turn * (turn_of(points[i, 0], points[i, 1]) - 0.5 - start)
        out[i] = turned - np.floor(turned) - lead
    return out
