"""LMNet on the robot: a scan in, a label for each of its points out, from the present and the past alone.

segmenter = OnlineSegmenter(load_network(weights), settings)
for scan in robot:
    labels = segmenter.step(scan)      # (N,) uint8, 9 static, 251 moving, 0 for points that are none
"""

import time
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import numpy as np
import numpy.typing as npt

from automos.core.geometry import inverse
from automos.core.labels import Label
from automos.core.scan import Frame, Points, Pose, Scan
from automos.network.cleanup import vote
from automos.network.deployed import Deployed
from automos.network.images import MIN_RANGE, SPACING, Window, make_image, pick_past
from automos.network.projection import ImageGrid
from automos.network.recordings import measure_grid
from automos.odometry.compensation import frame_of
from automos.odometry.estimator import Odometry
from automos.odometry.sweep_timing import SweepTiming
from automos.settings import Settings

STAGES = ("odometry", "image", "network", "clean-up")

_PATTERN_POINTS = 1000
"""Points a scan needs to show the sensor's beams."""


class OnlineSegmenter:
    """Labels scans as they come.

    Attributes
    ----------
    seconds : what each of `STAGES` took, for the latest thousand scans.
    T_world_sensor : (4, 4), the latest scan's pose in the frame of the first.
    """

    def __init__(
        self,
        network: Deployed,
        settings: Settings,
        timing: SweepTiming | None = None,
        is_compensated: bool | None = None,
    ):
        """Take the network, and how the sensor's sweeps are timed where that is known (else it is found out)."""
        self._network = network
        self._odometry = Odometry(settings.odometry, ThreadPoolExecutor(1), timing, is_compensated)
        self._grid: ImageGrid | None = None
        self._past: deque[tuple[Points, Pose, float]] = deque()  # thinned points, T_world_sensor, stamp
        self.T_world_sensor: Pose = np.eye(4)
        self._T_world_path: Pose = np.eye(4)
        self.seconds = {stage: deque[float](maxlen=1000) for stage in STAGES}

    def step(self, scan: Scan) -> npt.NDArray[np.uint8]:
        """Return the label of each point (N,) uint8, in the scan's order."""
        return self.segment(scan)[0]

    def segment(self, scan: Scan) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]:
        """Return the label (N,) uint8 and the probability of moving (N,) float32 of each point."""
        with self._timed("odometry"):
            moved = self._odometry.push(scan)
            if moved.T_before_now is not None:
                self._T_world_path = self._T_world_path @ moved.T_before_now
            self.T_world_sensor = self._T_world_path @ moved.posed.T_world_sensor
            # its valid points, compensated for the motion during its sweep
            frame = frame_of(scan, moved.posed.timing, moved.posed.sweep_motion, np.eye(4), moved.stamp)
        labels, probability = np.zeros(len(scan), np.uint8), np.zeros(len(scan), np.float32)
        if self._grid is None and len(frame.points) >= _PATTERN_POINTS:
            self._grid = measure_grid([frame], self._network.image)  # the first scan that shows the sensor's beams
        if self._grid is None:
            return labels, probability
        with self._timed("image"):
            window = self._window(frame)
            image = make_image(window, self._grid)
        with self._timed("network"):
            moving = np.zeros_like(image.channels[0])
            if 2 * sum(points is not None for points in window.past) >= len(window.past):  # as `with_past`
                # what is too near for residuals was not seen to move, whatever it looks like
                moving = self._network.run(image.channels) * (image.channels[0] > MIN_RANGE)
        with self._timed("clean-up"):
            share, mean = vote(image, moving)
            labels[frame.kept] = np.where(share > 0.5, Label.MOVING, Label.STATIC)
            probability[frame.kept] = mean
            self._remember(frame.points[image.shown], moved.stamp)
        return labels, probability

    def _window(self, frame: Frame) -> Window:
        n = self._network.image.residuals
        past = list(self._past)[::-1]  # the latest first
        chosen = pick_past(frame.stamp - np.array([stamp for _, _, stamp in past]), n)
        T_sensor_world = inverse(self.T_world_sensor)
        T_now_past = [np.eye(4) if k < 0 else T_sensor_world @ past[k][1] for k in chosen]
        clouds = tuple(None if k < 0 else past[k][0] for k in chosen)
        return Window(frame.points, clouds, np.array(T_now_past).reshape(-1, 4, 4))

    def _remember(self, points: Points, stamp: float) -> None:
        self._past.append((points, self.T_world_sensor, stamp))
        reach = SPACING * (self._network.image.residuals + 1)
        while self._past and self._past[0][2] < stamp - 1.001 * reach:
            self._past.popleft()

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.seconds[stage].append(time.perf_counter() - start)
