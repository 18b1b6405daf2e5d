"""Segments of one scan, cut by the evidence of motion (the `default` preset's instances).

The whole non-ground scan is segmented, so that parts of an object that were not observed free (a roof, the middle of a
long side) belong to it. A segment with consistent evidence is one object. A segment with both moved and stayed points
(a pedestrian beside a wall) is cut: stayed points are removed and the rest is segmented again. Unknown points of a wall
may outvote those of a person beside it, so from walls pieces are cut by the nearest known points, too. The stayed
segment is also kept as a whole: a car that drives away has stayed for as long as it was parked, which only its track
can reveal.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from automos.core.kernels import kernel
from automos.core.scan import Mask
from automos.objects.boxes import fit_boxes
from automos.objects.detections import Detections
from automos.objects.kinds import EXTENT, Kind
from automos.objects.occlusion import Nearest, hidden_sides, nearest_points
from automos.objects.outlines import outlines
from automos.objects.segments import segment_points
from automos.settings import DetectSettings

Ids = npt.NDArray[np.int32]
SILENCE = 0.2  # share of stayed points up to which a segment is unknown instead of static


class ScanPoints(NamedTuple):
    """The points of one scan that are neither ground nor ego body, see `detect_objects`."""

    points: npt.NDArray
    heights: npt.NDArray[np.float32]
    solidity: npt.NDArray[np.uint8]
    has_moved: Mask
    has_stayed: Mask  # both False where unknown

    def at(self, rows: npt.NDArray[np.int64]) -> ScanPoints:
        """Return the points of `rows`."""
        return ScanPoints._make(column[rows] for column in self)


def detect_objects(
    points: npt.NDArray,
    origin: npt.NDArray,
    log_odds: npt.NDArray[np.floating],
    heights: npt.NDArray[np.float32],
    solidity: npt.NDArray[np.uint8],
    ray_steps: tuple[float, float],
    settings: DetectSettings,
) -> tuple[Ids, Ids, Detections]:
    """Return the segments of one scan's points that are neither ground nor ego body, and the evidence on every segment.

    Parameters
    ----------
    points : (M, 3) float32, metres, level frame.   origin : (3,) float64, metres, position of the sensor.
    log_odds : (M,) float, has moved, against has stayed.   heights : (M,) float32, metres above the ground.
    solidity : (M,) uint8, share of the rays beside a point that ended beside it, 255 for all.
    ray_steps : (2,) float, radians between neighbouring rays, vertically and horizontally.

    Returns
    -------
    objects : (M,) int32, segment of each point, -1 for none; objects do not overlap.
    stayed : (M,) int32, segment that has stayed as a whole, -1 for none; numbered after the objects. If such a
        segment was cut, its pieces are among the objects.
    found : Detections, all segments, objects first.
    """
    limit = settings.min_log_odds
    seen = ScanPoints(points, heights, solidity, log_odds > limit, log_odds < -limit)
    seen_from, about = points - origin.astype(np.float32), (ray_steps, settings.segments)
    ids = segment_points(seen_from, heights, *about)
    count, moved, stayed, extent, *_ = _summarise(ids, *seen)
    is_consistent = _is_consistent(count, moved, stayed, settings)
    is_compact = (count >= settings.min_points) & (extent <= settings.max_side)
    objects, n_whole = _renumbered(ids, is_compact & is_consistent, 0)

    def cut(rest: npt.NDArray[np.int64], max_side: float, n: int, least_height: float = 0.0) -> int:
        """Number pieces of the points `rest` from `n` on in `objects`; return the next free number."""
        pieces = segment_points(seen_from[rest], heights[rest], *about)
        count, moved, _, extent, _, tall, _ = _summarise(pieces, *seen.at(rest))
        is_piece = (count >= settings.min_points) & (extent <= max_side) & (moved >= 0.5 * count)
        is_piece &= tall >= least_height
        objects[rest], n = _renumbered(pieces, is_piece, n)
        return n

    n_objects = cut(np.flatnonzero((objects < 0) & (ids >= 0) & ~seen.has_stayed), settings.max_side, n_whole)
    is_wall = (extent > 2.0 * EXTENT[Kind.LARGE_VEHICLE, 0]) & (stayed >= (1.0 - 0.5 * SILENCE) * count)
    beside = _nearer_to_moved(np.append(is_wall, False)[ids] & (objects < 0), seen)
    n_objects = cut(beside, EXTENT[Kind.TWO_WHEELER, 0], n_objects, 0.25 * EXTENT[Kind.PERSON, 2])

    static, _ = _renumbered(ids, is_compact & ~is_consistent, n_objects)
    nearest = nearest_points(seen_from, ray_steps)
    sensor = float(origin[0]), float(origin[1])
    parts = [_describe(of, seen, nearest, sensor) for of in (objects, np.maximum(static - n_objects, -1))]
    parts[1].has_stayed[:] = True
    found, is_cut = Detections.concatenate(parts), (objects >= 0) & (static >= 0)
    found.part_of[objects[is_cut]] = static[is_cut]
    return objects, static, found


def recount(
    found: Detections, ids: Ids, stayed: Ids, log_odds: npt.NDArray[np.floating], settings: DetectSettings
) -> Detections:
    """Return the same segments with the counts that follow from new `log_odds` of their points.

    ids, stayed : (M,) as `detect_objects` returns them.   log_odds : (M,) has moved, against has stayed.
    """
    n_moving, n_static = np.zeros((2, len(found)))
    for part in (ids, stayed):
        n_moving += np.bincount(part[(part >= 0) & (log_odds > settings.min_log_odds)], minlength=len(found))
        n_static += np.bincount(part[(part >= 0) & (log_odds < -settings.min_log_odds)], minlength=len(found))
    is_consistent = _is_consistent(found.n_points, n_moving, n_static, settings)
    has_stayed = np.where(found.part_of >= 0, found.has_stayed, ~is_consistent)
    return replace(found, n_moving=n_moving, n_static=n_static, has_stayed=has_stayed)


def _nearer_to_moved(of: Mask, seen: ScanPoints) -> npt.NDArray[np.int64]:
    """Return the points of `of` (M,) that have moved, and of the unknown ones those whose nearest known one has."""
    is_known, has_moved = seen.has_moved | seen.has_stayed, of & seen.has_moved
    known, unknown = np.flatnonzero(of & is_known), np.flatnonzero(of & ~is_known)
    if has_moved.any() and len(unknown):
        tree = KDTree(seen.points[known], compact_nodes=False, balanced_tree=False)  # quick to make
        _, nearest = tree.query(seen.points[unknown])
        has_moved[unknown] = seen.has_moved[known[nearest]]
    return np.flatnonzero(has_moved)


def _is_consistent(count: npt.NDArray, moved: npt.NDArray, stayed: npt.NDArray, settings: DetectSettings) -> Mask:
    """Return which segments moved according to most of their known points, or have too few stayed points."""
    return (moved > 0) & (moved >= stayed) | (stayed <= SILENCE * count)


def _describe(ids: Ids, seen: ScanPoints, nearest: Nearest, sensor: tuple[float, float]) -> Detections:
    """Return the boxes, counts, lift, solidity and hidden sides of segments 0, 1, ... of `ids`."""
    count, moved, stayed, _, lift, _, solid = _summarise(ids, *seen)
    hidden = hidden_sides(ids, nearest, len(count))
    boxes = fit_boxes(seen.points, ids, np.ones(len(count)))
    outline = outlines(seen.points, ids, boxes)
    return Detections.of_objects(boxes, count, moved, stayed, lift, solid, hidden, sensor, outline)


def _renumbered(ids: Ids, is_kept: Mask, first: int) -> tuple[Ids, int]:
    """Return `ids` with kept segments numbered from `first` on and -1 for the others, and the next free number."""
    number = np.full(len(is_kept) + 1, -1, np.int32)  # the last entry is for id -1
    number[:-1][is_kept] = first + np.arange(is_kept.sum())
    return number[ids], first + int(is_kept.sum())


@kernel
def _summarise(ids, points, heights, solidity, has_moved, has_stayed):  # type: ignore[no-untyped-def]
    """Return counts of all, moved and stayed points, ground extent, lift, height (metres) and solidity of segments."""
    n = 0
    for i in range(len(ids)):
        n = max(n, ids[i] + 1)
    count, moved, stayed, solid = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    for i in range(len(ids)):
        s = ids[i]
        if s < 0:
            continue
        count[s] += 1
        moved[s] += has_moved[i]
        stayed[s] += has_stayed[i]
        solid[s] += solidity[i]
        for a in range(2):
            low[s, a] = min(low[s, a], points[i, a])
            high[s, a] = max(high[s, a], points[i, a])
        low[s, 2], high[s, 2] = min(low[s, 2], heights[i]), max(high[s, 2], heights[i])
    extent = np.empty(n)
    for s in range(n):
        extent[s] = max(high[s, 0] - low[s, 0], high[s, 1] - low[s, 1])
        solid[s] = solid[s] / 255.0 / max(count[s], 1.0)
    return count, moved, stayed, extent, low[:, 2], high[:, 2] - low[:, 2], solid
