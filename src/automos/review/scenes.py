"""The views that the page shows: of an object, at several moments in a fixed frame, and of a scan, from above."""

import base64
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label
from automos.core.scan import GROUND
from automos.review.amendments import Amendment
from automos.review.run_stages import Changes, RunStages, changed_labels, number_of, parts_in, replaced
from automos.views.ground_map import thin_rows


@dataclass(frozen=True, eq=False)
class Subject:
    """Something over time.

    Attributes
    ----------
    id : int
        What the page calls it, 0 if it has no number yet.
    scans : (K,) int64
        Indices, ascending.
    boxes : (K, 7) float64
        Centre, size, yaw; level frame, metres, radians.
    speed : (K,) float64
        Metres per second over the ground.
    own_rows : callable
        Of a scan's index, the rows of its points in the scan as the recording has it.
    """

    id: int
    scans: npt.NDArray[np.int64]
    boxes: npt.NDArray[np.float64]
    speed: npt.NDArray[np.float64]
    own_rows: Callable[[int], npt.NDArray[np.int64]]


def subject_of_track(stages: RunStages, track: int) -> Subject:
    """Return `track` (index, from 0), where it was observed, or followed if it never was."""
    tracks = stages.tracks
    rows = np.r_[tracks.rows_of(track)]
    seen = rows[tracks.is_observed[rows]]
    rows = seen if len(seen) else rows
    boxes = np.column_stack([tracks.center[rows], tracks.size[rows], tracks.yaw[rows]])
    speed = np.hypot(*tracks.velocity[rows, :2].T)
    return Subject(
        track + 1, tracks.scan[rows], boxes, speed, lambda i: np.flatnonzero(stages.owner_of_points(i) == track)
    )


def subject_of_amendment(stages: RunStages, amendment: Amendment, id: int) -> Subject:
    """Return an object made by hand, or proposed to be."""
    parts = {stages.index[name]: part for name, part in amendment.parts.items() if name in stages.index}
    scans = np.array(sorted(parts), np.int64)
    T, stamps = stages.trajectory.T_level_sensor, stages.trajectory.stamps
    boxes = np.array([parts[i].box_level(T[i]) for i in scans.tolist()]).reshape(-1, 7)
    speed = np.zeros(len(scans))
    if len(scans) > 1:
        speed = np.hypot(*np.gradient(boxes[:, :2], stamps[scans], axis=0).T)
    nothing = np.zeros(0, np.int64)
    return Subject(id, scans, boxes, speed, lambda i: parts[i].rows if i in parts else nothing)


MOMENTS = 28
"""Scans of a track that are shown, evenly over its life."""
MAX_AROUND, MAX_OWN = 5000, 1500
"""Points shown of the surroundings and of the track itself, per moment."""
MARGIN, MIN_HALF, MAX_HALF = 9.0, 11.0, 40.0
"""Metres shown beyond the ends of its path; half the side of the square shown, at least and at most."""
HEIGHT = 6.0
"""Metres above and below the track's middle that are shown."""
AROUND_GROUND, AROUND, OTHER_MOVING, OWN = 0, 1, 2, 3
"""What a point is to the track."""


def scene(stages: RunStages, subject: Subject, at: int = -1) -> dict[str, Any]:
    """Return `subject` as the page draws it, in scan `at` too if it is there.

    Positions are relative to `origin` (level frame, metres). `points` packs int16 x, y, z in centimetres, `kinds` a
    byte each, both base64, moment after moment; `starts` says where each moment begins.
    """
    evenly = np.linspace(0, len(subject.scans) - 1, MOMENTS).round().astype(int)
    shown = np.union1d(evenly, np.flatnonzero(subject.scans == at))
    low, high = subject.boxes[:, :3].min(axis=0), subject.boxes[:, :3].max(axis=0)
    origin = 0.5 * (low + high)
    half = float(np.clip(0.5 * (high - low)[:2].max() + MARGIN, MIN_HALF, MAX_HALF))
    moments = [_moment(stages, int(subject.scans[k]), subject, origin, half) for k in shown]
    stamps, T_level_sensor = stages.trajectory.stamps, stages.trajectory.T_level_sensor
    return {
        "track": subject.id,
        "half": half,
        "origin": origin.round(2).tolist(),
        **pack_moments([points for points, _ in moments], [kinds for _, kinds in moments]),
        "moments": [
            {
                "scan": stages.names[i],
                "index": i,
                "time": round(float(stamps[i] - stamps[0]), 2),
                "box": [*(box[:3] - origin).round(2).tolist(), *box[3:6].round(2).tolist(), round(float(box[6]), 3)],
                "speed": round(float(speed), 1),
                "sensor": (T_level_sensor[i, :3, 3] - origin).round(2).tolist(),
            }
            for i, box, speed in zip(
                subject.scans[shown].tolist(), subject.boxes[shown], subject.speed[shown], strict=True
            )
        ],
    }


def pack_moments(points: list[npt.NDArray], kinds: list[npt.NDArray[np.uint8]]) -> dict[str, Any]:
    """Return points (M, 3) in metres and their kinds (M,), of some moments, as `scene` packs them."""
    centimetres = np.round(100.0 * np.concatenate(points)).astype("<i2")
    return {
        "starts": np.cumsum([0, *map(len, kinds)]).tolist(),
        "points": base64.b64encode(centimetres.tobytes()).decode(),
        "kinds": base64.b64encode(np.concatenate(kinds).astype(np.uint8).tobytes()).decode(),
    }


def _moment(
    stages: RunStages, scan: int, subject: Subject, origin: npt.NDArray, half: float
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.uint8]]:
    """Return the points (M, 3) of a scan that lie around, relative to `origin`, and what each is to the subject."""
    frame = stages.frame(scan)
    near = np.flatnonzero((np.abs(frame.points_level - origin) < [half, half, HEIGHT]).all(axis=1))
    painted = stages.labels(scan)["track"][frame.kept[near]]
    is_ground = stages.stage("candidates").load(stages.names[scan], "kind")["kind"][near] == GROUND
    is_own = np.isin(frame.kept[near], subject.own_rows(scan))
    kinds = np.select([is_own, painted >= 0, is_ground], [OWN, OTHER_MOVING, AROUND_GROUND], AROUND).astype(np.uint8)
    kept = np.concatenate([thin_rows(np.flatnonzero(~is_own), MAX_AROUND), thin_rows(np.flatnonzero(is_own), MAX_OWN)])
    return frame.points_level[near[kept]] - origin, kinds[kept]


MAX_STANDING, MAX_GROUND = 60_000, 15_000
"""Points shown of what stands and of the ground; of what moves, all."""
REACH = 120.0
"""Metres around the sensor that are shown."""
UNSURE = OWN
"""Kind of points without a label, drawn like an object that is decided on."""


def place(stages: RunStages, index: int, changes: Changes) -> dict[str, Any]:
    """Return scan `index` as the page draws it: as a scene of one moment, the sensor at its origin."""
    frame, labels = stages.frame(index), changed_labels(stages, index, changes)["label"]
    kind = stages.stage("candidates").load(stages.names[index], "kind")["kind"]
    points = frame.points_level - frame.origin_level
    label = labels[frame.kept]
    kinds = np.select(
        [label == Label.MOVING, kind == GROUND, label == Label.UNLABELED],
        [OTHER_MOVING, AROUND_GROUND, UNSURE],
        AROUND,
    ).astype(np.uint8)
    near = (np.abs(points) < REACH).all(axis=1)
    rows = [
        thin_rows(np.flatnonzero(near & (kinds == one)), most)
        for one, most in ((AROUND_GROUND, MAX_GROUND), (AROUND, MAX_STANDING), (UNSURE, 10**6), (OTHER_MOVING, 10**6))
    ]
    shown = np.concatenate(rows)
    return {
        "scan": stages.names[index],
        "index": index,
        "time": round(float(stages.trajectory.stamps[index] - stages.trajectory.stamps[0]), 2),
        "origin": frame.origin_level.round(3).tolist(),
        "boxes": _boxes(stages, index, changes),
        **pack_moments([points[shown]], [kinds[shown]]),
    }


def _boxes(stages: RunStages, index: int, changes: Changes) -> list[tuple[int | float, ...]]:
    """Return the objects of scan `index`, found and made by hand: id, x, y, length, width, yaw; level frame."""
    tracks, gone = stages.tracks, replaced(stages, index, changes)
    rows = np.flatnonzero((tracks.scan == index) & ~np.isin(tracks.track, gone))
    columns = np.column_stack([tracks.center[rows, :2], tracks.size[rows, :2], tracks.yaw[rows]]).round(3)
    found = [(int(tracks.track[row]) + 1, *box) for row, box in zip(rows, columns.tolist(), strict=True)]
    T = stages.trajectory.T_level_sensor[index]
    made = [
        (number_of(stages, one) + 1, *one.parts[stages.names[index]].box_level(T)[[0, 1, 3, 4, 6]].round(3).tolist())
        for one, _ in parts_in(stages, index, changes)
    ]
    return found + made
