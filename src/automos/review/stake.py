"""What is at stake with each track: the labels that depend on its verdict, and how doubtful the verdict is.

The doubtful points of a track are the expected number of wrong labels: its points times the probability that its
verdict is wrong. Sorted by this number, the queue starts where a minute corrects most, and shows when to stop.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.objects.verdict import Verdict
from automos.review.run_stages import RunStages

ENOUGH = 0.8
"""Share of the doubtful points that the list holds: what is left is sure, one by one, and not worth a look."""


@dataclass(frozen=True, eq=False)
class Stakes:
    """What is at stake with each track, a row each.

    Attributes
    ----------
    points : (T,) float64
        How many points its segments have in all scans.
    doubt : (T,) float64
        In [0, 1], the chance that its verdict is wrong.
    """

    points: npt.NDArray[np.float64]
    doubt: npt.NDArray[np.float64]

    @property
    def doubtful(self) -> npt.NDArray[np.float64]:
        """(T,) points whose label may be expected to be wrong."""
        return self.points * self.doubt


def weigh(stages: RunStages) -> Stakes:
    """Return what is at stake with every track that a run found.

    What was seen once has no motion that could be judged, and its confidence, one half, says only that; what the
    evidence says of its points is said of it as of any track that stayed: a half of those that have moved.
    """
    tracks, n = stages.tracks, len(stages.tracks)
    counts = stages.objects.counts
    of_track, has_moved = (_counted(stages) if counts is None else counts).T
    seen = np.bincount(tracks.track, tracks.is_observed, n)
    doubt = 1.0 - stages.verdicts.confidence
    is_glimpse = (seen < 2) & (stages.verdicts.verdict != Verdict.MOVING)
    doubt = np.where(is_glimpse, 0.5 * has_moved / np.maximum(of_track, 1.0), doubt)
    return Stakes(of_track.astype(np.float64), np.clip(doubt, 0.0, 1.0))


def _counted(stages: RunStages) -> npt.NDArray[np.float64]:
    """Return (T, 2) the points of each track over its life, and those that have moved, read from every scan."""
    tracks = stages.tracks
    counts = np.zeros((len(tracks.track), 2))
    for name, rows in zip(stages.names, tracks.rows_by_scan(len(stages.names)), strict=True):
        rows = rows[tracks.is_observed[rows]]
        found = stages.stage("instances").load(name, "n_points", "n_moving")
        counts[rows] = np.stack([found[key][tracks.segment[rows]] for key in ("n_points", "n_moving")], axis=1)
    return np.stack([np.bincount(tracks.track, column, len(tracks)) for column in counts.T], axis=1)


def most_telling(doubtful: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.int64], int]:
    """Return the order of what holds most doubtful points first, and how many hold `ENOUGH` of all of them.

    doubtful : (K,) points.
    """
    order = np.argsort(-doubtful, kind="stable")
    total = doubtful.sum()
    if not total:
        return order, 0
    return order, int(np.searchsorted(np.cumsum(doubtful[order]), ENOUGH * total * (1.0 - 1e-12))) + 1
