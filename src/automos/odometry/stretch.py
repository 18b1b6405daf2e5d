"""Consecutive scans as surfels, with the poses and the motion they are believed to have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.odometry.motion import compensate, step_twists
from automos.odometry.surfels import Surfels
from automos.scan import Pose

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Stretch:
    """Consecutive scans as surfels, compensated with the motion they were believed to have.

    Attributes
    ----------
    surfels : N surfels, sensor frame mid-sweep.
    twists : (N, 6) motion per sweep they were compensated with.
    T_world_sensor : (N, 4, 4).
    gaps : (N - 1,) time between scans in units of the usual one.
    period : seconds, the usual time between scans.
    share : sweep duration over the usual time between scans.
    """

    surfels: list[Surfels]
    twists: Array
    T_world_sensor: Pose
    gaps: Array
    period: float
    share: float

    def __len__(self) -> int:
        return len(self.surfels)

    def moved(self, T_world_sensor: Pose) -> Stretch:
        """Return the same scans at other poses, their surfels compensated for the motion these imply."""
        twists = self.share * step_twists(T_world_sensor, self.gaps)
        pieces = zip(self.surfels, twists - self.twists, strict=True)
        surfels = [Surfels(compensate(s.mean, s.time, change), s.covariance, s.count, s.time) for s, change in pieces]
        return Stretch(surfels, twists, T_world_sensor, self.gaps, self.period, self.share)
