"""From verdicts to points: every point of a moving segment or in a moving box is moving (paper III-D)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.labels import Label
from automos.tracking.tracks import Tracks
from automos.upright_boxes import points_in_boxes


def paint_points(
    points: npt.NDArray, ids: npt.NDArray[np.int32], moving: Tracks
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.int32]]:
    """Return the labels of one scan's points and the moving track each belongs to.

    A segment's own points go to its track even where another track's box holds them too.

    Parameters
    ----------
    points : (M, 3) metres, level frame.
    ids : (M,) segment of each point, -1 for none.
    moving : the rows of moving tracks in this scan, observed or predicted.

    Returns
    -------
    labels : (M,) uint8, Label.STATIC or Label.MOVING.   tracks : (M,) int32, -1 where static.
    """
    owner = points_in_boxes(points, moving.boxes)
    track_of = np.append(moving.track, -1)[owner].astype(np.int32)  # owner -1 reads the -1 at the end
    track_of_segment = np.full(int(ids.max(initial=-1)) + 2, -1, np.int32)
    seen = moving.is_observed
    track_of_segment[moving.segment[seen]] = moving.track[seen]
    own = track_of_segment[ids]
    track_of = np.where(own >= 0, own, track_of)
    return np.where(track_of >= 0, Label.MOVING, Label.STATIC).astype(np.uint8), track_of
