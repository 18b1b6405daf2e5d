"""What the page shows of one track: the points around it at moments of its life, in a frame that does not move."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.review.run_stages import RunStages
from automos.scan import GROUND

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


def scene(stages: RunStages, track: int) -> dict[str, Any]:
    """Return `track` (index, from 0) as the page draws it.

    Positions are relative to `origin` (level frame, metres). `points` packs int16 x, y, z in centimetres, `kinds` a
    byte each, both base64, moment after moment; `starts` says where each moment begins.
    """
    tracks = stages.tracks
    rows = np.arange(len(tracks.track))[tracks.rows_of(track)]
    seen = rows[tracks.is_observed[rows]]
    rows = seen if len(seen) else rows
    shown = rows[np.unique(np.linspace(0, len(rows) - 1, MOMENTS).round().astype(int))]
    low, high = tracks.center[rows].min(axis=0), tracks.center[rows].max(axis=0)
    origin = 0.5 * (low + high)
    half = float(np.clip(0.5 * (high - low)[:2].max() + MARGIN, MIN_HALF, MAX_HALF))
    points, kinds = [], []
    for row in shown:
        moment_points, moment_kinds = _moment(stages, int(tracks.scan[row]), track, origin, half)
        points.append(moment_points)
        kinds.append(moment_kinds)
    centimetres = np.round(100.0 * np.concatenate(points)).astype("<i2")
    return {
        "track": track + 1,
        "half": half,
        "origin": origin.round(2).tolist(),
        "starts": np.cumsum([0, *map(len, kinds)]).tolist(),
        "points": base64.b64encode(centimetres.tobytes()).decode(),
        "kinds": base64.b64encode(np.concatenate(kinds).tobytes()).decode(),
        "moments": [
            {
                "scan": stages.names[tracks.scan[row]],
                "time": round(float(stages.trajectory.stamps[tracks.scan[row]] - stages.trajectory.stamps[0]), 2),
                "box": [*(tracks.center[row] - origin).round(2), *tracks.size[row].round(2), round(tracks.yaw[row], 3)],
                "speed": round(float(np.hypot(*tracks.velocity[row, :2])), 1),
                "sensor": (stages.trajectory.T_level_sensor[tracks.scan[row], :3, 3] - origin).round(2).tolist(),
            }
            for row in shown
        ],
    }


def _moment(
    stages: RunStages, scan: int, track: int, origin: npt.NDArray, half: float
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.uint8]]:
    """Return the points (M, 3) of a scan that lie around, relative to `origin`, and what each is to the track."""
    frame = stages.frame(scan)
    near = np.flatnonzero((np.abs(frame.points_level - origin) < [half, half, HEIGHT]).all(axis=1))
    painted = stages.labels(scan)["track"][frame.kept[near]]
    is_ground = stages.stage("candidates").load(stages.names[scan], "kind")["kind"][near] == GROUND
    is_own = (painted == track) | (stages.track_of_points(scan)[near] == track)
    kinds = np.select([is_own, painted >= 0, is_ground], [OWN, OTHER_MOVING, AROUND_GROUND], AROUND).astype(np.uint8)
    kept = np.concatenate([_thin(np.flatnonzero(~is_own), MAX_AROUND), _thin(np.flatnonzero(is_own), MAX_OWN)])
    return frame.points_level[near[kept]] - origin, kinds[kept]


def _thin(rows: npt.NDArray[np.int64], most: int) -> npt.NDArray[np.int64]:
    return rows if len(rows) <= most else rows[np.linspace(0, len(rows) - 1, most).astype(int)]
