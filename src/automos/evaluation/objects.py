"""Whether one mover is one object: movers whole, missed, split or merged, and the association score of LSTQ.

IoU counts points, and a near van has a hundred times the points of a far pedestrian; who uses boxes, tracks or scene
flow sees objects. All measures are of *moving* tracks, over points whose truth is known.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.evaluation.moving import ratio
from automos.evaluation.overlaps import NO_TRACK, NOT_MOVING, STANDS, Ints, Overlaps, detections, hota, identity

FOUND = 0.5
"""Share of its points, called moving, below which a mover is missed."""
WHOLE = 0.8
"""Share of a mover's points that its one track holds, and share of that track's points that are the mover's."""
SIZES = (300, 3000)
"""Points over the recording of the movers that are counted: from a far pedestrian on, and from a car near by."""
OUTCOMES = ("whole", "missed", "split", "merged")


@dataclass(frozen=True, eq=False)
class Movers:
    """The true movers, a row each.

    Attributes
    ----------
    label : (K,) int64
        Increasing: class and instance id as the truth packs them.
    n_scans, n_points, n_found : (K,) int64
        Scans it was seen in, its points, and those called moving.
    best : (K,) int64
        The track that holds most of its points, `NO_TRACK` without one.
    share, purity : (K,) float64
        Share of its points that its best track holds, and of that track's points that are its own.
    association : (K,) float64
        Mean, over its points, of the IoU of the tracks they are on with it, as tubes in space and time (Aygun et al.,
        4D Panoptic LiDAR Segmentation, CVPR 2021); 1 is perfect.
    """

    label: Ints
    n_scans: Ints
    n_points: Ints
    n_found: Ints
    best: Ints
    share: npt.NDArray[np.float64]
    purity: npt.NDArray[np.float64]
    association: npt.NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.label)

    @property
    def recall(self) -> npt.NDArray[np.float64]:
        """(K,) share of its points that are called moving."""
        return self.n_found / self.n_points

    @property
    def outcome(self) -> npt.NDArray[np.int64]:
        """(K,) index into `OUTCOMES`: whole, missed, split (found, but no track has it), merged (the rest)."""
        return np.select([self.recall < FOUND, self.share < WHOLE, self.purity < WHOLE], [1, 2, 3], 0)


def movers_of(overlaps: Overlaps) -> Movers:
    """Return every true mover of a recording, and what became of it."""
    on = overlaps[overlaps.mover > STANDS]
    label, n_points = on.total(("mover",))
    n_scans = np.unique(np.stack([on.mover, on.scan]), axis=1)[0]
    mover, track, shared = on.total(("mover", "track"))
    found = np.bincount(np.searchsorted(label, mover), np.where(track > NOT_MOVING, shared, 0), len(label))
    kept = track > NO_TRACK
    row, track, shared = np.searchsorted(label, mover[kept]), track[kept], shared[kept]
    ids, of_track = overlaps[overlaps.track > NO_TRACK].total(("track",))
    size = of_track[np.searchsorted(ids, track)]
    association = np.bincount(row, shared**2 / (n_points[row] + size - shared), len(label)) / np.maximum(n_points, 1)
    first = np.lexsort((-shared, row))[np.searchsorted(np.sort(row), np.unique(row))]  # of each, what shares most
    best, share, purity = np.zeros(len(label), np.int64), np.zeros(len(label)), np.zeros(len(label))
    best[row[first]], share[row[first]] = track[first], shared[first] / n_points[row[first]]
    purity[row[first]] = shared[first] / size[first]
    seen = np.bincount(np.searchsorted(label, n_scans), minlength=len(label))
    return Movers(label, seen, n_points, found.astype(np.int64), best, share, purity, association)


@dataclass(frozen=True)
class TrackCounts:
    """How many moving tracks there are on movers and elsewhere, and moving points that are on no track.

    Attributes
    ----------
    on_movers, elsewhere : int
        Tracks that have most of their judged points on one mover, and the others.
    covered : int
        Movers that have such a track.
    unowned_on, moving_on, unowned_elsewhere, moving_elsewhere : int
        Points called moving on movers and elsewhere, and those of them on no track.
    """

    on_movers: int
    elsewhere: int
    covered: int
    unowned_on: int
    moving_on: int
    unowned_elsewhere: int
    moving_elsewhere: int

    @property
    def per_mover(self) -> float:
        """Tracks on movers for each mover that has any, 1 at best; nan without one."""
        return ratio(self.on_movers, self.covered)


def count_tracks(overlaps: Overlaps) -> TrackCounts:
    """Return where the moving tracks of a recording are."""
    moving = overlaps[overlaps.track > NOT_MOVING]
    mover, track, shared = moving[moving.track > NO_TRACK].total(("mover", "track"))
    ids, row = np.unique(track, return_inverse=True)
    size = np.bincount(row, shared, len(ids))
    is_on = (mover > STANDS) & (shared > 0.5 * size[row])
    is_unowned, is_off = moving.track == NO_TRACK, moving.mover == STANDS

    def points(rows: npt.NDArray[np.bool_]) -> int:
        return int(moving.n_points[rows].sum())

    return TrackCounts(
        on_movers=int(is_on.sum()),
        elsewhere=len(ids) - int(is_on.sum()),
        covered=len(np.unique(mover[is_on])),
        unowned_on=points(is_unowned & ~is_off),
        moving_on=points(~is_off),
        unowned_elsewhere=points(is_unowned & is_off),
        moving_elsewhere=points(is_off),
    )


def outcomes(movers: Movers, least: int) -> dict[str, int]:
    """Return how many movers of `least` points and more are whole, missed, split and merged."""
    counts = np.bincount(movers.outcome[movers.n_points >= least], minlength=len(OUTCOMES))
    return dict(zip(OUTCOMES, counts.tolist(), strict=True))


def association(movers: Movers) -> float:
    """Return S_assoc: the mean of the association over movers of `SIZES[0]` points and more; nan without any."""
    large = movers.association[movers.n_points >= SIZES[0]]
    return float(large.mean()) if len(large) else float("nan")


def scores_of_objects(overlaps: Overlaps) -> dict[str, Any]:
    """Return all measures of a recording's objects, or of several `pooled`, as plain numbers, nan if undefined."""
    movers, tracks, found = movers_of(overlaps), count_tracks(overlaps), detections(overlaps)
    return {
        "movers": {f"{least}+ points": outcomes(movers, least) for least in SIZES},
        "association": association(movers),
        "tracks_per_mover": tracks.per_mover,
        "tracks_elsewhere": tracks.elsewhere,
        "unowned_on_movers": ratio(tracks.unowned_on, tracks.moving_on),
        "unowned_elsewhere": ratio(tracks.unowned_elsewhere, tracks.moving_elsewhere),
        **hota(found),
        **identity(found),
    }
