"""A voxel map of the last scans for registration with a large search range, as in KISS-ICP (Vizzo et al., 2023)."""

from __future__ import annotations

from collections import deque

import numpy as np

from automos.core.geometry import transform
from automos.core.scan import Points, Pose
from automos.odometry.kiss import UNKNOWN_MOTION, empty_map
from automos.odometry.registration import Icp
from automos.odometry.surfels import Surfels
from automos.settings import OdometrySettings

N_SCANS = 10
"""Past scans in the map."""


class NearMap:
    """Holds the last scans and builds a map of them only when needed."""

    def __init__(self, settings: OdometrySettings):
        self._settings = settings
        self._scans: deque[tuple[Pose, Points]] = deque(maxlen=N_SCANS)

    def add(self, T_world_sensor: Pose, surfels: Surfels) -> None:
        """Store a scan with its pose."""
        self._scans.append((T_world_sensor, surfels.mean))

    def register(self, surfels: Surfels, expected: Pose) -> Pose:
        """Return the (4, 4) T_world_sensor of a scan, starting from `expected`."""
        local_map = empty_map(self._settings)
        for T, points in self._scans:
            local_map.add(transform(T, points.astype(np.float64)), T[:3, 3])
        return Icp(local_map, UNKNOWN_MOTION).register(surfels.mean, expected)
