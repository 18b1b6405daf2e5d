"""The views that the page shows: of an object, at several moments in a fixed frame, and of a scan, from above."""

import base64
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.arrays import some_of
from automos.core.geometry import Array
from automos.core.labels import Label
from automos.core.scan import GROUND
from automos.objects.tracks import observed
from automos.review.amendments import Amendment
from automos.review.apply import path_of
from automos.review.box_rows import as_rows
from automos.review.run_stages import Changes, Rows, RunStages, changed_labels, number_of, parts_in, replaced
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
    scans: Rows
    boxes: Array
    speed: Array
    own_rows: Callable[[int], Rows]


def subject_of_track(stages: RunStages, track: int) -> Subject:
    """Return `track` (index, from 0), where it was observed, or followed if it never was."""
    followed = stages.tracks[stages.tracks.rows_of(track)]
    here = observed(followed) if followed.is_observed.any() else followed

    def own_rows(i: int) -> Rows:
        return np.flatnonzero(stages.owner_of_points(i) == track)

    return Subject(track + 1, here.scan, as_rows(here.boxes), np.hypot(*here.velocity[:, :2].T), own_rows)


def subject_of_amendment(stages: RunStages, amendment: Amendment, id: int) -> Subject:
    """Return an object made by hand, or proposed to be."""
    scans, boxes, velocity = path_of(stages, amendment)

    def own_rows(i: int) -> Rows:
        part = amendment.parts.get(stages.names[i])
        return np.zeros(0, np.int64) if part is None else part.rows

    return Subject(id, scans, boxes, np.hypot(*velocity[:, :2].T), own_rows)


MOMENTS = 28
"""Scans of a track that are shown, evenly over its life."""
MAX_AROUND, MAX_OWN = 5000, 1500
"""Points shown of the surroundings and of the track itself, per moment."""
MARGIN, MIN_HALF, MAX_HALF = 9.0, 11.0, 40.0
"""Metres shown beyond the ends of its path; half the side of the square shown, at least and at most."""
HEIGHT = 6.0
"""Metres above and below the track's middle that are shown."""
Moment = tuple[Array, npt.NDArray[np.uint8]]
"""Points (M, 3) in metres, and the kind (M,) of each."""
AROUND_GROUND, AROUND, OTHER_MOVING, OWN = 0, 1, 2, 3
"""What a point is to the track."""


def scene(stages: RunStages, subject: Subject, at: int = -1) -> dict[str, Any]:
    """Return `subject` as the page draws it, in scan `at` too if it is there.

    Positions are relative to `origin` (level frame, metres). `points` packs int16 x, y, z in centimetres, `kinds` a
    byte each, both base64, moment after moment; `starts` says where each moment begins.
    """
    shown = np.union1d(some_of(len(subject.scans), MOMENTS), np.flatnonzero(subject.scans == at))
    low, high = subject.boxes[:, :3].min(axis=0), subject.boxes[:, :3].max(axis=0)
    origin = 0.5 * (low + high)
    half = float(np.clip(0.5 * (high - low)[:2].max() + MARGIN, MIN_HALF, MAX_HALF))
    moments = [_moment(stages, int(subject.scans[k]), subject, origin, half) for k in shown]
    stamps = stages.trajectory.stamps
    return {
        "track": subject.id,
        "half": half,
        "origin": origin.round(2).tolist(),
        **pack_moments(moments),
        "moments": [
            {
                "scan": stages.names[i],
                "index": i,
                "time": round(float(stamps[i] - stamps[0]), 2),
                "box": [*(box[:3] - origin).round(2).tolist(), *box[3:6].round(2).tolist(), round(float(box[6]), 3)],
                "speed": round(float(speed), 1),
                "sensor": (stages.T_level_sensor[i, :3, 3] - origin).round(2).tolist(),
            }
            for i, box, speed in zip(
                subject.scans[shown].tolist(), subject.boxes[shown], subject.speed[shown], strict=True
            )
        ],
    }


def pack_moments(moments: list[Moment]) -> dict[str, Any]:
    """Return some moments as `scene` packs them."""
    points, kinds = zip(*moments, strict=True)
    centimetres = np.round(100.0 * np.concatenate(points)).astype("<i2")
    return {
        "starts": np.cumsum([0, *map(len, kinds)]).tolist(),
        "points": base64.b64encode(centimetres.tobytes()).decode(),
        "kinds": base64.b64encode(np.concatenate(kinds).astype(np.uint8).tobytes()).decode(),
    }


def _moment(stages: RunStages, scan: int, subject: Subject, origin: Array, half: float) -> Moment:
    """Return the points of a scan that lie around, relative to `origin`, and what each is to the subject."""
    frame = stages.frame(scan)
    near = np.flatnonzero((np.abs(frame.points_level - origin) < [half, half, HEIGHT]).all(axis=1))
    painted = stages.labels(scan)["track"][frame.kept[near]]
    is_ground = stages.kinds(scan)[near] == GROUND
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
    is_ground = stages.kinds(index) == GROUND
    points = frame.points_level - frame.origin_level
    label = labels[frame.kept]
    kinds = np.select(
        [label == Label.MOVING, is_ground, label == Label.UNLABELED],
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
        **pack_moments([(points[shown], kinds[shown])]),
    }


def _boxes(stages: RunStages, index: int, changes: Changes) -> list[tuple[int | float, ...]]:
    """Return the objects of scan `index`, found and made by hand: id, x, y, length, width, yaw; level frame."""
    name, T = stages.names[index], stages.T_level_sensor[index]
    here = stages.tracks[stages.tracks.rows_in_scan(index)]
    here = here[~np.isin(here.track, replaced(stages, index, changes))]
    made = [one for one, _ in parts_in(stages, index, changes)]
    ids = [*here.track.tolist(), *(number_of(stages, one) for one in made)]
    boxes = np.vstack([as_rows(here.boxes), *(one.parts[name].box_level(T) for one in made)])[:, [0, 1, 3, 4, 6]]
    return [(number + 1, *box) for number, box in zip(ids, boxes.round(3).tolist(), strict=True)]
