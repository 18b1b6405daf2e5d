"""From verdicts to points: every point of a moving segment or in a moving box is moving (paper III-D)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.geometry import Boxes, points_in_boxes
from automos.labels import Label


def paint_points(
    points: npt.NDArray,
    ids: npt.NDArray[np.int32],
    moving_segments: npt.NDArray[np.int64],
    segment_tracks: npt.NDArray[np.int64],
    moving_boxes: Boxes,
    box_tracks: npt.NDArray[np.int64],
    is_ground: npt.NDArray[np.bool_] | None = None,
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.int64]]:
    """Return the labels of one scan's points and the moving track each belongs to.

    Parameters
    ----------
    points : (M, 3) metres, level frame.   ids : (M,) segment of each point, -1 for none.
    moving_segments, segment_tracks : (A,) segments that belong to moving tracks, and those tracks.
    moving_boxes, box_tracks : (B,) boxes of moving tracks in this scan (level frame), and those tracks.
    is_ground : (M,) points that a box does not claim, or None.

    Returns
    -------
    labels : (M,) uint8, Label.STATIC or Label.MOVING.   tracks : (M,) int64, -1 where static.
    """
    track_of = np.full(len(points), -1, np.int64)
    if len(moving_boxes):
        owner = points_in_boxes(points, moving_boxes)
        inside = owner >= 0 if is_ground is None else (owner >= 0) & ~is_ground
        track_of[inside] = box_tracks[owner[inside]]
    if len(moving_segments):
        of_segment = np.full(max(int(ids.max(initial=-1)), int(moving_segments.max())) + 2, -1, np.int64)
        of_segment[moving_segments] = segment_tracks
        mine = of_segment[ids]  # id -1 reads the last entry, which is -1
        track_of[mine >= 0] = mine[mine >= 0]
    return np.where(track_of >= 0, Label.MOVING, Label.STATIC).astype(np.uint8), track_of
