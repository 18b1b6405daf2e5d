"""Tracks one segment that a person selected.

Usually the evidence limits the tracker: segments said to have stayed are excluded, and segments said to have moved may
be fast. Here a person has said that the object moves, so the evidence is ignored: all segments are allowed, each may be
fast, and the continuation is chosen by motion, size and number of points alone.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from automos.core.geometry import Array
from automos.objects.detections import Detections
from automos.objects.tracker import Tracker
from automos.review.box_rows import as_rows
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

    velocity: Array = field(default_factory=lambda: np.zeros(2))
    may_change: float = REACH


Detect = Callable[[int], Detections]
Path = dict[int, tuple[int, Array]]
"""By scan, ascending: the segment, -1 if it was out of sight, and the box (7,): centre, size, yaw."""


def follow_segment(
    detect: Detect, stamps: Array, scan: int, segment: int, settings: TrackingSettings, most: int | None = None
) -> Path:
    """Return where segment `segment` of scan `scan` was before and after, in `most` scans each way.

    Parameters
    ----------
    detect : Detect
        Gives the segments of a scan by its index.
    stamps : (N,) float64
        Seconds.
    """
    ahead = follow_ahead(detect, stamps, scan, segment, settings, 1, most=most)
    behind = follow_ahead(detect, stamps, scan, segment, settings, -1, most=most)
    return dict(sorted({**behind, **ahead}.items()))


def follow_ahead(
    detect: Detect,
    stamps: Array,
    scan: int,
    segment: int,
    settings: TrackingSettings,
    step: int,
    heading: Heading | None = None,
    window: float = FIRST_WINDOW,
    most: int | None = None,
) -> Path:
    """Return the path from `scan` on, forwards (`step` 1) or backwards (-1), in `most` scans if that is given.

    A known `heading` saves time: fewer neighbours are followed with it. The object is gone once it is out of sight at
    the end of `window` seconds, or twice, four times as many, or once the tracker gives it up.
    """
    heading, away = heading or Heading(), np.abs(stamps - stamps[scan])
    start, tracker, track = detect(scan).boxes.center[segment, :2], Tracker(settings), -1
    found: Path = {}
    missed: Path = {}
    seen = scan
    for i in range(scan, len(stamps) if step > 0 else -1, step)[:most]:
        if away[i] > window and abs(stamps[seen] - stamps[i - step]) > settings.max_gap:
            break
        while away[i] > window:
            window *= 2.0
        ahead = detect(i)
        off = np.linalg.norm(ahead.boxes.center[:, :2] - (start + heading.velocity * away[i]), axis=1)
        offered = np.flatnonzero(off <= WIDTH + heading.may_change * away[i])
        if i == scan:
            track = int(np.searchsorted(offered, segment))  # the first scan's objects are numbered as they come
        rows = tracker.step(float(away[i]), _without_evidence(ahead[offered]))
        if track not in rows.track:
            break
        row = int(np.argmax(rows.track == track))
        if rows.segment[row] < 0:
            missed[i] = -1, as_rows(rows.boxes)[row]
            continue
        own = int(offered[rows.segment[row]])  # the segment's own extent, not the filter's
        found |= {**missed, i: (own, as_rows(ahead.boxes)[own])}
        missed, seen = {}, i
    return found


def _without_evidence(found: Detections) -> Detections:
    n = len(found)
    return replace(
        found,
        n_moving=found.n_points,
        n_static=np.zeros(n),
        has_stayed=np.zeros(n, np.bool_),
        part_of=np.full(n, -1, np.int32),
    )
