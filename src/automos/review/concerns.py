"""Warnings that point at an object, a scan or a place.

A moving track that ends is followed further by the same tracker, without the evidence. If it leads to something that
was not there before the object arrived, the evidence may have lost it: a vehicle that stops, or one that is occluded
for long.
"""

import json
from functools import lru_cache
from typing import Any

import numpy as np

from automos.core.geometry import Array
from automos.core.upright_boxes import Boxes
from automos.core.workspace import Workspace, write_run
from automos.objects.tracks import observed
from automos.review.follow import Detect, Heading, Path, follow_ahead
from automos.review.run_stages import RunStages

Seen = list[tuple[int, int]]
"""Where something was observed: scans and segments."""
RUN_UP = 5
"""Observations before its end from which a track is followed on, so that it is known how fast it was."""
GOES_ON = 3
"""Observations beyond its end from which something is taken to go on there."""
LEAST_POINTS = 25
"""Of the last observation, below which hardly anything is at stake beyond it."""
LOOK_AHEAD = 1.0
"""Seconds beyond its end in which something must be there to be followed at all."""
MAY_CHANGE = 8.0
"""Metres per second a second or so by which its velocity changes."""
SAME_PLACE, SAME_SIZE = 0.5, 0.2
"""Metres, and share of the size besides, by which two segments of one standing thing differ."""
CLIMB = 0.5
"""Rise over way of a whole recording that no vehicle and no walker makes: 30 degrees."""
CACHED_SCANS = 200
"""Scans whose segments are kept, some 20 kB each: tracks are followed in the order in which they begin."""
LEAST_WAY = 2.0
"""Metres of path from which its steepness is significant."""


def find_concerns(stages: RunStages, has_given_poses: bool) -> list[dict[str, Any]]:
    """Return the places to look at, the most serious first.

    Each has `kind` and `sentence`; one about a place has `scan` (name), `at` (x, y in metres, level frame), `track`
    (id), `segment` and `points` as well.
    """
    return [*(_steep(stages.T_level_sensor[:, :3, 3]) if has_given_poses else []), *_lost_ends(stages)]


def _steep(path: Array) -> list[dict[str, Any]]:
    """Poses on which the sensor climbs or descends impossibly: those of a camera, whose z-axis points ahead."""
    way = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    rise = float(np.abs(np.diff(path[:, 2])).sum())
    if way < LEAST_WAY or rise < CLIMB * way:
        return []
    sentence = (
        f"By the given poses the sensor rises or sinks by {rise:.0f} m on a way of {way:.0f} m. They look like "
        "a camera's, whose z-axis points ahead: give --calib with the camera's calibration, or poses of the "
        "sensor itself."
    )
    return [{"kind": "camera", "sentence": sentence}]


# -------------------------------------------------------------------------------------------- tracks that end too soon
def _lost_ends(stages: RunStages) -> list[dict[str, Any]]:
    detect, is_moving = lru_cache(CACHED_SCANS)(stages.detections), stages.verdicts.is_moving
    moving = observed(stages.tracks[is_moving[stages.tracks.track]])
    segments = list(zip(moving.scan.tolist(), moving.segment.tolist(), strict=True))
    taken = set(segments)
    found = []
    for track in np.flatnonzero(is_moving).tolist():
        for step in (1, -1):
            seen = segments[moving.rows_of(track)][::step]
            beyond = _beyond(seen, detect, stages, step)
            beyond = {scan: at for scan, at in beyond.items() if at[0] >= 0 and (scan, at[0]) not in taken}
            if len(beyond) >= GOES_ON and not _was_there(seen, beyond, detect):
                found.append(_lost(stages, track, seen[-1][0], beyond, detect, step))
    return sorted(found, key=lambda concern: -concern["points"])


def _beyond(seen: Seen, detect: Detect, stages: RunStages, step: int) -> Path:
    """Return how what was observed as `seen` goes on after the last; nothing if it does not."""
    stamps, (start, first), (end, last) = stages.trajectory.stamps, seen[-RUN_UP:][0], seen[-1]
    ended = detect(end)
    if ended.n_points[last] < LEAST_POINTS:
        return {}
    seconds = abs(stamps[end] - stamps[start])
    way = ended.boxes.center[last, :2] - detect(start).boxes.center[first, :2]
    heading = Heading(way / max(seconds, 0.05), MAY_CHANGE)
    if not _is_anything_there(end, ended.boxes[last : last + 1], heading, detect, stamps, step):
        return {}
    path = follow_ahead(detect, stamps, start, first, stages.settings.tracking, step, heading, seconds + LOOK_AHEAD)
    if end not in path or path[end][0] != last:
        return {}
    return {scan: at for scan, at in path.items() if (scan - end) * step > 0}


def _is_anything_there(end: int, box: Boxes, heading: Heading, detect: Detect, stamps: Array, step: int) -> bool:
    """Return whether enough of the scans right beyond `end` have anything of the `box`'s size where it should be."""
    n = 0
    for scan in range(end + step, len(stamps) if step > 0 else -1, step):
        away = abs(stamps[scan] - stamps[end])
        if away > LOOK_AHEAD or n >= GOES_ON:
            break
        there = detect(scan).boxes
        reach = box.size[0, :2].max() + 0.5 * MAY_CHANGE * away**2 + SAME_PLACE
        off = np.linalg.norm(there.center[:, :2] - box.center[0, :2] - heading.velocity * away, axis=1)
        n += bool(((off < reach) & (there.size[:, 2] > 0.5 * box.size[0, 2])).any())
    return n >= GOES_ON


def _was_there(seen: Seen, beyond: Path, detect: Detect) -> bool:
    """Return whether the continuation stood there while the track was still elsewhere."""
    ahead = [(box, detect(scan).boxes.size[segment]) for scan, (segment, box) in list(beyond.items())[:GOES_ON]]
    for before, own in seen:
        boxes = detect(before).boxes
        for box, size in ahead:
            if np.linalg.norm(boxes.center[own, :2] - box[:2]) < max(boxes.size[own, 0], 1.0):
                continue
            is_near = np.linalg.norm(boxes.center - box[:3], axis=1) < SAME_PLACE
            is_alike = (np.abs(boxes.size - size) < SAME_PLACE + SAME_SIZE * size).all(axis=1)
            if (is_near & is_alike).any():
                return True
    return False


def _lost(stages: RunStages, track: int, end: int, beyond: Path, detect: Detect, step: int) -> dict[str, Any]:
    points = int(sum(detect(scan).n_points[segment] for scan, (segment, _) in beyond.items()))
    first = min(beyond, key=lambda scan: abs(scan - end))
    segment, box = beyond[first]
    seconds = float(np.ptp(stages.trajectory.stamps[[end, *beyond]]))
    where = "ends after" if step > 0 else "begins only with"
    return {
        "kind": "lost",
        "sentence": f"Object {track + 1} {where} scan {stages.names[end]}, but something like it "
        f"{'goes on' if step > 0 else 'was there before'} for {seconds:.1f} s ({points:,} points): was it lost?",
        "track": track + 1,
        "scan": stages.names[first],
        "segment": int(segment),
        "at": [round(float(v), 2) for v in box[:2]],
        "points": points,
    }


def note_concerns(stages: RunStages, has_given_poses: bool) -> list[dict[str, Any]]:
    """Write the places to look at into run.json, once per set of tracks; return them."""
    stage = stages.stage("tracking")
    if not stage.has("concerns"):
        stage.save("concerns", {"json": np.array(json.dumps(find_concerns(stages, has_given_poses)))})
    concerns: list[dict[str, Any]] = json.loads(str(stage.load("concerns", "json")["json"]))
    run = Workspace(stages.folder).read_run()
    write_run(stages.folder, {**run, "warnings": concerns})
    return concerns
