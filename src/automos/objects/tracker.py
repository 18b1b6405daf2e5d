"""Multi-object tracking: predict, associate, update, start and end tracks (paper III-D).

Both presets run the same loop. They differ in the cost of a pair (`association`), in the initial velocity variance, and
in how long an object may be missed. In `default`, a scan's whole segments, the pieces that the evidence cut out of them
and the segments that have stayed are alternative measurements. An object is associated with the most similar one,
whatever the evidence on it at that moment. So a car that stops, waits and drives off is one track.

While an object is missed, its position soon becomes uncertain, and it may go on as another one. Tracks of movers are
cut again where that is likely (`bodies.cut_where_two`).
"""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.scan import Mask, Pose
from automos.objects import filter as kalman
from automos.objects.association import Objects, assign, association_cost, cost_of_none, motion_cost
from automos.objects.detections import Detections
from automos.objects.tracks import Tracks
from automos.settings import TrackingSettings

Rows = npt.NDArray[np.int64]
_MEMORY = 0.7  # weight of an object's earlier evidence when it is observed again
LONGEST_STEP = 0.4
"""Seconds between scans from which on there is no tracking: a car of four metres at 10 m/s has left its place, so any
car of the lane may be associated with it. The evidence on each scan decides instead (`object_points.find_moved`)."""


class Tracker:
    """The tracked objects, advanced by one scan at a time. Copies are independent: a step modifies no array in place.

    Attribute `next_track` is the number of the next new object.
    """

    def __init__(self, settings: TrackingSettings, first_track: int = 0):
        """Start without objects; the first new one gets the number `first_track`."""
        self.next_track = first_track
        self._settings, self._scan = settings, 0
        self._alive = _start(Detections.nothing(), settings)
        self._last_stamp: float | None = None

    @property
    def numbers(self) -> Rows:
        """The numbers of all objects that may be observed again."""
        return self._alive.track

    def move(self, T_before: Pose, T: Pose, dt: float) -> None:
        """Move the objects by `T` (4, 4) of the level frame, and where they were `dt` seconds before by `T_before`."""
        mean = self._alive.mean.copy()
        was = mean[:, :3] - dt * mean[:, kalman.VELOCITY]
        mean[:, :3] = mean[:, :3] @ T[:3, :3].T + T[:3, 3]
        mean[:, kalman.YAW] += np.arctan2(T[1, 0], T[0, 0])
        mean[:, kalman.VELOCITY] = (mean[:, :3] - was @ T_before[:3, :3].T - T_before[:3, 3]) / dt
        self._alive = replace(self._alive, mean=mean)

    def step(self, stamp: float, found: Detections) -> Tracks:
        """Return one row for every object after the next scan, at `stamp` seconds, with the segments `found`."""
        settings, dt = self._settings, 0.0 if self._last_stamp is None else stamp - self._last_stamp
        alive = kalman.predict(self._alive, dt, settings.filter)
        unseen, misses = alive.unseen + dt, alive.misses + 1
        copies = {name: getattr(alive, name).copy() for name in ("share", "count", "sights")}  # they are written to
        alive = replace(alive, unseen=unseen, misses=misses, **copies)
        matched, detected = assign(*_cost(alive, found, settings))
        _update(alive, found, matched, detected, settings)
        alive = replace(alive, scans=alive.scans + 1.0)
        segment = np.full(len(alive), -1)
        segment[matched] = detected

        new = np.setdiff1d(np.arange(len(found)), detected)
        started = _start(found[new], settings)
        started.track[:] = self.next_track + np.arange(len(new))
        self.next_track += len(new)
        keep = (alive.misses <= settings.max_misses) | (alive.unseen <= settings.max_gap)
        self._alive = alive = Objects.concatenate([alive[keep], started])
        scan, boxes = np.full(len(alive), self._scan), alive.boxes()
        self._scan, self._last_stamp = self._scan + 1, stamp
        segment, velocity = np.concatenate([segment[keep], new]), alive.mean[:, kalman.VELOCITY]
        return Tracks(alive.track, scan, segment, boxes.center, boxes.size, boxes.yaw, velocity)


def track_objects(detections: Iterable[tuple[float, Detections]], settings: TrackingSettings) -> Tracks:
    """Return the tracks of all detected objects.

    A missed object is predicted by its motion model and can be associated again for a while; after that, its track
    ends at its last observation. `detections` are seconds and segments (level frame) of each scan, in time order.
    """
    tracker = Tracker(settings)
    return Tracks.concatenate(_without_last_misses(tracker.step(stamp, found) for stamp, found in detections))


def _without_last_misses(steps: Iterable[Tracks]) -> Iterator[Tracks]:
    """Yield the rows of each scan once it is known which of the objects missed in it are seen again."""
    waiting, last_seen = deque[Tracks](), np.zeros(0, np.int64)
    for rows in steps:
        waiting.append(rows)
        last_seen = np.append(last_seen, np.full(max(rows.track.max(initial=-1) + 1 - len(last_seen), 0), -1))
        last_seen[rows.track[rows.is_observed]] = rows.scan[rows.is_observed]
        while waiting and np.all(_is_until(last_seen, waiting[0]) | ~np.isin(waiting[0].track, rows.track)):
            known = waiting.popleft()
            yield known[_is_until(last_seen, known)]
    for rows in waiting:
        yield rows[_is_until(last_seen, rows)]


def until_last_seen(tracks: Tracks) -> Tracks:
    """Return the tracks without misses after the last observation of each."""
    last_seen, is_seen = np.full(len(tracks), -1), tracks.is_observed
    last_seen[tracks.track[is_seen]] = tracks.scan[is_seen]  # duplicates: the last write remains
    return tracks[_is_until(last_seen, tracks)]


def _is_until(last_seen: Rows, rows: Tracks) -> Mask:
    """Return (R,) which rows are of scans until their track (T,) was seen for the last time."""
    return rows.scan <= last_seen[rows.track]


def can_follow(stamps: Array) -> bool:
    """Return whether the rate of scans at `stamps` (N,), seconds, is high enough for tracking."""
    return len(stamps) < 2 or float(np.median(np.diff(stamps))) < LONGEST_STEP


def _start(found: Detections, settings: TrackingSettings) -> Objects:
    """Return all of `found` as new objects; what is not known to stay gets the velocity variance of traffic."""
    n, share = len(found), found.moving_share
    variance = np.full(n, settings.filter.initial_velocity_variance)
    if settings.method == "evidence":
        variance[share >= 0.5] = settings.gates.speed**2
    belief, zero = kalman.start(found.boxes, settings.filter, variance), np.zeros(n, np.int64)
    count = found.n_points.astype(np.float64)
    return Objects(belief.mean, belief.covariance, zero, np.zeros(n), zero.copy(), np.ones(n), np.ones(n), share, count)


def _cost(objects: Objects, found: Detections, settings: TrackingSettings) -> tuple[Array, Array | None]:
    """Return the (K, M) cost of each pair, and what having none costs, if it is possible."""
    if settings.method == "paper":
        return association_cost(objects.boxes(), found.boxes, settings.association), None
    return motion_cost(objects, found, settings.filter, settings.gates), cost_of_none(objects)


def _update(alive: Objects, found: Detections, matched: Rows, detected: Rows, settings: TrackingSettings) -> None:
    """Update the rows `matched` of `alive` with the rows `detected` of `found`, in place."""
    after = kalman.update(alive[matched], found.boxes[detected], settings.filter)
    alive.mean[matched], alive.covariance[matched] = after.mean, after.covariance
    alive.unseen[matched], alive.misses[matched] = 0.0, 0
    alive.sights[matched] += 1.0
    alive.share[matched] = _MEMORY * alive.share[matched] + (1.0 - _MEMORY) * found.moving_share[detected]
    alive.count[matched] = found.n_points[detected]
