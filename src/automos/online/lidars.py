"""What is learnt about the sensor during a stream: the directions of its beams, and the ego body.

The first scan with enough points shows the beams. The ego body is determined in the background from scans some distance
apart, again whenever the path has doubled in length, until everything that may be body was seen from elsewhere.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from automos.candidates.ego_body import MIN_SCANS
from automos.candidates.free_space_view import Lidar, learn_lidars, with_body
from automos.online.inquiry import Inquiry
from automos.scan import Frame, Pose
from automos.settings import CandidatesSettings

PATTERN_POINTS = 1000
"""Points a scan needs to show the sensor's beams."""
APART = 0.6
"""Metres between the scans that show the body, at first: it is looked for once the sensor has come twice its reach."""
MOST_SCANS = 2 * MIN_SCANS
"""That are kept; of more, every second."""
PATIENCE = 1.0
"""Seconds of the stream in which the answer is found."""


class LidarLearner:
    """Learns from the frames of a stream."""

    def __init__(self, settings: CandidatesSettings):
        """Begin with nothing known: `lidars` is empty."""
        self.lidars: list[Lidar] = []
        self._settings = settings
        self._apart: list[Frame] = []
        self._distance = APART
        self._question: Inquiry[list[Lidar]] = Inquiry(PATIENCE)

    def add(self, frame: Frame) -> None:
        """Take the next frame."""
        if not self.lidars:
            if len(frame.points) >= PATTERN_POINTS:
                self.lidars = learn_lidars(_FewFrames([frame]), [frame], self._settings.ego_body, 1)
            return
        found = self._question.answer(frame.stamp)
        if found is not None:
            self.lidars, self._question = found, Inquiry(PATIENCE)
        if self._distance > self._settings.ego_body.max_range or len(frame.points) < PATTERN_POINTS:
            return
        if self._apart and np.linalg.norm(frame.origin_level - self._apart[-1].origin_level) < self._distance:
            return
        self._apart.append(replace(frame))  # a copy without what was computed of it
        is_due = len(self._apart) == (MIN_SCANS + 1 if self._distance == APART else MOST_SCANS)
        if is_due and not self._question.is_asked:
            frames, lidars = _FewFrames(self._apart), self.lidars
            self._question.ask(lambda: with_body(lidars, frames, self._settings.ego_body, 1), frame.stamp)
        if len(self._apart) == MOST_SCANS:
            self._apart, self._distance = self._apart[::2], 2.0 * self._distance

    def forget_poses(self) -> None:
        """Begin anew with frames from now on, because earlier ones lie elsewhere."""
        self._apart, self._distance = [], APART


class _FewFrames:
    """Frames in memory, where the frames of a recording are asked for."""

    def __init__(self, frames: list[Frame]):
        self._frames = list(frames)

    @property
    def T_level_sensor(self) -> Pose:
        return np.array([frame.T_level_sensor for frame in self._frames])

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        return np.array([frame.stamp for frame in self._frames])

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: int) -> Frame:
        return self._frames[index]
