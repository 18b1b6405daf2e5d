"""Tracks one segment that a person selected.

Usually the evidence limits the tracker: segments said to have stayed are excluded, and segments said to have moved may
be fast. Here a person has said that the object moves, so the evidence is ignored: all segments are allowed, each may be
fast, and the continuation is chosen by motion, size and number of points alone.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from automos.objects.detections import Detections
from automos.objects.tracker import track_objects
from automos.objects.tracks import Tracks
from automos.settings import TrackingSettings

FIRST_WINDOW = 5.0
"""Seconds looked ahead at first; as long as the thing is still there at the end, twice as many are."""
REACH = 60.0
"""Metres a second around the segment within which others are looked at: nothing on a road is faster."""
WIDTH = 10.0
"""Metres around it at any rate, so that its neighbours are followed too and none is taken for it."""


@dataclass(frozen=True, eq=False)
class Heading:
    """Where something is likely to be: its velocity (2,), and by how much that may change, metres per second."""

    velocity: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    may_change: float = REACH


Detect = Callable[[int], Detections]
Path = dict[int, tuple[int, npt.NDArray[np.float64]]]
"""By scan, ascending: the segment, -1 if it was out of sight, and the box (7,): centre, size, yaw."""


def follow_segment(
    detect: Detect, stamps: npt.NDArray[np.float64], scan: int, segment: int, settings: TrackingSettings
) -> Path:
    """Return where segment `segment` of scan `scan` was before and after.

    Parameters
    ----------
    detect : Detect
        Gives the segments of a scan by its index.
    stamps : (N,) float64
        Seconds.
    """
    ahead = follow_ahead(detect, stamps, scan, segment, settings, 1)
    behind = follow_ahead(detect, stamps, scan, segment, settings, -1)
    return dict(sorted({**behind, **ahead}.items()))


def follow_ahead(
    detect: Detect,
    stamps: npt.NDArray[np.float64],
    scan: int,
    segment: int,
    settings: TrackingSettings,
    step: int,
    heading: Heading | None = None,
    window: float = FIRST_WINDOW,
) -> Path:
    """Return the path from `scan` on, forwards (`step` 1) or backwards (-1).

    A known `heading` saves time, and so do fewer seconds looked ahead at first, `window`, where it mostly ends soon.
    """
    last = len(stamps) - 1 if step > 0 else 0
    while True:
        end = scan
        while end != last and abs(stamps[end + step] - stamps[scan]) <= window:
            end += step
        scans = list(range(scan, end + step, step))
        rows, kept = _follow(detect, np.abs(stamps - stamps[scan]), scans, segment, settings, heading or Heading())
        if end == last or abs(stamps[scans[rows.scan[-1]]] - stamps[end]) > settings.max_gap:
            break
        window *= 2.0
    found = {}
    for row in range(len(rows.scan)):
        box = np.array([*rows.center[row], *rows.size[row], rows.yaw[row]])
        own = -1
        if rows.segment[row] >= 0:
            own = int(kept[rows.scan[row]][rows.segment[row]])
            seen = detect(scans[rows.scan[row]]).boxes  # the segment's own extent, not the filter's
            box = np.array([*seen.center[own], *seen.size[own], seen.yaw[own]])
        found[scans[rows.scan[row]]] = own, box
    return found


def _follow(
    detect: Detect,
    away: npt.NDArray[np.float64],
    scans: list[int],
    segment: int,
    settings: TrackingSettings,
    heading: Heading,
) -> tuple[Tracks, list[npt.NDArray[np.int64]]]:
    """Return the track of the segment through `scans`, and of each of these which segments were looked at."""
    start = detect(scans[0]).boxes.center[segment, :2]
    offered, kept = [], []
    for i in scans:
        found = detect(i)
        off = found.boxes.center[:, :2] - start - heading.velocity * away[i]
        near = np.linalg.norm(off, axis=1) <= WIDTH + heading.may_change * away[i]
        rows = np.flatnonzero(near)
        kept.append(rows)
        offered.append((float(away[i]), _without_evidence(found[rows])))
    tracks = track_objects(offered, settings)
    pointed_at = int(np.searchsorted(kept[0], segment))
    row = int(np.flatnonzero((tracks.scan == 0) & (tracks.segment == pointed_at))[0])
    return tracks[np.arange(len(tracks.track))[tracks.rows_of(int(tracks.track[row]))]], kept


def _without_evidence(found: Detections) -> Detections:
    n = len(found)
    return replace(
        found,
        n_moving=found.n_points,
        n_static=np.zeros(n),
        has_stayed=np.zeros(n, np.bool_),
        part_of=np.full(n, -1, np.int32),
    )
