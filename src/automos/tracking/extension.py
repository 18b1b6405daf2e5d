"""Moving objects where the evidence is silent: while they wait, and where others fill the place they left.

Evidence asks whether a place was ever empty. A car that stands at the lights for longer than anyone looked, or a tram
that follows another, leaves no place empty; but its track comes from, or goes to, where the evidence is clear. So a
track that moves is followed on, from both its ends, over the segments that are said to have stayed: as long as they are
where it must be, of its size, and were not there before it came.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from automos.detections import Detections
from automos.settings import ExtensionSettings
from automos.tracking import filter as kalman
from automos.tracking.association import assign
from automos.tracking.follow import motion_cost
from automos.tracking.tracker import as_table
from automos.tracking.tracks import Tracks
from automos.upright_boxes import Boxes


def extend_tracks(
    moving: Tracks, detections: Sequence[Detections], stamps: npt.NDArray[np.float64], settings: ExtensionSettings
) -> Tracks:
    """Return `moving` with the rows that its tracks gain before their first and after their last observation.

    Parameters
    ----------
    moving : the rows of moving tracks; their numbers are kept.
    detections : per scan, its segments.   stamps : (N,) seconds.
    """
    core = _with_mended_ends(moving, detections, stamps, settings)
    n = len(stamps)
    after = _extend(core, detections, stamps, settings)
    before = _mirrored(_extend(_mirrored(core, n), detections[::-1], -stamps[::-1], settings), n)
    return Tracks.concatenate([before, core, after])


def _with_mended_ends(
    moving: Tracks, detections: Sequence[Detections], stamps: npt.NDArray[np.float64], settings: ExtensionSettings
) -> Tracks:
    """Return `moving` without the pieces that its tracks begin and end in.

    When something comes to a halt, the evidence leaves one part of it after the other. Such a piece gives way to the
    whole segment it was cut out of, if that is as large as the first (or last) that was seen whole, or is left out.
    """
    moving = replace(moving, segment=moving.segment.copy(), center=moving.center.copy(), size=moving.size.copy())
    keep = np.ones(len(moving.track), np.bool_)
    for track in np.unique(moving.track):
        rows = np.arange(len(keep))[moving.rows_of(track)]
        rows = rows[moving.is_observed[rows]]
        scans, segments = moving.scan[rows], moving.segment[rows]
        whole = np.array([detections[scan].part_of[segment] for scan, segment in zip(scans, segments, strict=True)])
        side = np.array(
            [detections[scan].boxes.size[segment].max() for scan, segment in zip(scans, segments, strict=True)]
        )
        uncut, cut = np.flatnonzero(whole < 0), np.flatnonzero(whole >= 0)
        if not len(uncut):
            continue
        sound = uncut[side[uncut] >= settings.fray_share * np.median(side[uncut])]
        for like, pieces in ((sound[0], cut[cut < sound[0]]), (sound[-1], cut[cut > sound[-1]])):
            for k in pieces:
                found, usual = detections[scans[k]], detections[scans[like]]
                if _is_like(found, whole[k], usual, segments[like], settings):
                    row = rows[k]
                    moving.segment[row] = whole[k]
                    moving.center[row], moving.size[row] = found.boxes.center[whole[k]], found.boxes.size[whole[k]]
                    side[k] = found.boxes.size[whole[k]].max()
        t = stamps[scans]
        starts = side >= settings.fray_share * np.median(side[t <= t[0] + settings.fray_time])
        ends = side >= settings.fray_share * np.median(side[t >= t[-1] - settings.fray_time])
        core = rows[np.argmax(starts) : len(rows) - np.argmax(ends[::-1])]
        keep[moving.rows_of(track)] = False
        keep[core[0] : core[-1] + 1] = True
    return moving[np.flatnonzero(keep)]


def _is_like(found: Detections, j: int, other: Detections, k: int, settings: ExtensionSettings) -> bool:
    """Return whether segment `j` of `found` has the size and the points of segment `k` of `other`."""
    now, before = found.boxes.size[j], other.boxes.size[k]
    is_alike = (np.abs(now - before) <= settings.whole_size * (1.0 + before)).all()
    return bool(is_alike and found.n_points[j] <= settings.whole_points * other.n_points[k])


def _extend(
    moving: Tracks, detections: Sequence[Detections], stamps: npt.NDArray[np.float64], settings: ExtensionSettings
) -> Tracks:
    """Return the rows after the last observations of the tracks of `moving`."""
    seen = moving[np.flatnonzero(moving.is_observed)]
    ends: dict[int, list[Tracks]] = {}  # scan -> rows of the tracks that are last seen in it
    for track in np.unique(seen.track):
        rows = seen[np.arange(len(seen.track))[seen.rows_of(track)]]
        if _is_well_known(rows, detections, stamps, settings):
            ends.setdefault(int(rows.scan[-1]), []).append(rows)
    taken = [seen.segment[seen.scan == scan] for scan in range(len(stamps))]
    way = {(track, scan): at for track, scan, at in zip(moving.track, moving.scan, moving.center[:, :2], strict=True)}
    alive = kalman.Beliefs(np.zeros((0, 10)), np.zeros((0, 10, 10)))
    ids, unseen, count = np.zeros(0, np.int64), np.zeros(0), np.zeros(0)
    log = []
    for scan in range(1, len(stamps)):
        for rows in ends.get(scan - 1, []):
            alive = kalman.Beliefs.concatenate([alive, _belief_at_end(rows, detections, stamps, settings)])
            ids, unseen = np.append(ids, rows.track[-1]), np.append(unseen, 0.0)
            count = np.append(count, detections[scan - 1].n_points[rows.segment[-1]])
        if not len(ids):
            continue
        dt, found = stamps[scan] - stamps[scan - 1], detections[scan]
        alive, unseen = kalman.predict(alive, dt, settings.filter), unseen + dt
        cost = motion_cost(alive, np.full(len(ids), 0.5), count, found, settings.gates)
        cost[:, taken[scan]] = np.inf
        just_before = range(np.searchsorted(stamps, stamps[scan] - settings.look_back), scan)
        for k, j in zip(*np.nonzero(np.isfinite(cost)), strict=True):
            own = {s: way[ids[k], s] for s in just_before if (ids[k], s) in way}
            if _was_there_before(found.boxes[np.array([j])], own, detections, settings):
                cost[k, j] = np.inf
        matched, segment = assign(cost)
        updated = kalman.update(alive[matched], found.boxes[segment], settings.filter)
        alive.mean[matched], alive.covariance[matched] = updated.mean, updated.covariance
        unseen[matched] = 0.0
        is_long = kalman.is_long(updated, settings.filter)
        known = np.where(is_long, np.exp(-dt / settings.count_memory) * count[matched], 0.0)
        count[matched] = np.maximum(found.n_points[segment], known)
        way.update({(track, scan): at for track, at in zip(ids, alive.mean[:, :2], strict=True)})
        log.append((ids[matched], scan, segment, alive.mean[matched]))
        blind_way = unseen * np.linalg.norm(alive.mean[:, kalman.VELOCITY], axis=1)
        length = alive.mean[:, kalman.SIZE][:, :2].max(axis=1, initial=0.0)
        is_near = blind_way <= np.maximum(settings.max_blind_way, settings.max_blind_share * length)
        keep = (unseen <= settings.gates.max_gap) & is_near
        alive, ids, unseen, count = alive[keep], ids[keep], unseen[keep], count[keep]
    return as_table(log)


def _is_well_known(
    rows: Tracks, detections: Sequence[Detections], stamps: npt.NDArray[np.float64], settings: ExtensionSettings
) -> bool:
    """Return whether the observations `rows` of one track are enough to know it again."""
    points = [detections[scan].n_points[segment] for scan, segment in zip(rows.scan, rows.segment, strict=True)]
    return bool(
        stamps[rows.scan[-1]] - stamps[rows.scan[0]] >= settings.min_time
        and len(rows.scan) >= settings.min_presence * (rows.scan[-1] - rows.scan[0] + 1)
        and np.median(points) >= settings.min_points
    )


def _was_there_before(
    box: Boxes, own: dict[int, npt.NDArray], detections: Sequence[Detections], settings: ExtensionSettings
) -> bool:
    """Return whether something like `box` (1) was at its place while the track was elsewhere.

    own : the track's position (2,) in the scans just before.
    """
    center, size = box.center[0], box.size[0]
    for scan, at in own.items():
        before = detections[scan].boxes
        is_near = np.linalg.norm(before.center - center, axis=1) <= settings.same_place + 0.1 * size.max()
        is_alike = (np.abs(before.size - size) <= settings.same_place + settings.same_size * size).all(axis=1)
        is_elsewhere = np.linalg.norm(before.center[:, :2] - at, axis=1) > 0.5 * before.size[:, 0]
        if (is_near & is_alike & is_elsewhere).any():
            return True
    return False


def _belief_at_end(
    rows: Tracks, detections: Sequence[Detections], stamps: npt.NDArray[np.float64], settings: ExtensionSettings
) -> kalman.Beliefs:
    """Return where one track is when it is last seen; its velocity is that of a line through its last centres."""
    rows = rows[np.flatnonzero(stamps[rows.scan] >= stamps[rows.scan[-1]] - settings.fit_time)]
    boxes = Boxes.concatenate(
        [detections[s].boxes[np.array([j])] for s, j in zip(rows.scan, rows.segment, strict=True)]
    )
    belief = kalman.start(boxes[np.array([-1])], settings.filter)
    t = stamps[rows.scan] - stamps[rows.scan].mean()
    if len(t) > 2:
        belief.mean[0, kalman.VELOCITY] = t @ boxes.center / (t @ t)
    return belief


def _mirrored(tracks: Tracks, n_scans: int) -> Tracks:
    """Return `tracks` as they look in a recording of `n_scans` that is played backwards."""
    back = replace(tracks, scan=n_scans - 1 - tracks.scan, velocity=-tracks.velocity)
    return back[np.lexsort((back.scan, back.track))]
