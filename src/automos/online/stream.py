"""The stages of the method over scans as they come: the same functions, on a window instead of a recording.

A scan is looked at twice. When it arrives, the past alone says which of its points have moved; when later scans have
seen its places, too, the evidence is made again and the tracker moves on over it. With no lag the first is all.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_view import Lidar, Seen, ray_steps
from automos.detections import Detections
from automos.instances.detect import recount
from automos.labels import Label
from automos.online.evidence import EvidenceWindow
from automos.online.following import FEW, Asked, Followed, Following
from automos.online.labelled_scan import LabelledScan, is_unknown, objects_of
from automos.online.renewal import Renewal
from automos.online.sighting import Sighting, Sightings
from automos.scan import Frame, Pose, Scan
from automos.settings import Settings
from automos.stages.candidates import candidates_of
from automos.stages.instances import segment_frame
from automos.stages.labels import label_points
from automos.stages.tracking import TrackedObjects
from automos.workspace import Arrays

_Recounted = Future[tuple[float, Detections, Asked]]
GROWN = 1.0
"""Seconds after which a scan is asked about once more, for the tracks' sake, if it was first asked about before."""
AGAIN = 3
"""Scans that are asked about once more with every scan that comes, where the sensor's path turned out to be another."""
SETTLED = 1.0
"""Seconds after which the evidence of a scan is complete enough, however long labels may wait."""


@dataclass(eq=False)
class _Held:
    """A scan that was not given back yet, or whose evidence is not complete."""

    number: int
    stamp: float
    frame: Frame
    seen: Seen | None = None
    about: Arrays | None = None
    segments: Arrays | None = None
    n_asked: int = 0
    is_settled: bool = False

    @property
    def detections(self) -> Detections:
        return Detections.from_arrays(self.segments or {})


class Stream:
    """Scans of one sensor without longer interruptions."""

    def __init__(
        self,
        settings: Settings,
        lag: float,
        pool: ThreadPoolExecutor,
        is_compensated: bool | None = None,
        T_world_first: Pose | None = None,
        first_track: int = 0,
    ):
        """Take what `Labeler` takes, threads, and where an earlier stream has ended, which this one goes on from."""
        self._settings, self._lag, self._pool = settings, lag, pool
        self._settle = min(lag, SETTLED)
        self._sightings = Sightings(settings, pool, is_compensated, T_world_first)
        self._window = EvidenceWindow(settings.candidates.free_space)
        self._renewal = Renewal(settings.candidates.ground, pool)
        self._following = Following(settings.tracking, first_track)
        self._held: deque[_Held] = deque()
        self._growing: deque[_Held] = deque()
        self._doubted: deque[_Held] = deque()
        self._start = np.inf
        self._lidars: list[Lidar] = []

    @property
    def next_track(self) -> int:
        """The number that the next new object gets."""
        return self._following.next_track

    @property
    def T_world_sensor(self) -> Pose:
        """(4, 4) the latest scan's pose."""
        return self._sightings.T_level_sensor

    def sight(self, scan: Scan) -> Sighting:
        """Return what `scan`, which has points and a stamp, tells before earlier ones are labelled."""
        return self._sightings.step(scan)

    def push(self, number: int, scan: Scan, sighted: Sighting | None = None) -> Iterator[LabelledScan]:
        """Yield the scans whose lag is over with this one, which is `number`.

        Parameters
        ----------
        sighted : what `sight` has returned of it, if it was asked ahead.
        """
        grown = self._grow(scan.stamp)
        sighted = sighted or self.sight(scan)
        self._start = min(self._start, sighted.stamp)
        self._renew(sighted)
        grown += self._doubt()
        held = _Held(number, sighted.stamp, sighted.frame, sighted.seen)
        self._held.append(held)
        self._lidars = sighted.lidars
        if held.seen is not None:
            self._window.add(held.stamp, held.seen)
        self._find_segments(held)
        for done in grown:
            self._following.renew(*done.result())
        yield from self._give_back(held.stamp)

    def _renew(self, sighted: Sighting) -> None:
        """Make anew what earlier scans saw, while another path catches up; take all of it over once it has."""
        for frame in sighted.again:
            is_held = any(held.stamp == frame.stamp for held in (*self._held, *self._growing))
            self._renewal.add(frame, self._lidars, is_held)
        if sighted.T_after_before is None:
            return
        frames = self._renewal.take_over(sighted.T_after_before, self._window)
        for held in (*self._held, *self._growing):
            if held.stamp in frames:
                held.frame, held.seen = frames[held.stamp]
        self._doubted = deque(self._growing)

    def _grow(self, now: float | None) -> list[_Recounted]:
        """Ask about scans some time ago once more, beside what else is done meanwhile."""
        asked = []
        while self._growing and now is not None and self._growing[0].stamp <= now - GROWN:
            held = self._growing.popleft()
            asked += self._ask_again(held, Asked(len(self._window), is_far=True, is_past=False))
        return asked

    def _doubt(self) -> list[_Recounted]:
        """Ask once more about the last scans, if few could be asked or they were thought to lie elsewhere."""
        n, asked = len(self._window), []
        few = [held for held in self._growing if held.n_asked < FEW <= n]
        doubted = [self._doubted.popleft() for _ in range(min(AGAIN, len(self._doubted)))]
        for held in few or doubted:
            held.n_asked = n
            asked += self._ask_again(held, Asked(n, self._is_far(held), is_past=True))
        return asked

    def _ask_again(self, held: _Held, asked: Asked) -> list[_Recounted]:
        if held.seen is None or held.segments is None:
            return []
        question = self._window.question(held.stamp, held.seen)

        def recounted(segments: Arrays = held.segments) -> tuple[float, Detections, Asked]:
            ids, stayed, about = segments["ids"], segments["stayed"], self._settings.instances.components
            return held.stamp, recount(Detections.from_arrays(segments), ids, stayed, question(None).net, about), asked

        return [self._pool.submit(recounted)]

    def _is_far(self, held: _Held) -> bool:
        """Whether others from a second or more are asked about a scan."""
        return self._settle > 0.0 or held.stamp - self._start >= GROWN

    def finish(self) -> Iterator[LabelledScan]:
        """Yield the rest."""
        if self._held:
            yield from self._give_back(np.inf)

    def _find_segments(self, held: _Held) -> None:
        """Make the scan's evidence and segments from all scans that are remembered."""
        if held.seen is None:
            return
        held.n_asked = len(self._window) - 1
        evidence = self._window.question(held.stamp, held.seen)(self._pool)
        steps = ray_steps(self._lidars)
        held.about = candidates_of(evidence.net, evidence.kind, evidence.height, evidence.solidity, steps)
        held.segments = segment_frame(self._settings.instances, (held.frame, held.about))

    def _give_back(self, now: float) -> Iterator[LabelledScan]:
        for held in self._held:
            if not held.is_settled and held.stamp <= now - self._settle + 1e-6:
                if self._settle > 0.0:
                    self._find_segments(held)
                if held.segments is not None:
                    asked = Asked(held.n_asked, self._is_far(held), is_past=self._settle == 0.0)
                    self._following.add(held.stamp, held.detections, asked)
                    if self._settle < GROWN:
                        self._growing.append(held)
                held.is_settled = True
        while self._held and self._held[0].stamp <= now - self._lag + 1e-6:
            yield self._paint(self._held[0])
            self._held.popleft()
        self._window.forget(min([now, *(held.stamp for held in (*self._held, *self._growing))]))

    def _paint(self, held: _Held) -> LabelledScan:
        frame = held.frame
        if held.segments is None or held.about is None:
            return LabelledScan.of_nothing(held.number, held.stamp, frame.T_level_sensor, frame.n_points)
        ahead = [(h.stamp, h.detections) for h in self._held if not h.is_settled and h.segments is not None]
        followed = self._following.at(held.stamp, ahead)
        judged = TrackedObjects(followed.here, followed.verdicts)
        painted = label_points(
            frame, held.about, held.segments, followed.here, judged, self._settings, followed.is_followed
        )
        labels, track = painted["label"], painted["track"]
        unknown = is_unknown(held.about, held.segments)
        labels[frame.kept[unknown & (labels[frame.kept] == Label.STATIC)]] = Label.UNLABELED
        track_ids = np.append(followed.numbers, -1).astype(np.int32)[track]
        confidence = painted["confidence"].astype(np.float32) / np.float32(255.0)
        objects = _objects(followed, np.unique(track[track >= 0]))
        return LabelledScan(held.number, held.stamp, frame.T_level_sensor, labels, track_ids, confidence, objects)


def _objects(followed: Followed, moving: npt.NDArray[np.int64]) -> npt.NDArray:
    """Return the boxes and velocities of the tracks `moving` in this scan."""
    here = followed.here[np.flatnonzero(np.isin(followed.here.track, moving))]
    return objects_of(replace(here, track=followed.numbers[here.track]))
