"""Whole boxes of moving bodies: heading from motion, extent from what a body showed over its life, one smoother.

A sensor sees the sides that face it. The heading is the direction of motion while a body moves, and is kept while it
stands. In that heading, the points of every scan span an interval along, across and above; the greatest of them over
the body's life are its extent, and the face towards the sensor says where the body is at that moment.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.parallel import map_in_order
from automos.core.scan import Frames, Mask
from automos.core.stages import Stage
from automos.core.upright_boxes import Boxes
from automos.objects.kinds import whole_extent
from automos.objects.motion import NOISE, smooth_paths, ways_around
from automos.objects.object_points import tracks_of_points
from automos.objects.tracks import Tracks

Rows = npt.NDArray[np.int64]
SURE = 3.0  # standard deviations from which on a direction is told, or two disagree
SIDE = 0.2  # metres, standard deviation of the end of a side about the other
SHOWN = 0.9  # quantile of the intervals of all scans that is the extent: single scans are joined with others' points
ROUNDS = 2  # the heading needs centres, the centres a heading
ASKEW = 0.5  # sine of the angle to the line of sight, from which on a body's end is at its left or right side


@dataclass(frozen=True, eq=False)
class Scans:
    """The scans of a recording, their names, and the results of the earlier stages."""

    frames: Frames
    names: list[str]
    candidates: Stage
    instances: Stage


class Intervals(NamedTuple):
    """What bodies show in each row of a table, about the centre of its box; NaN where there are no points."""

    low: Array  # (R, 3) metres, ends of the points along, across and above the box
    high: Array  # (R, 3) metres
    origin: Array  # (R, 3) metres, place of the sensor in these coordinates
    hidden: npt.NDArray[np.bool_]  # (R, 2) whether something nearer hides what is left and right of the points


def make_whole(
    tracks: Tracks,
    is_moving: Mask,
    stamps: Array,
    own: Callable[[Tracks], Boxes],
    shown: Callable[[Tracks, Boxes], Intervals],
) -> None:
    """Give what moves (T,) whole boxes and velocities, in place; the others stay as they are, at rest.

    Parameters
    ----------
    stamps : (N,) seconds.
    own : returns the boxes of the segments of rows, NaN where there is none.
    shown : returns what bodies show in rows, of which the second argument is `own`.
    """
    rows = np.flatnonzero(is_moving[tracks.track])
    whole = _whole_boxes(tracks[rows], stamps, own, shown)
    tracks.velocity[:] = 0.0
    for column in ("center", "size", "yaw", "velocity"):
        getattr(tracks, column)[rows] = getattr(whole, column)


def _whole_boxes(
    body: Tracks, stamps: Array, own: Callable[[Tracks], Boxes], shown: Callable[[Tracks, Boxes], Intervals]
) -> Tracks:
    """Return the rows of bodies with their whole boxes and velocities; see `make_whole`."""
    first = np.append(np.flatnonzero(np.diff(body.track, prepend=-1)), len(body.track))
    times, boxes = stamps[body.scan], own(body)
    measured, yaw, length = boxes.center, np.nan_to_num(boxes.yaw), np.nan_to_num(boxes.size[:, 0])
    for _ in range(ROUNDS):
        body = _along(body, first, times, measured, yaw, length)
        seen = shown(body, boxes)
        body = replace(body, size=extents(first, seen.low, seen.high))
        measured = centers(body, seen)
    # What is added to what a body showed lies behind it: its place there changes with the place of the sensor.
    speed = np.hypot(*body.velocity[:, :2].T)
    fastest = _usual(first, speed)
    is_whole = shown_whole(first, body.size, seen)
    size = whole_extent(body.size[first[:-1]], is_whole, fastest)
    whole = replace(body, size=np.repeat(size, np.diff(first), axis=0))
    behind = centers(whole, seen) - measured
    body = _along(body, first, times, measured, yaw, length)
    return replace(body, size=whole.size, center=body.center + smooth_paths(first, times, behind)[0])


def _along(body: Tracks, first: Rows, times: Array, measured: Array, yaw: Array, length: Array) -> Tracks:
    """Return the rows of bodies on smooth paths through the `measured` centres (R, 3)."""
    path, velocity, _ = smooth_paths(first, times, measured)
    heading = headings(first, times, path, yaw, length)
    return replace(body, center=path, yaw=heading, velocity=velocity)


def headings(first: Rows, times: Array, path: Array, yaw: Array, length: Array) -> Array:
    """Return (R,) radians: directions of motion, kept while a body stands, and corrected by the sides that it shows.

    A long side says the direction better than the motion does, but not which of four it is; while a long body stands,
    all say so together. A body that has gone less than half of its own length, or no more than its centre is off, has
    the direction of its long side that is nearest to its way.

    path : (R, 3) metres, smooth.   yaw, length : (R,) radians and metres, of boxes about single segments; length 0
    where there is none.
    """
    body = np.repeat(np.arange(len(first) - 1), np.diff(first))
    half = 0.5 * np.nan_to_num(_usual(first, np.where(length > 0.0, length, np.nan)))[body]
    ways = ways_around(first, times, path, half) @ (1.0, 1.0j)
    out, least = np.angle(ways), SURE * NOISE
    is_told = (np.abs(ways) > np.maximum(half, least)) & (
        np.hypot(*ways_around(first, times, path, 0.0 * half).T) > least
    )
    same = np.arange(len(ways))  # row whose direction is kept
    for begin, end in pairwise(first):
        told = begin + np.flatnonzero(is_told[begin:end])
        if len(told):
            same[begin:end] = told[np.searchsorted(0.5 * (times[told][1:] + times[told][:-1]), times[begin:end])]
            out[begin:end] = out[same[begin:end]]
        else:
            side = 0.5 * np.angle(length[begin:end] @ np.exp(2j * yaw[begin:end]))
            way = np.angle((path[end - 1, :2] - path[begin, :2]) @ (1.0, 1.0j))
            out[begin:end], same[begin:end] = side + np.pi * np.round((way - side) / np.pi), begin
    _, stay = np.unique(np.where(is_told, -1 - np.arange(len(ways)), same), return_inverse=True)
    long, n = np.bincount(stay, length)[stay], np.bincount(stay, length > 0.0)[stay]
    sides = length * np.exp(4j * (yaw - out))
    off = 0.25 * np.angle(np.bincount(stay, sides.real) + 1j * np.bincount(stay, sides.imag))[stay]
    of_motion = NOISE / np.maximum(np.abs(ways[same]), least)
    of_side = SIDE * np.sqrt(n) / np.maximum(long, 1e-6)
    agree = (~is_told & (half > least)) | (np.abs(off) < SURE * np.hypot(of_motion, of_side))
    return out + np.where(agree, off * of_motion**2 / (of_motion**2 + of_side**2), 0.0)


def shown_intervals(tracks: Tracks, scans: Scans, parts: Tracks, workers: int) -> Intervals:
    """Return what the points of each row show, those of all its `parts`."""
    rows_of, parts_of = tracks.rows_by_scan(len(scans.names)), parts.rows_by_scan(len(scans.names))
    out, hidden = np.full((3, len(tracks.track), 3), np.nan), np.zeros((len(tracks.track), 2), np.bool_)

    def look(i: int) -> None:
        frame, about = scans.frames[i], scans.instances.load(scans.names[i], "ids", "stayed", "hidden")
        owner = tracks_of_points(about["ids"], about["stayed"], parts[parts_of[i]])
        segment = np.where(about["ids"] >= 0, about["ids"], about["stayed"])
        mine = np.flatnonzero(owner >= 0)
        mine = mine[np.argsort(owner[mine], kind="stable")]
        begins = np.searchsorted(owner[mine], tracks.track[rows_of[i]])
        ends = np.searchsorted(owner[mine], tracks.track[rows_of[i]], side="right")
        for row, begin, end in zip(rows_of[i], begins, ends, strict=True):
            if end > begin:
                own = mine[begin:end]
                points = np.vstack([frame.points_level[own], frame.origin_level])
                local = _turned(points - tracks.center[row], -tracks.yaw[row])
                out[0, row], out[1, row], out[2, row] = local[:-1].min(axis=0), local[:-1].max(axis=0), local[-1]
                turn = local[:-1, :2] @ _to_the_left(local[:-1, :2].mean(axis=0) - local[-1, :2])
                for side, at in enumerate((turn.argmax(), turn.argmin())):
                    hidden[row, side] = about["hidden"][segment[own[at]], side]

    asked = [i for i in range(len(scans.names)) if len(parts_of[i])]
    for _ in map_in_order(look, asked, workers, threads=True):
        pass
    return Intervals(out[0], out[1], out[2], hidden)


def boxed_intervals(tracks: Tracks, own: Boxes, origin: Array, hidden: npt.NDArray[np.bool_]) -> Intervals:
    """Return what the segments of all rows show, of which only the boxes are known.

    origin : (N, 3) metres, the place of the sensor in each scan.   hidden : (R, 2) see `Intervals`.
    """
    c, s = np.abs(np.cos(own.yaw - tracks.yaw)), np.abs(np.sin(own.yaw - tracks.yaw))
    length, width, height = 0.5 * own.size.T
    half = np.stack([c * length + s * width, s * length + c * width, height], axis=-1)
    center = _turned(own.center - tracks.center, -tracks.yaw)
    local = _turned(origin[tracks.scan] - tracks.center, -tracks.yaw)
    return Intervals(center - half, center + half, local, hidden)


def extents(first: Rows, low: Array, high: Array) -> Array:
    """Return (R, 3) what each row's body showed of its extent, from its intervals in all scans."""
    shown = np.column_stack([_usual(first, axis) for axis in (high - low).T])
    return np.repeat(np.nan_to_num(shown), np.diff(first), axis=0)


def _usual(first: Rows, values: Array) -> Array:
    """Return (T,) the quantile `SHOWN` of the `values` (R,) of each body, of those that are finite; NaN without any."""
    body = np.repeat(np.arange(len(first) - 1), np.diff(first))
    ordered = np.append(values[np.lexsort((values, body))], np.nan)  # NaN comes last
    n = np.bincount(body[np.isfinite(values)], minlength=len(first) - 1)
    at = SHOWN * np.maximum(n - 1, 0)
    below, above = np.floor(at).astype(int), np.ceil(at).astype(int)
    between = ordered[first[:-1] + below] * (1.0 - (at - below)) + ordered[first[:-1] + above] * (at - below)
    return np.where(n > 0, between, np.nan)


def centers(tracks: Tracks, seen: Intervals) -> Array:
    """Return (R, 3) the centres of the boxes whose faces towards the sensor, and whose tops, are those seen.

    What is seen of a body behind something nearer ends where that does; its other end is its own.
    """
    low, high, origin, _ = seen
    half, middle = 0.5 * tracks.size, 0.5 * (low + high)
    from_high, from_low = origin > high, origin < low
    from_high[:, 2], from_low[:, 2] = True, False  # the ground hides what is low
    _, is_low_hidden, is_high_hidden = _sides(seen)
    from_high[:, :2] = (from_high[:, :2] | is_low_hidden) & ~is_high_hidden
    from_low[:, :2] = (from_low[:, :2] | is_high_hidden) & ~is_low_hidden
    is_short = high - low < tracks.size
    center = np.where(is_short & from_high, high - half, np.where(is_short & from_low, low + half, middle))
    return tracks.center + _turned(center, tracks.yaw)


def shown_whole(first: Rows, size: Array, seen: Intervals) -> Mask:
    """Return (T, 3) whether bodies showed both ends where they showed most: from aside, and nothing nearer hid one.

    Of a car seen from behind, the front is out of sight; how high it stands above the ground is never seen.
    """
    is_aside, is_low_hidden, is_high_hidden = _sides(seen)
    is_seen = np.column_stack([is_aside & ~is_low_hidden & ~is_high_hidden, np.zeros(len(size), np.bool_)])
    is_greatest = seen.high - seen.low >= size - 1e-6
    n = np.add.reduceat(is_greatest, first[:-1], axis=0, dtype=np.int64)
    return 2 * np.add.reduceat(is_greatest & is_seen, first[:-1], axis=0, dtype=np.int64) > n


def _sides(seen: Intervals) -> tuple[Mask, Mask, Mask]:
    """Return (R, 2) whether bodies are seen from beside each axis, and whether its low and its high end are hidden."""
    low, high, origin, hidden = seen
    left = _to_the_left(0.5 * (low + high)[:, :2] - origin[:, :2])
    is_low_hidden = hidden[:, :1] & (left < -ASKEW) | hidden[:, 1:] & (left > ASKEW)
    is_high_hidden = hidden[:, :1] & (left > ASKEW) | hidden[:, 1:] & (left < -ASKEW)
    return np.abs(left) > ASKEW, is_low_hidden, is_high_hidden


def _to_the_left(away: Array) -> Array:
    """Return (..., 2) the unit vectors to the left of the lines of sight `away` (..., 2)."""
    return np.stack([-away[..., 1], away[..., 0]], axis=-1) / np.hypot(away[..., :1], away[..., 1:]).clip(1e-6)


def _turned(points: Array, angle: npt.ArrayLike) -> Array:
    """Return `points` (N, 3) turned about the vertical by `angle`, radians, one or (N,)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = points.T
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)
