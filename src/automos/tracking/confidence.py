"""How sure each point's label is."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.scan import OBJECT, SPECK

_PRIOR, _WEIGHT = -4.0, 2.0
"""Log-odds of moving of a point that belongs to no object, and what the evidence's count there: of the points of
simulated worlds that are of no object and nobody saw again, 2 of 100 move, of those hit again, 1 of 1000."""


def point_confidence(
    is_moving: npt.NDArray[np.bool_],
    owner: npt.NDArray[np.int32],
    confidence: npt.NDArray[np.float64],
    log_odds: npt.NDArray[np.floating],
    kind: npt.NDArray[np.uint8],
) -> npt.NDArray[np.uint8]:
    """Return (M,) uint8, 255 for certain: the probability that each point's label is right.

    A point of an object is as sure as the verdict on it; ground is certain; of what else stands on it, the evidence
    says.

    Parameters
    ----------
    is_moving : (M,) whether each point is labelled moving.
    owner : (M,) track that each point belongs to, whatever the verdict on it, -1 for none.
    confidence : (T,) in [0, 1], of the verdicts on the tracks.
    log_odds : (M,) has moved, against has stayed.   kind : (M,) OBJECT, GROUND, EGO_BODY or SPECK.
    """
    moves = 1.0 / (1.0 + np.exp(-(_PRIOR + _WEIGHT * log_odds.astype(np.float32))))
    stands = (kind == OBJECT) | (kind == SPECK)
    alone = np.where(stands, 1.0 - moves, 1.0)
    by_track = np.append(confidence, 1.0)[owner]
    return np.round(255.0 * np.where((owner >= 0) & (is_moving | stands), by_track, alone)).astype(np.uint8)
