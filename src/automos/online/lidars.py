"""Learns the sensor model during a stream: the directions of the beams, and the ego body.

The first scan with enough points provides the beams; of a LiDAR that has too few in it, a later one. The ego body is
determined in the background from scans some distance apart, again whenever the path has doubled in length, until its
whole range was observed from elsewhere.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from automos.core.beam_pattern import Lidar, is_known, learn_pattern
from automos.core.scan import Frame
from automos.evidence.ego_body import MIN_SCANS
from automos.evidence.observations import learn_lidars, with_body
from automos.odometry.background import DELAY, BackgroundTask
from automos.settings import CandidatesSettings

PATTERN_POINTS = 1000
"""Points that a scan needs to learn the sensor's beams from it."""
MOST_SCANS = 2 * MIN_SCANS
"""Scans that are kept; beyond this, every second one is dropped."""


class LidarLearner:
    """Learns from the frames of a stream."""

    def __init__(self, settings: CandidatesSettings, beside: ThreadPoolExecutor | None = None):
        """Start without knowledge: `lidars` is empty. `beside` is for searches, see `BackgroundTask`."""
        self._beside = beside or ThreadPoolExecutor(1, "beside")
        self.lidars: list[Lidar] = []
        self._settings = settings
        self._apart: list[Frame] = []
        self._distance = self._shortest = settings.ego_body.max_range / 16.0  # metres between them
        self._task: BackgroundTask[list[Lidar]] = BackgroundTask(self._beside)

    def add(self, frame: Frame) -> None:
        """Take the next frame."""
        if not self.lidars:
            if len(frame.points) >= PATTERN_POINTS:
                self.lidars = learn_lidars([frame])
            return
        found = self._task.result(frame.stamp)
        if found is not None:
            self.lidars, self._task = _with_bodies(self.lidars, found), BackgroundTask(self._beside)
        self.lidars = [lidar if is_known(lidar.pattern) else _learnt(lidar, frame) for lidar in self.lidars]
        if self._distance > self._settings.ego_body.max_range or len(frame.points) < PATTERN_POINTS:
            return
        if self._apart and np.linalg.norm(frame.origin_level - self._apart[-1].origin_level) < self._distance:
            return
        self._apart.append(replace(frame))  # a copy without cached results
        is_first = self._distance == self._shortest
        if len(self._apart) == (MIN_SCANS + 1 if is_first else MOST_SCANS) and not self._task.is_started:
            frames, lidars = list(self._apart), self.lidars
            poses = np.array([frame.T_level_sensor for frame in frames])
            self._task = BackgroundTask(self._beside, DELAY if is_first else 2.0 * DELAY)
            self._task.start(lambda: with_body(lidars, frames, poses, self._settings, 1), frame.stamp)
        if len(self._apart) == MOST_SCANS:
            self._apart, self._distance = self._apart[::2], 2.0 * self._distance

    def forget_poses(self) -> None:
        """Restart with later frames, because the poses of earlier ones are outdated; so is a search among them."""
        self._apart, self._distance = [], self._shortest
        self._task = BackgroundTask(self._beside)


def _learnt(lidar: Lidar, frame: Frame) -> Lidar:
    """Return `lidar`, whose pattern was unknown, with that of its points in `frame`, if these are enough."""
    pattern = learn_pattern([frame.of_sensor(lidar.number)[1]])
    return replace(lidar, pattern=pattern, body=None) if is_known(pattern) else lidar


def _with_bodies(lidars: list[Lidar], found: list[Lidar]) -> list[Lidar]:
    """Return `lidars` with the bodies `found`, except where these are in a grid that was replaced since."""
    pairs = zip(lidars, found, strict=True)
    return [replace(now, body=then.body) if now.pattern is then.pattern else now for now, then in pairs]
