"""The view of one object: the points around it at several moments, in a fixed frame."""

import base64
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.scan import GROUND
from automos.review.run_stages import RunStages
from automos.review.subjects import Subject

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
    kept = np.concatenate([thin(np.flatnonzero(~is_own), MAX_AROUND), thin(np.flatnonzero(is_own), MAX_OWN)])
    return frame.points_level[near[kept]] - origin, kinds[kept]


def thin(rows: npt.NDArray[np.int64], most: int) -> npt.NDArray[np.int64]:
    """Return at most `most` of `rows`, evenly."""
    return rows if len(rows) <= most else rows[np.linspace(0, len(rows) - 1, most).astype(int)]
