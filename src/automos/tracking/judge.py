"""Has it moved? What the evidence and the motion of a track say together (the `default` preset's verdict)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from automos.detections import Detections
from automos.settings import JudgeSettings
from automos.tracking.tracks import Tracks
from automos.tracking.verdict import Verdict, Verdicts

LOW_PERCENTILE = 20
"""Of a vehicle whose foot is hidden mostly, or whose ground is misjudged, some scans show it on the ground."""


def judge_by_evidence(
    tracks: Tracks,
    detections: Sequence[Detections],
    stamps: npt.NDArray[np.float64],
    sensor: npt.NDArray[np.float64],
    settings: JudgeSettings,
) -> Verdicts:
    """Return moving for tracks whose places were seen empty and that went somewhere.

    Static things are seen through too: foliage, edges, thin poles. But only part of their points are, and what is left
    of them does not travel: their speed is not significant against its own scatter and their path turns back on
    itself. A track therefore moves if most of its points have moved, or fewer have and its motion is significant and
    straight; it must have left its place either way. Of a tram more or less is in sight from scan to scan, so that what
    is seen of it may even stand while it passes: of something long, what the evidence says in most scans is enough.
    What is seen twice or thrice must not flicker. Of sparse tracks, a few points a scan, and of those of pieces, from
    which what has stayed was taken out, more is asked: they must be seen in most scans, and go straight; of glimpses,
    that nearly all of their points have moved. Nothing climbs farther than it goes, or hovers. What keeps its
    place beside the sensor is part of the vehicle itself.

    stamps : (N,) seconds.   sensor : (N, 3) metres, where the sensor was, level frame.
    """
    n = len(tracks)
    evidence = _rows(tracks, detections)
    verdict, confidence = np.full(n, Verdict.STATIC, np.int8), np.ones(n)
    for k in range(n):
        rows = tracks.rows_of(k)
        seen = tracks.is_observed[rows]
        center, size, points, moved, stayed, is_piece, lift = (column[rows][seen] for column in evidence)
        if len(center) < 2:
            confidence[k] = 0.5
            continue
        share = moved.sum() / points.sum()
        scans, whole = tracks.scan[rows][seen], _seen_alike(size, settings)
        significance, straightness, distance = motion(center[whole, :2], stamps[scans[whole]], settings)
        is_witnessed = (
            moved.sum() >= settings.min_moved_points
            and moved.sum() > settings.min_share * (moved.sum() + stayed.sum())
            and (moved > 0.5 * points).sum() >= settings.min_moved_scans
        )
        is_long = size[:, :2].max() >= settings.long_side
        passes_by = is_long and np.median(moved / np.maximum(moved + stayed, 1.0)) >= settings.long_share
        goes_somewhere = distance > settings.min_distance and (
            share >= settings.sure_share
            or (significance >= settings.min_significance and straightness >= settings.min_straightness)
        )
        is_known = len(center) >= settings.sparse_min_observations
        is_present = len(center) >= settings.sparse_min_presence * (scans[-1] - scans[0] + 1)
        is_sparse = np.median(points) < (settings.sparse_pieces if is_piece.mean() > 0.5 else settings.sparse_points)
        is_steady = is_known and is_present and straightness >= settings.sparse_min_straightness
        is_glimpse = np.median(points) < settings.glimpse_points and len(center) < settings.glimpse_observations
        is_clear = len(center) >= settings.glimpse_min_observations and share >= settings.glimpse_min_share
        if (
            is_witnessed
            and (goes_somewhere or passes_by)
            and (is_known or is_present)
            and (is_steady or not is_sparse)
            and (is_clear or not is_glimpse)
            and np.percentile(lift, LOW_PERCENTILE) <= settings.max_lift
            and abs(np.subtract(*_ends(center[:, 2]))) <= max(settings.max_climb, distance)
            and not _is_carried(center, size, sensor[scans], settings)
        ):
            verdict[k] = Verdict.MOVING
        confidence[k] = (
            _confidence(share, significance, settings) if verdict[k] == Verdict.MOVING else 1.0 - 0.5 * share
        )
    return Verdicts(verdict, confidence)


def _seen_alike(size: npt.NDArray[np.float64], settings: JudgeSettings) -> npt.NDArray[np.int64]:
    """Return the observations in which as much was seen as usual: a piece's middle is not the object's.

    All of them where most are unlike each other.
    """
    side = size[:, :2].max(axis=1)
    usual = np.median(side)
    alike = np.flatnonzero(np.abs(side - usual) <= settings.alike * (usual + 1.0))
    return alike if len(alike) > 0.5 * len(side) and len(alike) > 1 else np.arange(len(side))


def motion(
    center: npt.NDArray[np.float64], stamps: npt.NDArray[np.float64], settings: JudgeSettings
) -> tuple[float, float, float]:
    """Return how significant, how straight and how far the motion along `center` (T, 2) was.

    Significance is the speed of a straight line fitted to the centres over its standard error, which counts the
    scatter about the line and at least the settings' noise; straightness is the distance over the length of the path,
    whose corners are means over a while, so that someone who stands does not walk by the scatter of his box.
    """
    block = np.floor((stamps - stamps[0]) / settings.block).astype(np.int64)
    _, block, n = np.unique(block, return_inverse=True, return_counts=True)
    if len(n) < 4:  # too short a time to walk astray
        block, n = np.arange(len(center)), np.ones(len(center), np.int64)
    way = np.column_stack([np.bincount(block, center[:, axis]) / n for axis in range(2)])
    steps = np.linalg.norm(np.diff(way, axis=0), axis=1).sum()
    straightness = np.linalg.norm(way[-1] - way[0]) / max(steps, 1e-6)
    first, last = _ends(center)
    distance = float(np.linalg.norm(last - first))
    t = stamps - stamps.mean()
    spread = float(t @ t)
    velocity = t @ center / spread
    scatter = center - center.mean(axis=0) - t[:, None] * velocity
    error = np.sqrt(((scatter**2).sum(axis=1).mean() + settings.noise**2) / spread)
    return float(np.linalg.norm(velocity) / error), float(straightness), distance


def _ends(path: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return where `path` (T, ...) begins and ends: one observation of something else at an end is no way."""
    n = 3 if len(path) >= 6 else 1
    return np.median(path[:n], axis=0), np.median(path[-n:], axis=0)


def _is_carried(
    center: npt.NDArray[np.float64],
    size: npt.NDArray[np.float64],
    sensor: npt.NDArray[np.float64],
    settings: JudgeSettings,
) -> bool:
    """Return whether `center` (T, 3) kept its distance to the moving `sensor` (T, 3), as parts of its vehicle do.

    They are near as a whole: a lorry beside the sensor may keep its distance for long, too.
    """
    if np.linalg.norm(sensor[-1] - sensor[0]) < settings.carried_travel:
        return False
    distance = np.linalg.norm(center[:, :2] - sensor[:, :2], axis=1)
    reach = distance + 0.5 * size[:, :2].max(axis=1)
    spread = np.median(np.abs(distance - np.median(distance)))
    return bool(np.median(reach) < settings.carried_reach and spread < settings.carried_spread)


def _confidence(share: float, significance: float, settings: JudgeSettings) -> float:
    by_evidence = share / (share + (1.0 - settings.sure_share))
    by_motion = significance / (significance + settings.min_significance)
    return float(1.0 - (1.0 - by_evidence) * (1.0 - by_motion))


def _rows(tracks: Tracks, detections: Sequence[Detections]) -> list[npt.NDArray[np.float64]]:
    """Return centre, size (R, 3), points, moved, stayed, if it is a piece, lift (R,) of each row's segment; else 0."""
    (center, size), counts = np.zeros((2, len(tracks.track), 3)), np.zeros((5, len(tracks.track)))
    seen = np.flatnonzero(tracks.is_observed)
    order = seen[np.argsort(tracks.scan[seen], kind="stable")]
    first = np.searchsorted(tracks.scan[order], np.arange(len(detections) + 1))
    for scan, found in enumerate(detections):
        rows = order[first[scan] : first[scan + 1]]
        segment = tracks.segment[rows]
        center[rows], size[rows] = found.boxes.center[segment], found.boxes.size[segment]
        counts[:3, rows] = found.n_points[segment], found.n_moving[segment], found.n_static[segment]
        counts[3, rows], counts[4, rows] = found.part_of[segment] >= 0, found.lift[segment]
    return [center, size, *counts]
