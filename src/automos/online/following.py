"""Tracks of the last seconds, and their current verdicts.

The tracker advances once the evidence of a scan is complete. Later scans are tracked again from there each time, with
the evidence available so far, because the next scan may add to it. Of scans whose evidence is final the probabilities
remain that a track moves and has moved; so what has moved is called moving, however long it waits.
"""

import copy
from collections import deque
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.scan import Mask, Pose
from automos.core.upright_boxes import Boxes
from automos.objects.detections import Detections
from automos.objects.extents import make_whole
from automos.objects.judge import Past, is_scenery, judge_tracks, moving_now, past_of
from automos.objects.looks import MEMORY
from automos.objects.terms import Segments, SegmentTerms, each_for_itself, segment_terms
from automos.objects.tracker import Tracker, can_follow, until_last_seen
from automos.objects.tracking import ENOUGH, SURE, is_small
from automos.objects.tracks import Tracks, observed
from automos.objects.verdict import Verdict, Verdicts
from automos.settings import TrackingSettings

FEW = 3
"""Scans that make a sight of something, or show how the sensor moves: fewer may be one error."""
GROWN = 1.0
"""Seconds after which the evidence of a scan is complete, even if the lag is longer; it is updated for the tracks then,
and halfway, when what creeps and what sets off slowly has left the place behind it. On these seconds a track that was
seen before them is judged, too: what stood and sets off moves, however long it stood."""


@dataclass(frozen=True, eq=False)
class Followed:
    """The objects of one scan.

    Attributes
    ----------
    here : Tracks
        Their rows in that scan; `track` counts from 0 and indexes `verdicts` and `numbers`.
    verdicts : Verdicts
        One for each track.
    numbers : (T,) int64
        Persistent number of each track.
    is_followed : bool
        Whether the scan rate is high enough for reliable tracks.
    """

    here: Tracks
    verdicts: Verdicts
    numbers: npt.NDArray[np.int64]
    is_followed: bool


class Found(NamedTuple):
    """The segments of the scan at `stamp`, seconds.

    is_far : whether some of the scans with which it was compared are a second or more away.
    """

    stamp: float
    segments: Detections
    is_far: bool


@dataclass(frozen=True, eq=False)
class _Step:
    found: Found
    rows: Tracks
    terms: SegmentTerms


class Following:
    """The tracks of one stream."""

    def __init__(self, settings: TrackingSettings, lag: float, first_track: int = 0):
        """Take the settings of the tracker, the lag in seconds, and the number of the first new object."""
        self._settings = settings
        self._memory = max(MEMORY, lag)  # a scan that waits for its lag is still asked for
        self._tracker = Tracker(settings, first_track)
        self._steps: deque[_Step] = deque()
        self._past: dict[int, tuple[float, float, float]] = {}

    @property
    def next_track(self) -> int:
        """Number of the next new object."""
        return self._tracker.next_track

    def add(self, found: Found) -> None:
        """Track all objects into the next scan, whose segments `found` are final."""
        self._steps.append(_next_step(self._tracker, found))

    def move(self, changes: dict[float, Pose]) -> None:
        """Move what was found in earlier scans by `changes`, those of some scans; see `Segmented`."""
        if not changes or not self._steps:
            return
        stamps, times = np.array(list(changes)), np.array([step.found.stamp for step in self._steps])
        of_steps = [changes[stamps[np.argmin(np.abs(stamps - time))]] for time in times]
        self._steps = deque(map(_moved, self._steps, of_steps))
        if len(times) > 1:
            self._tracker.move(of_steps[-2], of_steps[-1], times[-1] - times[-2])

    def renew(self, found: Found) -> None:
        """Update the segments of a scan, if it is still held."""
        for k, step in enumerate(self._steps):
            if step.found.stamp == found.stamp:
                self._steps[k] = replace(step, found=found, terms=segment_terms(found.segments, found.is_far))

    def at(self, stamp: float, ahead: list[Found]) -> Followed:
        """Return the objects of the scan at `stamp`; `ahead` are the segments not added yet."""
        tracker = copy.copy(self._tracker)
        steps = [*self._steps, *(_next_step(tracker, found) for found in ahead)]
        stamps = np.array([step.found.stamp for step in steps])
        scan = int(np.flatnonzero(stamps == stamp)[0])
        is_followed = can_follow(stamps)
        tracks, numbers = _through(steps, scan)
        segments = each_for_itself(Segments.of_scans([step.terms for step in steps]), tracks)
        nothing = (-np.inf, 0.0, 0.0)
        past = Past(*np.array([self._past.get(k, nothing) for k in numbers.tolist()]).reshape(-1, len(nothing)).T)
        verdicts = self._judged(tracks, segments, stamps, stamps > stamp - GROWN, past)
        self._forget(tracks, numbers, segments, stamps, past)
        is_lost = stamps[0] > stamps[-1] - 0.5 * GROWN and _many_move(steps[scan].terms)
        if not is_followed or len(stamps) < FEW or is_lost:  # the sensor's own speed is not known yet
            verdicts = _not_moving(verdicts, verdicts.is_moving)
        kept = ~is_scenery(tracks, verdicts.is_moving, segments)
        rows = np.flatnonzero((tracks.scan == scan) & kept[tracks.track])
        make_whole(tracks, observed(tracks), verdicts.is_moving, segments, stamps)
        return Followed(moving_now(tracks, verdicts, stamps)[rows], verdicts, numbers, is_followed)

    def _judged(
        self,
        tracks: Tracks,
        segments: Segments,
        stamps: npt.NDArray[np.float64],
        is_recent: npt.NDArray[np.bool_],
        past: Past,
    ) -> Verdicts:
        """Return the verdicts on the tracks, moving for those that have moved in their life or in the last second."""
        of_life = judge_tracks(tracks, segments, stamps, past)
        # What was seen half as well as a body may be one, seen so far; its pose and evidence may soon change.
        # At the start everything is young, and nothing can be said of what was there before.
        is_young = is_small(observed(tracks), len(tracks), segments, stamps, 0.5 * ENOUGH)
        is_unsure = is_young & (of_life.confidence < SURE)
        is_new = tracks.scan[tracks.first_rows()] > 0
        of_life = _not_moving(of_life, of_life.is_moving & is_unsure & is_new)
        late = is_recent[tracks.scan]
        n_seen = [np.bincount(tracks.track, part & tracks.is_observed, len(tracks)) for part in (late, ~late)]
        lately = judge_tracks(tracks[np.flatnonzero(late)], segments, stamps, Past.nothing(len(tracks)))
        sets_off = lately.is_moving & (np.minimum(*n_seen) >= FEW) & ~of_life.is_moving
        return Verdicts(
            np.where(sets_off, lately.verdict, of_life.verdict),
            np.where(sets_off, lately.confidence, of_life.confidence),
            of_life.scatter,
        )

    def _forget(
        self,
        tracks: Tracks,
        numbers: npt.NDArray[np.int64],
        segments: Segments,
        stamps: npt.NDArray[np.float64],
        past: Past,
    ) -> None:
        """Drop scans that are too old, but for what they say of the tracks."""
        is_over = stamps < self._steps[-1].found.stamp - self._memory
        if is_over.any():
            past = past_of(tracks, segments, stamps, past, is_over)
            alive = {*self._tracker.numbers.tolist(), *numbers.tolist()}
            self._past = {number: about for number, about in self._past.items() if number in alive}
            about = np.column_stack([past.stamp, past.p_moving, past.p_ever])
            self._past.update(zip(numbers.tolist(), map(tuple, about.tolist()), strict=True))
        for _ in range(np.count_nonzero(is_over)):
            self._steps.popleft()


def _many_move(terms: SegmentTerms) -> bool:
    """Return whether a quarter of a scan's segments seem to move, and more than a few: most of what is seen stands."""
    _, moved, stayed = terms.counts[terms.part_of < 0].T
    return bool((moved > stayed).sum() > max(FEW, (stayed > moved).sum() / 3.0))


def _moved(step: _Step, T: Pose) -> _Step:
    """Return a step whose scan is elsewhere, by `T` (4, 4) of the level frame."""
    found, rows = step.found, step.rows
    found = found._replace(segments=found.segments.moved(T))
    boxes = Boxes(rows.center, rows.size, rows.yaw, np.ones(len(rows.yaw))).transformed(T)
    rows = replace(rows, center=boxes.center, yaw=boxes.yaw, velocity=rows.velocity @ T[:3, :3].T)
    return _Step(found, rows, segment_terms(found.segments, found.is_far))


def _not_moving(verdicts: Verdicts, which: Mask) -> Verdicts:
    """Return the verdicts, static instead of moving for `which` (T,)."""
    p = verdicts.confidence
    verdict = np.where(which, np.int8(Verdict.STATIC), verdicts.verdict)
    return Verdicts(verdict, np.where(which, 1.0 - p, p), verdicts.scatter)


def _next_step(tracker: Tracker, found: Found) -> _Step:
    """Return the next step of `tracker`, which it changes."""
    return _Step(found, tracker.step(found.stamp, found.segments), segment_terms(found.segments, found.is_far))


def _through(steps: list[_Step], scan: int) -> tuple[Tracks, npt.NDArray[np.int64]]:
    """Return all rows of the tracks present in step number `scan`, and the number of each track (T,)."""
    wanted = np.unique(steps[scan].rows.track)
    tables = [step.rows for step in steps]
    track = np.concatenate([table.track for table in tables])
    of_scan = np.repeat(np.arange(len(tables)), [len(table.track) for table in tables])
    rows = np.flatnonzero(np.isin(track, wanted))
    rows = rows[np.argsort(track[rows], kind="stable")]  # by scan they are sorted
    columns = ([getattr(table, name) for table in tables] for name in ("segment", "center", "size", "yaw", "velocity"))
    track = np.searchsorted(wanted, track[rows])
    tracks = until_last_seen(Tracks(track, of_scan[rows], *(np.concatenate(column)[rows] for column in columns)))
    is_there = np.bincount(tracks.track, minlength=len(wanted)) > 0
    return replace(tracks, track=(np.cumsum(is_there) - 1)[tracks.track]), wanted[is_there]
