"""How sure each point's label is."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.scan import OBJECT


def point_confidence(
    track: npt.NDArray[np.int32],
    track_confidence: npt.NDArray[np.float64],
    score: npt.NDArray[np.uint8],
    kind: npt.NDArray[np.uint8],
) -> npt.NDArray[np.uint8]:
    """Return (M,) uint8, 255 for certain: a moving point's is its track's, a static one's falls with the evidence.

    Ground is certain. What stands on it and was hit again is certain to be static; what nobody looked at again is less
    so (0.75), and what was seen through without being on anything that moves could as well be moving (0.5).

    Parameters
    ----------
    track : (M,) moving track of each point, -1 for none.   track_confidence : (T,) in [0, 1].
    score : (M,) 255 has moved, 0 has stayed, 128 unknown.   kind : (M,) OBJECT, GROUND or EGO_BODY.
    """
    static = np.where(kind == OBJECT, 255.0 - 0.5 * score, 255.0)
    moving = 255.0 * track_confidence[track] if len(track_confidence) else static
    return np.round(np.where(track >= 0, moving, static)).astype(np.uint8)
