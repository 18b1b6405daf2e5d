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

from automos.candidates.free_space_view import Seen, learn_lidars, look, ray_steps
from automos.detections import Detections
from automos.geometry import make_transform
from automos.instances.detect import recount
from automos.labels import Label
from automos.odometry.level import level_frame
from automos.odometry.motion import usable_points
from automos.odometry.trajectory import frame_of
from automos.online.evidence import EvidenceWindow
from automos.online.following import Followed, Following
from automos.online.labelled_scan import LabelledScan, objects_of
from automos.online.odometry import CausalOdometry, Moved, Remade
from automos.scan import OBJECT, Frame, Pose, Scan
from automos.settings import Settings
from automos.stages import candidates_of, paint_frame, segment_frame
from automos.workspace import Arrays

GROWN = 1.0
"""Seconds after which a scan is asked about once more, for the tracks' sake, if it was first asked about before."""
TIMING_SCANS = 16
"""Scans in which the sensor moves, after which it is found out how sweeps are timed."""
PATTERN_POINTS = 1000
"""Points a scan needs to show the sensor's beams."""
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
        self._odometry = CausalOdometry(settings.odometry, TIMING_SCANS, None, is_compensated)
        self._T_level_sensor: Pose = np.eye(4) if T_world_first is None else T_world_first
        self._is_level = False
        self._window: EvidenceWindow | None = None
        self._ray_steps = np.zeros(2)
        self._following = Following(settings.tracking, first_track)
        self._held: deque[_Held] = deque()
        self._growing: deque[_Held] = deque()
        self._start = np.inf

    @property
    def next_track(self) -> int:
        """The number that the next new object gets."""
        return self._following.next_track

    @property
    def T_world_sensor(self) -> Pose:
        """(4, 4) the latest scan's pose."""
        return self._T_level_sensor

    def push(self, number: int, scan: Scan) -> Iterator[LabelledScan]:
        """Yield the scans whose lag is over with this one, which is `number` and has points and a stamp."""
        moved = self._odometry.step(scan)
        self._T_level_sensor = self._T_level_sensor @ moved.T_last_this
        if not self._is_level:
            self._find_level(scan, moved)
        self._start = min(self._start, moved.stamp)
        if moved.remade:
            self._remake(moved)
        grown = self._grow(moved.stamp)
        held = _Held(number, moved.stamp, _make_frame(scan, moved, self._T_level_sensor))
        self._held.append(held)
        self._look(held)
        if self._window is not None:
            self._find_segments(held)
        for done in grown:
            self._following.renew(*done.result())
        yield from self._give_back(held.stamp)

    def _remake(self, moved: Moved) -> None:
        """Take the last scans as they are known now: what they saw, and those that wait."""
        for again in moved.remade:
            frame = _make_frame(again.scan, again, self._T_level_sensor @ again.T_now_then)
            seen = None if self._window is None else look(frame, self._window.lidars, self._settings.candidates.ground)
            if self._window is not None and seen is not None:
                self._window.replace(again.stamp, seen)
            for held in (*self._held, *self._growing):
                if held.stamp == again.stamp:
                    held.frame, held.seen = frame, seen

    def _grow(self, now: float) -> list[Future[tuple[float, Detections]]]:
        """Ask about scans some time ago once more, beside what else is done meanwhile."""
        asked = []
        while self._growing and self._growing[0].stamp <= now - GROWN:
            asked.append(self._pool.submit(self._recount, self._growing.popleft()))
        return asked

    def _recount(self, held: _Held) -> tuple[float, Detections]:
        assert self._window is not None
        assert held.seen is not None
        assert held.segments is not None
        evidence = self._window.ask(held.stamp, held.seen, shared=False)
        ids, stayed, about = held.segments["ids"], held.segments["stayed"], self._settings.instances.components
        return held.stamp, recount(held.detections, ids, stayed, evidence.net, about)

    def finish(self) -> Iterator[LabelledScan]:
        """Yield the rest."""
        if self._held:
            yield from self._give_back(np.inf)

    def _find_level(self, scan: Scan, moved: Moved) -> None:
        """Turn the world upright at the first scan that shows the ground."""
        points, _ = usable_points(scan, moved.timing, moved.sweep_motion, self._settings.odometry)
        T, found = level_frame([points], np.eye(4)[None], self._settings.odometry)
        if found:
            before = self._T_level_sensor
            turn = np.arctan2(before[1, 0], before[0, 0]) - np.arctan2(T[1, 0], T[0, 0])
            c, s = np.cos(turn), np.sin(turn)
            self._T_level_sensor = make_transform([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ T
            self._T_level_sensor[:2, 3] = before[:2, 3]
            self._is_level = True

    def _look(self, held: _Held) -> None:
        """Note what the scan saw; the first that shows the sensor's beams says how they lie."""
        about = self._settings.candidates
        if self._window is None:
            if len(held.frame.points) < PATTERN_POINTS:
                return
            frames = _OneFrame(held.frame)
            lidars = learn_lidars(frames, [held.frame], about.ego_body, 1)
            self._window = EvidenceWindow(about.free_space, lidars, self._pool)
            self._ray_steps = ray_steps(lidars)
        held.seen = look(held.frame, self._window.lidars, about.ground)
        self._window.add(held.stamp, held.seen)

    def _find_segments(self, held: _Held) -> None:
        """Make the scan's evidence and segments from all scans that are remembered."""
        if held.seen is None or self._window is None:
            return
        evidence = self._window.ask(held.stamp, held.seen)
        held.about = candidates_of(evidence.net, evidence.kind, evidence.height, evidence.solidity, self._ray_steps)
        held.segments = segment_frame(self._settings.instances, (held.frame, held.about))

    def _give_back(self, now: float) -> Iterator[LabelledScan]:
        for held in self._held:
            if not held.is_settled and held.stamp <= now - self._settle + 1e-6:
                if self._settle > 0.0:
                    self._find_segments(held)
                if held.segments is not None:
                    is_asked = self._settle > 0.0 or held.stamp - self._start >= GROWN
                    self._following.add(held.stamp, held.detections, is_asked)
                    if self._settle < GROWN:
                        self._growing.append(held)
                held.is_settled = True
        while self._held and self._held[0].stamp <= now - self._lag + 1e-6:
            yield self._paint(self._held[0])
            self._held.popleft()
        if self._window is not None:
            waiting = [held.stamp for held in (*self._held, *self._growing)]
            self._window.forget(min([now, *waiting]))

    def _paint(self, held: _Held) -> LabelledScan:
        frame = held.frame
        if held.segments is None or held.about is None:
            return LabelledScan.of_nothing(held.number, held.stamp, frame.T_level_sensor, frame.n_points)
        ahead = [(h.stamp, h.detections) for h in self._held if not h.is_settled and h.segments is not None]
        followed = self._following.at(held.stamp, ahead)
        painted = paint_frame(
            frame,
            held.about,
            held.segments,
            followed.here,
            followed.verdicts,
            None,
            self._settings,
            followed.is_followed,
        )
        labels, track = painted["label"], painted["track"]
        unknown = _is_unknown(held.about, held.segments)
        labels[frame.kept[unknown & (labels[frame.kept] == Label.STATIC)]] = Label.UNLABELED
        track_ids = np.append(followed.numbers, -1).astype(np.int32)[track]
        confidence = painted["confidence"].astype(np.float32) / np.float32(255.0)
        objects = _objects(followed, np.unique(track[track >= 0]))
        return LabelledScan(held.number, held.stamp, frame.T_level_sensor, labels, track_ids, confidence, objects)


class _OneFrame:
    """A single frame where the frames of a recording are asked for."""

    def __init__(self, frame: Frame):
        self._frame = frame

    @property
    def T_level_sensor(self) -> Pose:
        return self._frame.T_level_sensor[None]

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        return np.array([self._frame.stamp])

    def __len__(self) -> int:
        return 1

    def __getitem__(self, index: int) -> Frame:
        return self._frame


def _make_frame(scan: Scan, moved: Moved | Remade, T_level_sensor: Pose) -> Frame:
    """Return the valid points of `scan`, compensated for the motion during its sweep."""
    return frame_of(scan, moved.timing, moved.sweep_motion, T_level_sensor, moved.stamp)


def _is_unknown(about: Arrays, segments: Arrays) -> npt.NDArray[np.bool_]:
    """Return (M,) which points nothing is known of: no scan has seen their place, nor any of what they belong to."""
    found = Detections.from_arrays(segments)
    spoken = np.append(found.n_moving + found.n_static > 0.0, False)  # the last entry is for id -1
    is_silent = about["log_odds"] == 0.0
    return (about["kind"] == OBJECT) & is_silent & ~spoken[segments["ids"]] & ~spoken[segments["stayed"]]


def _objects(followed: Followed, moving: npt.NDArray[np.int64]) -> npt.NDArray:
    """Return the boxes and velocities of the tracks `moving` in this scan."""
    here = followed.here[np.flatnonzero(np.isin(followed.here.track, moving))]
    return objects_of(replace(here, track=followed.numbers[here.track]))
