"""The last scans as a voxel map on which a scan is registered from further off, with KISS-ICP (Vizzo et al., 2023)."""

from __future__ import annotations

from collections import deque

import numpy as np

from automos.odometry.kiss import KissOdometry
from automos.odometry.motion import SweepTiming
from automos.odometry.surfels import Surfels
from automos.scan import Points, Pose, Scan
from automos.settings import OdometrySettings

N_SCANS = 10
"""Of the past that make the map."""


class NearMap:
    """Keeps the last scans and makes a map of them only when it is needed."""

    def __init__(self, settings: OdometrySettings):
        self._settings = settings
        self._scans: deque[tuple[Pose, Points]] = deque(maxlen=N_SCANS)

    def add(self, T_world_sensor: Pose, surfels: Surfels) -> None:
        """Remember a scan at its pose."""
        self._scans.append((T_world_sensor, surfels.mean))

    def register(self, surfels: Surfels, expected: Pose) -> Pose:
        """Return the (4, 4) T_world_sensor of a scan that is expected about `expected`."""
        odometry = KissOdometry(self._settings, SweepTiming(), np.zeros(6), self._settings.initial_threshold)
        for T, points in self._scans:
            odometry.add_to_map(points, T)
        return odometry.register_at(Scan(surfels.mean), expected)
