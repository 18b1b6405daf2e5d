"""Multi-object tracking: predict, associate, update, start and end tracks (paper III-D).

Both presets run the same loop. They differ in the cost of a pair (`association`), in the initial velocity variance, and
in how long an object may be missed. In `default`, a scan's whole segments, the pieces that the evidence cut out of them
and the segments that have stayed are alternative measurements. An object is associated with the most similar one,
whatever the evidence on it at that moment. So a car that stops, waits and drives off is one track.

While a mover is missed, its position soon becomes uncertain, but an object that has always stayed keeps its place.
Out of sight it is remembered there for some seconds: it does not become another post some metres away, and a mover that
is lost beside it does not continue as the post that comes into sight again.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.detections import Detections
from automos.scan import Mask
from automos.settings import TrackingSettings
from automos.tracking import filter as kalman
from automos.tracking.association import assign, association_cost, motion_cost
from automos.tracking.tracks import Tracks

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]
_MEMORY = 0.7
"""Weight of an object's earlier evidence when it is observed again."""
STAYED = 0.1
"""Moving share up to which an object has stayed, if the share never exceeded a half."""
REMEMBERED = 10.0
"""Seconds for which an object that has stayed is remembered at its place while it is out of sight."""


@dataclass(frozen=True, eq=False)
class Objects(kalman.Beliefs):
    """The objects that are tracked at one time, and their states.

    Attributes
    ----------
    track : (K,) int64, track numbers.
    unseen : (K,) float64, seconds since the last observation.   misses : (K,) int64, scans since then.
    share : (K,) float64 in [0, 1], moving share of the evidence so far.
    count : (K,) float64, number of points at the last observation.
    has_moved : (K,) bool, whether the share ever exceeded a half.
    """

    track: Rows
    unseen: Array
    misses: Rows
    share: Array
    count: Array
    has_moved: Mask

    def joined(self, other: Objects) -> Objects:
        """Return these objects followed by those of `other`."""
        return Objects(*(np.concatenate([getattr(self, f.name), getattr(other, f.name)]) for f in fields(self)))


class Log(NamedTuple):
    """The states of objects, one row (R) for each object in each scan, in the order of scans.

    `track` is its number, `segment` the associated segment, -1 if missed, `mean` (R, 10) that of its `kalman.Beliefs`.
    """

    track: Rows
    scan: Rows
    segment: Rows
    mean: Array

    def at(self, rows: npt.NDArray) -> Log:
        """Return some of the rows."""
        return Log._make(column[rows] for column in self)


class Tracker:
    """The tracked objects, advanced by one scan at a time. Copies are independent: a step modifies no array in place.

    Attributes
    ----------
    next_track : int, number of the next new object.
    """

    def __init__(self, settings: TrackingSettings, first_track: int = 0):
        """Start without objects; the first new one gets the number `first_track`."""
        self.next_track = first_track
        self._settings, self._scan = settings, 0
        self._alive = self._resting = _start(Detections.nothing(), settings)
        self._last_stamp: float | None = None

    @property
    def numbers(self) -> Rows:
        """The numbers of all objects that may be observed again."""
        return np.concatenate([self._alive.track, self._resting.track])

    def step(self, stamp: float, found: Detections) -> Log:
        """Return the state of every object after the next scan, at `stamp` seconds, with the segments `found`."""
        settings, dt = self._settings, 0.0 if self._last_stamp is None else stamp - self._last_stamp
        alive, resting = self._alive, replace(self._resting, unseen=self._resting.unseen + dt)
        alive = kalman.predict(alive, dt, settings.filter)
        alive = replace(alive, unseen=alive.unseen + dt, misses=alive.misses + 1)
        cost = _cost(alive, found, settings)
        matched, detected = assign(cost)
        recalled, known = _recognise(resting, found, alive.share, cost, (matched, detected), settings)
        is_theirs = ~np.isin(detected, known)
        matched = np.concatenate([matched[is_theirs], len(alive) + np.arange(len(recalled))])
        detected = np.concatenate([detected[is_theirs], known])
        alive = alive.joined(resting[recalled])  # new arrays, which may be written to
        _update(alive, found, matched, detected, settings)
        segment = np.full(len(alive), -1)
        segment[matched] = detected

        new = np.setdiff1d(np.arange(len(found)), detected)
        started = _start(found[new], settings)
        started.track[:] = self.next_track + np.arange(len(new))
        self.next_track += len(new)
        rests = (alive.misses > 0) & ~alive.has_moved & (alive.share <= STAYED) & (settings.method == "evidence")
        still = np.setdiff1d(np.flatnonzero(resting.unseen <= REMEMBERED), recalled)
        self._resting = _at_rest(alive[rests], settings).joined(resting[still])
        keep = ((alive.misses <= settings.max_misses) | (alive.unseen <= settings.max_gap)) & ~rests
        self._alive = alive[keep].joined(started)
        scan = np.full(len(self._alive), self._scan)
        self._scan, self._last_stamp = self._scan + 1, stamp
        return Log(self._alive.track, scan, np.concatenate([segment[keep], new]), self._alive.mean)


def track_objects(detections: Iterable[tuple[float, Detections]], settings: TrackingSettings) -> Tracks:
    """Return the tracks of all detected objects.

    A missed object is predicted by its motion model and can be associated again for a while; after that, its track
    ends at its last observation.

    Parameters
    ----------
    detections : iterable of (float, Detections), seconds and segments (level frame) of each scan, in time order.
    """
    tracker = Tracker(settings)
    return as_table([tracker.step(stamp, found) for stamp, found in detections])


def _start(found: Detections, settings: TrackingSettings) -> Objects:
    """Return all of `found` as new objects; those that have moved get the velocity variance of traffic."""
    n, share = len(found), found.moving_share
    variance = np.full(n, settings.filter.initial_velocity_variance)
    if settings.method == "evidence":
        variance[share > 0.5] = settings.gates.speed**2
    belief, zero = kalman.start(found.boxes, settings.filter, variance), np.zeros(n, np.int64)
    count = found.n_points.astype(np.float64)
    return Objects(belief.mean, belief.covariance, zero, np.zeros(n), zero.copy(), share, count, share > 0.5)


def _at_rest(rest: Objects, settings: TrackingSettings) -> Objects:
    """Return objects that are out of sight at rest: at their last place, with the variance of a new box."""
    boxes = rest.boxes()
    boxes.center[:] -= rest.unseen[:, None] * rest.mean[:, kalman.VELOCITY]
    belief = kalman.start(boxes, settings.filter, np.zeros(len(rest)))
    return replace(rest, mean=belief.mean, covariance=belief.covariance)


def _recognise(
    resting: Objects, found: Detections, share: Array, cost: Array, pairs: tuple[Rows, Rows], settings: TrackingSettings
) -> tuple[Rows, Rows]:
    """Return which of `resting` are observed again, and as which of `found`.

    Only segments that have stayed can be. They must be free, or associated at a higher cost with an object that has
    moved: `pairs` of objects, which have a moving `share` (K,), and segments, at `cost` (K, M).
    """
    rows, columns = pairs
    limit = np.where(found.moving_share > 0.5, -np.inf, np.inf)
    is_doubtful = share[rows] - found.moving_share[columns] > 0.5
    limit[columns] = np.where(is_doubtful, cost[rows, columns], -np.inf)
    price = _cost(resting, found, settings)
    return assign(np.where(price < limit, price, np.inf))


def _cost(alive: Objects, found: Detections, settings: TrackingSettings) -> Array:
    if settings.method == "paper":
        return association_cost(alive.boxes(), found.boxes, settings.association)
    is_lost = alive.misses > 1  # the current scan is included
    return motion_cost(alive, alive.share, alive.count, found, settings.filter, settings.gates, is_lost)


def _update(alive: Objects, found: Detections, matched: Rows, detected: Rows, settings: TrackingSettings) -> None:
    """Update the rows `matched` of `alive` with the rows `detected` of `found`, in place."""
    after = kalman.update(alive[matched], found.boxes[detected], settings.filter)
    alive.mean[matched], alive.covariance[matched] = after.mean, after.covariance
    alive.unseen[matched], alive.misses[matched] = 0.0, 0
    alive.share[matched] = _MEMORY * alive.share[matched] + (1.0 - _MEMORY) * found.moving_share[detected]
    alive.count[matched] = found.n_points[detected]
    alive.has_moved[matched] |= alive.share[matched] > 0.5


def as_table(logs: list[Log]) -> Tracks:
    """Return the logs of all scans as tracks, without misses after each track's last observation."""
    none = np.zeros(0, np.int64)
    log = joined([Log(none, none, none, np.zeros((0, kalman.N_STATE))), *logs])
    last_seen, is_seen = np.full(log.track.max(initial=-1) + 1, -1), log.segment >= 0
    last_seen[log.track[is_seen]] = log.scan[is_seen]  # duplicates: the last write remains
    keep = np.flatnonzero(log.scan <= last_seen[log.track])
    log = log.at(keep[np.argsort(log.track[keep], kind="stable")])
    center, size = log.mean[:, :3], np.maximum(log.mean[:, kalman.SIZE], 1e-3)
    yaw, velocity = log.mean[:, kalman.YAW], log.mean[:, kalman.VELOCITY]
    return Tracks(log.track, log.scan, log.segment, center, size, yaw, velocity)


def joined(logs: list[Log]) -> Log:
    """Return `logs`, at least one, concatenated."""
    return Log._make(np.concatenate(column) for column in zip(*logs, strict=True))
