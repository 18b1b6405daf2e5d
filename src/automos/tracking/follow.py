"""Follow objects by their motion and by the evidence (the `default` preset's tracker).

The paper's gates are metres per scan: an object faster than 2 m a scan never gets a second observation, and one that
shows another side changes its volume. Here the gate is the filter's own uncertainty, and a new object may be as fast
as the evidence says that it has moved: fast oncoming traffic is followed from its second scan, a parked car is not
mistaken for the next one in its row. Size, height, number of points and evidence choose among those that are near.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from automos.detections import Detections
from automos.settings import FollowSettings
from automos.tracking import filter as kalman
from automos.tracking.association import assign
from automos.tracking.tracker import as_table
from automos.tracking.tracks import Tracks

_MEMORY = 0.7
"""How much of an object's evidence is kept when it is seen again."""


def follow_objects(detections: Iterable[tuple[float, Detections]], settings: FollowSettings) -> Tracks:
    """Return the tracks of all detections.

    Parameters
    ----------
    detections : per scan, in time order, its time in seconds and its segments (level frame); row j is segment j.
    """
    alive = kalman.Beliefs(np.zeros((0, 10)), np.zeros((0, 10, 10)))
    ids, unseen = np.zeros(0, np.int64), np.zeros(0)
    share, count = np.zeros(0), np.zeros(0)
    log, next_id, last_stamp = [], 0, None
    for scan, (stamp, found) in enumerate(detections):
        open_to = np.flatnonzero(~found.has_stayed)
        seen = found[open_to]
        dt = 0.0 if last_stamp is None else stamp - last_stamp
        last_stamp = stamp
        alive, unseen = kalman.predict(alive, dt, settings.filter), unseen + dt
        matched, detected = assign(motion_cost(alive, share, count, seen, settings))
        after = kalman.update(alive[matched], seen.boxes[detected], settings.filter)
        alive.mean[matched], alive.covariance[matched] = after.mean, after.covariance
        unseen[matched] = 0.0
        share[matched] = _MEMORY * share[matched] + (1.0 - _MEMORY) * seen.moving_share[detected]
        count[matched] = seen.n_points[detected]
        segment = np.full(len(ids), -1)
        segment[matched] = open_to[detected]

        new = np.setdiff1d(np.arange(len(seen)), detected)
        keep = unseen <= settings.max_gap
        may_be_fast = seen.moving_share[new] > 0.5
        velocity_variance = np.where(may_be_fast, settings.speed**2, settings.filter.initial_velocity_variance)
        born = kalman.start(seen.boxes[new], settings.filter, velocity_variance)
        alive = kalman.Beliefs.concatenate([alive[keep], born])
        ids = np.concatenate([ids[keep], next_id + np.arange(len(new))])
        unseen = np.concatenate([unseen[keep], np.zeros(len(new))])
        share = np.concatenate([share[keep], seen.moving_share[new]])
        count = np.concatenate([count[keep], seen.n_points[new]])
        next_id += len(new)
        log.append((ids, scan, np.concatenate([segment[keep], open_to[new]]), alive.mean.copy()))
    return as_table(log)


def motion_cost(
    alive: kalman.Beliefs,
    share: npt.NDArray[np.float64],
    count: npt.NDArray[np.float64],
    seen: Detections,
    settings: FollowSettings,
) -> npt.NDArray[np.float64]:
    """Return the (K, M) cost of taking detection j for object i, inf where a gate forbids it.

    Parameters
    ----------
    alive : (K) predicted objects.
    share, count : (K,) what the evidence said of them so far, and how many points they last had.
    """
    offset = seen.boxes.center[None, :, :] - alive.mean[:, None, :3]  # (K, M, 3)
    noise = kalman.measurement_noise(seen.boxes, settings.filter)[:, :2, :2]
    climb = np.abs(offset[..., 2])
    if settings.filter.unlike_share:
        k, j = (index.ravel() for index in np.indices(offset.shape[:2]))
        unlike = kalman.unlike_sides(alive[k], seen.boxes[j], settings.filter)
        noise = noise + kalman.along(alive.mean[k, kalman.YAW], unlike[:, :2]).reshape(*offset.shape[:2], 2, 2)
        climb = np.maximum(climb - unlike[:, 2].reshape(climb.shape), 0.0)
    squared = _mahalanobis(offset[..., :2], alive.covariance[:, None, :2, :2] + noise)
    size_before = np.sort(np.maximum(alive.mean[:, None, 4:6], 0.1), axis=-1)
    size_now = np.sort(np.maximum(seen.boxes.size[None, :, :2], 0.1), axis=-1)
    growth = (np.abs(size_before - size_now) / (1.0 + np.maximum(size_before, size_now))).max(axis=-1)
    # A few points more or less say nothing of something that has a few points.
    thinning = np.abs(np.log((count[:, None] + 3.0) / (seen.n_points[None, :] + 3.0)))
    contrast = np.abs(share[:, None] - seen.moving_share[None, :])
    cost = (
        squared
        + climb
        + settings.size_weight * growth
        + settings.count_weight * thinning
        + settings.evidence_weight * contrast
    )
    is_possible = (
        (squared < settings.gate**2)
        & (climb < settings.max_climb)
        & (growth < settings.max_size_change)
        & (thinning < np.log(settings.max_count_ratio))
    )
    return np.where(is_possible, cost, np.inf)


def _mahalanobis(offset: npt.NDArray[np.float64], spread: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the squared length (K, M) of `offset` (K, M, 2) in standard deviations of `spread` (K, M, 2, 2)."""
    x, y, a, b, c = offset[..., 0], offset[..., 1], spread[..., 0, 0], spread[..., 0, 1], spread[..., 1, 1]
    return (c * x * x - 2.0 * b * x * y + a * y * y) / (a * c - b * b)
