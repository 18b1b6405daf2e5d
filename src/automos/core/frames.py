"""Frames: the valid points of a scan, motion-compensated, with their pose. Stages work on these."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

from automos.core.arrays import Points, Pose
from automos.core.geometry import adjoint, inverse, transform


@dataclass(frozen=True, eq=False)
class Frame:
    """The valid points of one scan, motion-compensated to its reference time (mid-sweep), with their pose.

    The *level* frame is the world frame turned so that z points up and the ground under the first scan is at z = 0:
    heights, upright boxes and ground live there, so a tilted or upside-down sensor needs no special case.

    Attributes
    ----------
    points : (M, 3) float32
        Metres, sensor frame at the reference time.
    kept : (M,) int64
        Row of each point in the user's scan.
    n_points : int
        N, the number of points in the user's scan.
    T_level_sensor : (4, 4) float64
        Pose of the sensor in the level frame.
    stamp : float
        Seconds.
    sweep_time : (M,) float32, optional
        When each point was measured, in [-0.5, 0.5] of the sweep; None if unknown.
    sweep_motion : (6,) float64, optional
        Motion of the sensor over one sweep as a vector of se(3), in the sensor frame.
    sensor : (M,) uint8, optional
        Which of several merged LiDARs measured each point.
    T_scan_sensor : (K, 4, 4) float64, optional
        Pose of each of these LiDARs in the scan's frame. If not given, all rays start at the origin.
    """

    points: Points
    kept: npt.NDArray[np.int64]
    n_points: int
    T_level_sensor: Pose
    stamp: float
    sweep_time: npt.NDArray[np.float32] | None = None
    sweep_motion: npt.NDArray[np.float64] | None = None
    sensor: npt.NDArray[np.uint8] | None = None
    T_scan_sensor: Pose | None = None

    def of_sensor(self, k: int) -> tuple[npt.NDArray[np.int64] | slice, Frame]:
        """Return the rows of the points of LiDAR `k`, and a frame of these points alone, in its coordinates."""
        if self.sensor is None or self.T_scan_sensor is None:
            return slice(None), self
        rows = np.flatnonzero(self.sensor == k)
        T_sensor_scan = inverse(self.T_scan_sensor[k])
        return rows, Frame(
            points=transform(T_sensor_scan, np.take(self.points, rows, axis=0)),
            kept=self.kept[rows],
            n_points=self.n_points,
            T_level_sensor=self.T_level_sensor @ self.T_scan_sensor[k],
            stamp=self.stamp,
            sweep_time=None if self.sweep_time is None else self.sweep_time[rows],
            sweep_motion=None if self.sweep_motion is None else adjoint(T_sensor_scan) @ self.sweep_motion,
        )

    @cached_property
    def points_level(self) -> Points:
        """(M, 3) float32, metres, level frame."""
        return transform(self.T_level_sensor, self.points)

    @property
    def origin_level(self) -> npt.NDArray[np.float64]:
        """(3,) where the sensor was at the reference time, level frame."""
        return self.T_level_sensor[:3, 3]

    def scatter(self, values: npt.NDArray, fill: float | int = 0) -> npt.NDArray:
        """Return (N, ...) `values` of this frame's points at their rows in the user's scan, `fill` in the others."""
        out = np.full((self.n_points, *values.shape[1:]), fill, values.dtype)
        out[self.kept] = values
        return out


class Frames(Protocol):
    """The frames of a recording: made on demand, never all in memory."""

    @property
    def T_level_sensor(self) -> Pose:
        """(N, 4, 4) float64, poses of all frames, known without reading a scan."""

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        """(N,) seconds, of all frames."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> Frame: ...
