"""Whole boxes of moving bodies: heading from motion, extent from what a body showed over its life, one smoother.

A sensor sees the sides that face it. The heading is the direction of motion while a body moves, and is kept while it
stands. In that heading, the points of every scan span an interval along, across and above; the greatest of them over
the body's life are its extent, and the face towards the sensor says where the body is at that moment.
"""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.scan import Mask
from automos.objects.kinds import whole_extent
from automos.objects.motion import NOISE, smooth_paths, ways_around
from automos.objects.terms import Segments
from automos.objects.tracks import Tracks, of_rows

Rows = npt.NDArray[np.int64]
SURE = 3.0  # standard deviations from which on a direction is told, or two disagree
SIDE = 0.2  # metres, standard deviation of the end of a side about the other
SHOWN = 0.9  # quantile of the intervals of all scans that is the extent: single scans are joined with others' points
FEW = 10.0  # points of which a centre is known hardly better than that they are somewhere in the body
ROUNDS = 2  # the heading needs centres, the centres a heading
ASKEW = 0.5  # sine of the angle to the line of sight, from which on a body's end is at its left or right side


class Intervals(NamedTuple):
    """What bodies show in each row of a table, about the centre of its box; NaN where there are no points."""

    low: Array  # (R, 3) metres, ends of the points along, across and above the box
    high: Array  # (R, 3) metres
    sensor: Array  # (R, 2) metres, place of the sensor in these coordinates
    hidden: npt.NDArray[np.bool_]  # (R, 2) whether something nearer hides what is left and right of the points


def make_whole(tracks: Tracks, parts: Tracks, is_moving: Mask, segments: Segments, stamps: Array) -> None:
    """Give what moves (T,) whole boxes and velocities, in place; the others stay as they are, at rest.

    parts : all segments of the tracks, sorted by track, then scan.   stamps : (N,) seconds.
    """
    rows, shown = np.flatnonzero(is_moving[tracks.track]), np.flatnonzero(is_moving[parts.track] & parts.is_observed)
    whole = _whole_boxes(tracks[rows], parts[shown], segments, stamps)
    tracks.velocity[:] = 0.0
    for column in ("center", "size", "yaw", "velocity"):
        getattr(tracks, column)[rows] = getattr(whole, column)


def _whole_boxes(body: Tracks, parts: Tracks, segments: Segments, stamps: Array) -> Tracks:
    """Return the rows of bodies with their whole boxes and velocities; see `make_whole`."""
    first = np.append(np.flatnonzero(np.diff(body.track, prepend=-1)), len(body.track))
    times, own = stamps[body.scan], segments.of(body)
    x, y, low, high = of_rows(own, segments.terms.faces).T
    side = np.nan_to_num(of_rows(own, segments.terms.side)) @ (1.0, 1.0j)
    measured, yaw, length = np.stack([x, y, 0.5 * (low + high)], axis=-1), np.angle(side), np.abs(side)
    n_points, noise = points_of(body, parts, segments), np.full(measured.shape, NOISE**2)
    for _ in range(ROUNDS):
        body = _along(body, first, times, measured, noise, yaw, length)
        seen = shown_intervals(body, parts, segments)
        body = replace(body, size=extents(first, seen.low, seen.high))
        measured, noise = centers(body, seen), variances(body, n_points)
    # What is added to what a body showed lies behind it: its place there changes with the place of the sensor.
    speed = np.hypot(*body.velocity[:, :2].T)
    fastest = _usual(first, speed)
    is_whole = shown_whole(first, body.size, seen)
    size = whole_extent(body.size[first[:-1]], is_whole, fastest)
    whole = replace(body, size=np.repeat(size, np.diff(first), axis=0))
    behind = centers(whole, seen) - measured
    body = _along(body, first, times, measured, noise, yaw, length)
    return replace(body, size=whole.size, center=body.center + smooth_paths(first, times, behind)[0])


def _along(body: Tracks, first: Rows, times: Array, measured: Array, noise: Array, yaw: Array, length: Array) -> Tracks:
    """Return the rows of bodies on smooth paths through the `measured` centres (R, 3), of variances `noise` (R, 3)."""
    path, velocity, _ = smooth_paths(first, times, measured, noise)
    heading = headings(first, times, path, yaw, length)
    return replace(body, center=path, yaw=heading, velocity=velocity)


def points_of(tracks: Tracks, parts: Tracks, segments: Segments) -> Array:
    """Return (R,) how many points all `parts` of each row have."""
    n_scans = len(segments.begins)
    row = np.searchsorted(tracks.track * n_scans + tracks.scan, parts.track * n_scans + parts.scan)
    return np.bincount(row, segments.terms.counts[segments.of(parts), 0], len(tracks.track)).astype(np.float64)


def variances(tracks: Tracks, n_points: Array) -> Array:
    """Return (R, 3) m^2 along x, y and z: how far measured centres are off, of few points as far as these may lie."""
    turn = np.abs(np.stack([np.cos(tracks.yaw), np.sin(tracks.yaw)], axis=-1))
    across = np.hypot(*(turn * tracks.size[:, 1::-1]).T)
    along = np.hypot(*(turn * tracks.size[:, :2]).T)
    sides = np.stack([along, across, tracks.size[:, 2]], axis=-1)
    return NOISE**2 + sides**2 / 12.0 / (1.0 + n_points[:, None] / FEW)


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


def shown_intervals(tracks: Tracks, parts: Tracks, segments: Segments) -> Intervals:
    """Return what the segments of each row show, those of all its `parts`, by their outlines."""
    n_scans = len(segments.begins)
    row = np.searchsorted(tracks.track * n_scans + tracks.scan, parts.track * n_scans + parts.scan)
    seen, begin, group = np.unique(row, return_index=True, return_inverse=True)
    terms = segments.terms[segments.of(parts)]
    low, high = np.full((2, len(tracks.track), 3), np.nan)
    sensor, hidden = np.full((len(tracks.track), 2), np.nan), np.zeros((len(tracks.track), 2), np.bool_)
    turn = np.exp(-1j * tracks.yaw)
    # Where a complex number is a place in the plane, a turn is a product.
    place = (terms.faces[:, :2] - tracks.center[row, :2]) @ (1.0, 1.0j)
    outline = (place[:, None] + terms.outline.astype(np.float64) @ (1.0, 1.0j)) * turn[row, None]
    ends = np.stack([outline.real, outline.imag], axis=-1)
    low[seen, :2] = np.minimum.reduceat(ends.min(axis=1), begin)
    high[seen, :2] = np.maximum.reduceat(ends.max(axis=1), begin)
    low[seen, 2] = np.minimum.reduceat(terms.faces[:, 2], begin) - tracks.center[seen, 2]
    high[seen, 2] = np.maximum.reduceat(terms.faces[:, 3], begin) - tracks.center[seen, 2]
    at = (terms.sensor[begin] - tracks.center[seen, :2]) @ (1.0, 1.0j) * turn[seen]
    sensor[seen] = np.stack([at.real, at.imag], axis=-1)
    left = _to_the_left(0.5 * (low[seen] + high[seen])[:, :2] - sensor[seen])
    across = (ends @ left[group][..., None])[..., 0]
    for side, to_left in enumerate((across.max(axis=1), -across.min(axis=1))):
        is_end = to_left == np.maximum.reduceat(to_left, begin)[group]
        hidden[seen, side] = np.logical_or.reduceat(is_end & terms.hidden[:, side], begin)
    return Intervals(low, high, sensor, hidden)


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
    low, high, sensor, _ = seen
    half, middle = 0.5 * tracks.size, 0.5 * (low + high)
    _, is_low_hidden, is_high_hidden = _sides(seen)
    from_high = ((sensor > high[:, :2]) | is_low_hidden) & ~is_high_hidden
    from_low = ((sensor < low[:, :2]) | is_high_hidden) & ~is_low_hidden
    from_high, from_low = (np.insert(of, 2, is_top, axis=1) for of, is_top in ((from_high, True), (from_low, False)))
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
    low, high, sensor, hidden = seen
    left = _to_the_left(0.5 * (low + high)[:, :2] - sensor)
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
