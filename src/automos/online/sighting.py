"""The pose and the observations of each scan: everything that needs no comparison with other scans."""

from collections import deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from automos.core.beam_pattern import Lidar
from automos.core.geometry import Array, inverse, turn_and_shift
from automos.core.scan import Frame, Pose, Scan
from automos.evidence.height_map import GroundMap
from automos.evidence.observations import Seen, ground_of, look
from automos.evidence.steady_ground import SCANS_BEFORE, mended
from automos.odometry.compensation import frame_of
from automos.odometry.estimator import Odometry
from automos.odometry.followed import Posed
from automos.odometry.surfels import scan_surfels
from automos.odometry.vertical import level_frame
from automos.online.lidars import LidarLearner
from automos.settings import Settings


@dataclass(frozen=True, eq=False)
class Sighting:
    """The observations of one scan.

    Attributes
    ----------
    stamp : float
        Seconds.
    frame : Frame
        Its points, compensated, level frame.
    seen : Seen, optional
        Its observations; None until the sensor's beams are known.
    lidars : list of Lidar
        Current models of the sensors.
    refined : dict[float, (4, 4) float64]
        T_level_sensor of the last scans, by stamp, as refined with this one.
    doubt : (6,) float64
        Twist by which its own pose may be off.
    again : tuple of Frame
        Earlier scans on the path that will replace the current one, in the level frame before the replacement.
    T_after_before : (4, 4) float64, optional
        From the previous level frame to that of the new path, such that the last scan keeps its pose; None if the path
        was not replaced.
    """

    stamp: float
    frame: Frame
    seen: Seen | None
    lidars: list[Lidar]
    refined: dict[float, Pose]
    doubt: Array
    again: tuple[Frame, ...]
    T_after_before: Pose | None


class Sightings:
    """The sightings of a stream, scan by scan."""

    def __init__(
        self,
        settings: Settings,
        pool: ThreadPoolExecutor,
        is_compensated: bool | None,
        has_stamps: bool,
        T_world_first: Pose | None,
    ):
        """Take the arguments of `Stream`."""
        self.T_level_sensor: Pose = np.eye(4) if T_world_first is None else T_world_first
        self._settings = settings
        beside = ThreadPoolExecutor(1, "beside")
        self._odometry = Odometry(settings.odometry, pool, None, is_compensated, has_stamps=has_stamps, beside=beside)
        self._learner = LidarLearner(settings.candidates, beside)
        self._T_level_world = self.T_level_sensor
        self._is_level = False
        self._grounds = deque[GroundMap](maxlen=SCANS_BEFORE)

    def step(self, scan: Scan) -> Sighting:
        """Return the sighting of the next scan."""
        moved = self._odometry.push(scan)
        again = tuple(self._frame(timed.scan, posed, timed.stamp) for timed, posed in moved.again)
        T_after_before = None
        if moved.T_before_now is not None:
            T_before, self._T_level_world = self._T_level_world, self._T_level_world @ moved.T_before_now
            T_after_before = self._T_level_world @ inverse(T_before)
            self._learner.forget_poses()
            self._grounds.clear()
        if not self._is_level:
            self._find_level(scan, moved.posed)
        frame = self._frame(scan, moved.posed, moved.stamp)
        self.T_level_sensor = frame.T_level_sensor
        self._learner.add(frame)
        lidars = self._learner.lidars
        about = self._settings.candidates.ground
        ground = ground_of(frame, about)
        seen = look(frame, lidars, mended(ground, self._grounds), about) if lidars else None
        self._grounds.append(ground)
        refined = {stamp: self._T_level_world @ T for stamp, T in moved.refined.items()}
        return Sighting(moved.stamp, frame, seen, lidars, refined, moved.posed.doubt, again, T_after_before)

    def _frame(self, scan: Scan, posed: Posed, stamp: float) -> Frame:
        """Return the valid points of `scan`, compensated for the motion during its sweep."""
        T_level_sensor = self._T_level_world @ posed.T_world_sensor
        return frame_of(scan, posed.timing, posed.sweep_motion, T_level_sensor, stamp)

    def _find_level(self, scan: Scan, posed: Posed) -> None:
        """Level the world frame at the first scan with ground."""
        surfels = scan_surfels(scan, posed.sweep_motion, posed.timing, self._settings.odometry)
        T, found, _ = level_frame([(surfels.mean, surfels.covariance)], np.eye(4)[None], self._settings.odometry)
        if found:
            before = self._T_level_world @ posed.T_world_sensor
            self._T_level_world = turn_and_shift(T, before) @ T @ inverse(posed.T_world_sensor)
            self._is_level = True
            self._grounds.clear()
