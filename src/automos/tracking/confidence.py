"""The confidence of each point's label."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.scan import OBJECT, SPECK

_PRIOR, _WEIGHT = -4.0, 2.0
"""Prior log-odds of moving of a point without an object, and weight of the evidence: in simulated worlds, of the points
without an object 2 in 100 move if no scan reports on them, and 1 in 1000 if they were hit again."""


def point_confidence(
    is_moving: npt.NDArray[np.bool_],
    owner: npt.NDArray[np.int32],
    confidence: npt.NDArray[np.float64],
    log_odds: npt.NDArray[np.floating],
    kind: npt.NDArray[np.uint8],
) -> npt.NDArray[np.uint8]:
    """Return (M,) uint8, 255 for certain: the probability that each point's label is right.

    The points of an object have the confidence of its verdict, ground has 1, and for all other points it follows from
    the evidence.

    Parameters
    ----------
    is_moving : (M,) bool, points labelled moving.
    owner : (M,) int32, track that each point belongs to, moving or not, -1 for none.
    confidence : (T,) float64 in [0, 1], of the verdicts on the tracks.
    log_odds : (M,) float, has moved, against has stayed.   kind : (M,) uint8, OBJECT, GROUND, EGO_BODY or SPECK.
    """
    moves = 1.0 / (1.0 + np.exp(-(_PRIOR + _WEIGHT * log_odds.astype(np.float32))))
    stands = (kind == OBJECT) | (kind == SPECK)
    alone = np.where(stands, 1.0 - moves, 1.0)
    by_track = np.append(confidence, 1.0)[owner]
    return np.round(255.0 * np.where((owner >= 0) & (is_moving | stands), by_track, alone)).astype(np.uint8)
