"""From verdicts to points: every point of a moving segment or in a moving box is moving (paper III-D)."""

import numpy as np
import numpy.typing as npt

from automos.core.upright_boxes import points_in_boxes
from automos.objects.tracks import Tracks


def paint_points(points: npt.NDArray, ids: npt.NDArray[np.int32], moving: Tracks) -> npt.NDArray[np.int32]:
    """Return (M,) int32 the moving track that each of one scan's points belongs to, -1 for none.

    The points of a segment are assigned to its track even if the box of another track contains them.

    Parameters
    ----------
    points : (M, 3) float, metres, level frame.
    ids : (M,) int32, segment of each point, -1 for none.
    moving : Tracks, the rows of moving tracks in this scan, observed or predicted.
    """
    owner = points_in_boxes(points, moving.boxes)
    track_of = np.append(moving.track, -1)[owner].astype(np.int32)  # owner -1 reads the -1 at the end
    # In `default`, segments that have stayed as a whole are numbered after those in `ids`.
    n = max(int(ids.max(initial=-1)), int(moving.segment.max(initial=-1))) + 1
    track_of_segment = np.full(n + 1, -1, np.int32)  # the last entry is for id -1
    seen = moving.is_observed
    track_of_segment[moving.segment[seen]] = moving.track[seen]
    own = track_of_segment[ids]
    return np.where(own >= 0, own, track_of)
