"""Point times from the order of a scan's points.

Drivers append points as the sensor fires: the azimuth advances along the file, and this advance is the time, wherever
the driver cut its stream. It is measured on blocks of neighbouring points, since beams have azimuth offsets. Files that
are shuffled or sorted otherwise, such as by beam, give no times: there, the azimuth and its seam do (`drifting_seam`).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.arrays import evenly_spread, some_of
from automos.core.geometry import Array
from automos.core.kernels import kernel
from automos.core.scan import MIN_RANGE, Mask, Points, Scan, Sequence

N_BLOCKS = 180
"""Blocks of a scan, of about two degrees: small enough for the time of a point, large enough for several firings of
every beam, so that their azimuth offsets average out."""
SAMPLES = 5
"""Scans, or pairs of neighbouring ones, from which it is learnt how a recording was made."""
SECTORS, ALL_ROUND = 36, 30
"""Sectors of azimuth, and in how many a sensor that spins about its z axis has points."""
NEARLY_ALL = 0.9
"""Share of blocks that must advance in the overall direction, of points on which two timings must agree, and length of
the mean direction within a block, at least: 1 if all azimuths agree, 0 if the file is shuffled."""
SAME_TIME = 0.02
"""Share of the time between scans by which two consistent timings of a point may differ; and turns by which a fixed
start may drift from one scan to the next, or a scan may be more or less than one, before the motion on which raw scans
agree is clearly wrong."""
NOISE = 0.1
"""Turns by which a block may lie behind the previous one (noise of points near the axis); more is a gap ahead."""
MOST_TURNS = 3.0
"""Turns in a scan, at most: more is a file sorted by beam."""


@dataclass(frozen=True)
class PointOrder:
    """How the azimuth advances along the files of a recording."""

    turn: int  # +1 counter-clockwise seen from the sensor's +z, -1 clockwise
    turns: float  # from a scan's first point to its last
    turns_per_scan: float  # from one scan's first point to that of the next
    start: float | None = None  # azimuth in turns at which all scans begin; None if it drifts from scan to scan

    @property
    def span(self) -> float:
        """Turns from the beginning of a scan to its end, with or without returns there."""
        return max(self.turns, self.turns_per_scan)


def learn_order(sequence: Sequence) -> PointOrder | None:
    """Return how the azimuth advances along the files of `sequence`; None if the order gives no times."""
    firsts = sample_pairs(sequence)
    found: list[tuple[int, float, float, float]] = []
    for n_seen, i in enumerate(firsts):
        if n_seen - len(found) >= len(firsts) / 2:  # a majority is no longer possible
            return None
        first = _read(sequence[i])
        second = None if first is None else _read(sequence[i + 1])
        if first is not None and second is not None and first[0] == second[0]:
            found.append((*first, second[1]))
    if 2 * len(found) <= len(firsts):
        return None
    turn = max((-1, 1), key=[f[0] for f in found].count)
    start, span, next_start = np.array([f[1:] for f in found if f[0] == turn]).T
    turns, drift = float(np.median(span)), turn * (next_start - start)
    # The seam drifts by the turns per scan modulo whole turns: add as many as bring it closest to the span of a scan.
    whole = np.round(turns - drift)
    whole += drift + whole < 0.5 * turns  # a narrow field of view still takes one turn
    per_scan = float(np.median(drift + whole))
    mean = np.exp(2j * np.pi * start).mean()
    is_fixed = np.abs(mean) > NEARLY_ALL and abs(per_scan - round(per_scan)) < SAME_TIME
    return PointOrder(turn, turns, per_scan, float(np.angle(mean) / (2.0 * np.pi)) if is_fixed else None)


def sample_pairs(sequence: Sequence) -> list[int]:
    """Return the indices of a few scans, each followed by another."""
    return some_of(len(sequence) - 1, SAMPLES).tolist()


def sees_all_round(sequence: Sequence) -> bool:
    """Whether scans have points at nearly all azimuths, as from a sensor that spins about its z axis."""
    seen = (azimuths(sequence[i].points)[1] for i in evenly_spread(range(len(sequence)), SAMPLES))
    return max(len(np.unique(np.floor(SECTORS * turns))) for turns in seen) >= ALL_ROUND


def azimuths(points: Points) -> tuple[Mask, Array]:
    """Return which of `points` (N, 3) are seen in a direction, and the azimuths of these in turns, in [-0.5, 0.5]."""
    x, y = points[:, :2].astype(np.float64).T
    is_seen = (x * x + y * y > MIN_RANGE**2) & (x * x + y * y < 1e12)  # never true of NaN
    return is_seen, np.arctan2(y[is_seen], x[is_seen]) / (2.0 * np.pi)


def turns_since_start(scan: Scan, order: PointOrder) -> npt.NDArray[np.float32]:
    """Return (N,) float32 turns of the sensor between the scan's first point and each point.

    Invalid points have the turns of their neighbours.
    """
    block = max(len(scan) // N_BLOCKS, 1)
    azimuth, _ = _block_azimuths(scan.points, block)
    turned = _at_points(_unwrap(azimuth, order.turn), block, len(scan))
    _follow_gaps(scan.points, azimuth, order.turn, block, turned)
    first = np.flatnonzero(np.isfinite(azimuth))[:1]
    if order.start is None or len(first) == 0:
        return turned
    # If all scans begin at the same azimuth, a scan that begins later has lost its first points.
    late = order.turn * (azimuth[first[0]] - order.start) - turned[min(first[0] * block + block // 2, len(scan) - 1)]
    return np.maximum(turned + np.float32(late - round(late)), np.float32(0.0))


def _read(scan: Scan) -> tuple[int, float, float] | None:
    """Return a scan's direction of rotation, its first azimuth and its span (both in turns)."""
    block = max(len(scan) // N_BLOCKS, 1)
    azimuth, concentration = _block_azimuths(scan.points, block)
    is_known = np.isfinite(azimuth)
    if is_known.sum() < 10:
        return None
    steps = np.diff(azimuth[is_known]) - np.round(np.diff(azimuth[is_known]))
    turn = 1 if steps.sum() > 0.0 else -1
    if np.median(concentration[is_known]) > NEARLY_ALL and np.mean(turn * steps > 0.0) > NEARLY_ALL:
        whole = _at_points(_unwrap(azimuth, turn), block, len(scan))
        if whole[-1] < MOST_TURNS:
            first = azimuth[is_known][0] - turn * whole[np.flatnonzero(is_known)[0] * block + block // 2]
            return turn, float(first % 1.0), float(whole[-1])
    return None


def _unwrap(azimuth: Array, turn: int) -> Array:
    """Return the turns of each block since the first; gaps are crossed in the direction of rotation."""
    out, is_known = np.full(len(azimuth), np.nan), np.isfinite(azimuth)
    if is_known.any():
        steps = turn * np.diff(azimuth[is_known], prepend=azimuth[is_known][0])
        out[is_known] = np.cumsum(steps - np.floor(steps + NOISE))
    return out


def _at_points(turned: Array, block: int, n: int) -> npt.NDArray[np.float32]:
    """Return (n,) float32 turns of every point, interpolated between the middles of blocks, 0 at the first point."""
    known = np.flatnonzero(np.isfinite(turned))
    if len(known) < 2:
        return np.zeros(n, np.float32)
    at, turns = known[[0, *range(len(known)), -1]].astype(float), turned[known[[0, *range(len(known)), -1]]]
    at[[0, -1]] = -1.0, len(turned)  # extrapolated beyond the first and the last middle
    for end, near, next_one in ((0, 1, 2), (-1, -2, -3)):
        turns[end] += (turns[near] - turns[next_one]) * (at[end] - at[near]) / (at[near] - at[next_one])
    out = np.interp((np.arange(n) - 0.5 * (block - 1)) / block, at, turns)
    return np.maximum(out - out[0], 0.0).astype(np.float32)


def _follow_gaps(points: Points, azimuth: Array, turn: int, block: int, turned: npt.NDArray[np.float32]) -> None:
    """Correct `turned` by the azimuth of each point in blocks that span a sector without points."""
    known = np.flatnonzero(np.isfinite(azimuth))
    if len(known) < 3:
        return
    steps, is_torn = np.diff(_unwrap(azimuth, turn)[known]), np.zeros(len(azimuth), bool)
    for k in np.flatnonzero(steps > 2.0 * np.median(steps)).tolist():
        is_torn[known[k] : known[k + 1] + 1] = True
    rows = np.flatnonzero(np.repeat(is_torn, block)[: len(points)])
    is_seen, own = azimuths(points[rows])
    rows = rows[is_seen]
    start = azimuth[known[0]] - turn * turned[known[0] * block + block // 2]  # azimuth of the first point
    off = turn * (own - start) - turned[rows]
    turned[rows] = np.maximum(turned[rows] + off - np.rint(off), 0.0)


@kernel
def _block_azimuths(points, block):  # type: ignore[no-untyped-def]
    """Return the mean azimuth in turns of every `block` points, NaN if none is valid, and their concentration."""
    n_blocks = (len(points) + block - 1) // block
    azimuth, agreement = np.full(n_blocks, np.nan), np.zeros(n_blocks)
    for b in range(n_blocks):
        sx, sy, n = 0.0, 0.0, 0
        for i in range(b * block, min((b + 1) * block, len(points))):
            x, y = float(points[i, 0]), float(points[i, 1])
            r = np.sqrt(x * x + y * y)
            if MIN_RANGE < r < 1e6:  # never true of NaN
                sx += x / r
                sy += y / r
                n += 1
        if n > 0:
            azimuth[b] = np.arctan2(sy, sx) / (2.0 * np.pi)
            agreement[b] = np.sqrt(sx * sx + sy * sy) / n
    return azimuth, agreement
