"""Follow every object through the recording: predict, associate, update, start, forget (paper III-D)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from automos.settings import TrackingSettings
from automos.tracking import filter as kalman
from automos.tracking.association import assign, association_cost
from automos.tracking.tracks import Tracks
from automos.upright_boxes import Boxes


def track_objects(detections: Iterable[tuple[float, Boxes]], settings: TrackingSettings) -> Tracks:
    """Return the tracks of all detected objects.

    An object that is not matched keeps moving by its motion model and can be found again for `max_misses` consecutive
    scans (n_old); then its track ends at its last observation.

    Parameters
    ----------
    detections : per scan, in time order, its time in seconds and its boxes (level frame); row j is segment j.
    """
    alive = kalman.Beliefs(np.zeros((0, 10)), np.zeros((0, 10, 10)))
    ids, misses = np.zeros(0, np.int64), np.zeros(0, np.int64)
    log: list[tuple[npt.NDArray, int, npt.NDArray, npt.NDArray]] = []
    next_id, last_stamp = 0, None
    for scan, (stamp, boxes) in enumerate(detections):
        if last_stamp is not None:
            alive = kalman.predict(alive, stamp - last_stamp, settings.filter)
        last_stamp = stamp
        matched, detected = assign(association_cost(alive.boxes(), boxes, settings.association))
        after = kalman.update(alive[matched], boxes[detected], settings.filter)
        alive.mean[matched], alive.covariance[matched] = after.mean, after.covariance
        misses += 1
        misses[matched] = 0
        segment = np.full(len(ids), -1)
        segment[matched] = detected

        new = np.setdiff1d(np.arange(len(boxes)), detected)
        keep = misses <= settings.max_misses
        alive = kalman.Beliefs.concatenate([alive[keep], kalman.start(boxes[new], settings.filter)])
        ids = np.concatenate([ids[keep], next_id + np.arange(len(new))])
        misses = np.concatenate([misses[keep], np.zeros(len(new), np.int64)])
        next_id += len(new)
        log.append((ids, scan, np.concatenate([segment[keep], new]), alive.mean.copy()))
    return as_table(log)


def as_table(log: list[tuple[npt.NDArray, int, npt.NDArray, npt.NDArray]]) -> Tracks:
    """Return the log as tracks, without the misses after each track's last observation."""
    if not log:
        log = [(np.zeros(0, np.int64), 0, np.zeros(0, np.int64), np.zeros((0, 10)))]
    track = np.concatenate([ids for ids, *_ in log]).astype(np.int64)
    scan = np.concatenate([np.full(len(ids), scan) for ids, scan, *_ in log]).astype(np.int64)
    segment = np.concatenate([segment for *_, segment, _ in log]).astype(np.int64)
    mean = np.concatenate([mean for *_, mean in log])
    last_seen = np.full(track.max(initial=-1) + 1, -1)
    np.maximum.at(last_seen, track[segment >= 0], scan[segment >= 0])
    keep = np.flatnonzero(scan <= last_seen[track])
    order = keep[np.lexsort((scan[keep], track[keep]))]
    mean = mean[order]
    return Tracks(
        track[order],
        scan[order],
        segment[order],
        mean[:, :3].copy(),
        np.maximum(mean[:, kalman.SIZE], 1e-3),
        mean[:, kalman.YAW].copy(),
        mean[:, kalman.VELOCITY].copy(),
    )
