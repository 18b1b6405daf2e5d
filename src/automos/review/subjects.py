"""Anything that can be shown in a scene: boxes in some scans, and points."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.review.amendments import Amendment
from automos.review.run_stages import RunStages


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
