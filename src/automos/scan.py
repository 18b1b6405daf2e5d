"""Scans and sequences of scans: what every reader gives and every stage takes.

The number and order of a scan's points are the user's and never change. Stages that cannot use some points (NaN, zero
range) work on a :class:`Frame`, which says for each of its points which point of the scan it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol, SupportsFloat

import numpy as np
import numpy.typing as npt

from automos.arrays import hold_array
from automos.errors import InputError
from automos.geometry import adjoint, inverse, is_rigid, transform

Points = npt.NDArray[np.float32]
Pose = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
OBJECT, GROUND, EGO_BODY, SPECK = 0, 1, 2, 3
"""Kinds of points of a frame: what may be an object, and what is none (a speck: a drop, dust, an insect, noise)."""

MIN_RANGE = 0.1
"""Metres. Drivers write "no return" as a point at (or a rounding error from) the origin."""

MAX_RANGE = 20_000.0
"""Metres. No sensor sees as far: what lies beyond is a damaged number, or a map's coordinate."""

LATEST = 1e11
"""Seconds: three thousand years. Larger numbers count milliseconds or less, and are no times."""


@dataclass(frozen=True, eq=False)
class Scan:
    """One sweep of the sensor, in the sensor frame, in the user's order; InputError tells a column that is none.

    Attributes
    ----------
    points : (N, 3) float32, metres, sensor frame. NaN, infinite and zero-range rows are allowed.
    intensity : (N,) float32 or None.
    time : (N,) float32 or None, seconds after the sweep's first point.
    ring : (N,) uint16 or None, beam number.
    stamp : seconds, or None where the recording has no clock.
    name : stem of the file it came from; outputs for this scan carry the same name.
    sensor : (N,) uint8 or None, which of several merged LiDARs measured each point.
    T_scan_sensor : (K, 4, 4) float64, where each of them sits in the frame of `points`; None: rays start at its origin.
    """

    points: Points
    intensity: npt.NDArray[np.float32] | None = None
    time: npt.NDArray[np.float32] | None = None
    ring: npt.NDArray[np.uint16] | None = None
    stamp: float | None = None
    name: str = ""
    sensor: npt.NDArray[np.uint8] | None = None
    T_scan_sensor: Pose | None = None

    def __post_init__(self) -> None:
        hold_array(self, "points", np.float32, ("N", 3))
        for column, dtype in (("intensity", "f4"), ("time", "f4"), ("ring", "u2"), ("sensor", "u1")):
            hold_array(self, column, dtype, (len(self.points),), is_optional=True)
        hold_array(self, "T_scan_sensor", np.float64, ("K", 4, 4), is_optional=True)
        mounts = self.T_scan_sensor
        if self.sensor is None or mounts is None:
            if self.sensor is not mounts:
                raise InputError("sensor and T_scan_sensor go together: who measured a point, and where that sits")
        elif len(self.sensor) and self.sensor.max() >= len(mounts):
            raise InputError(f"sensor names number {self.sensor.max()}, but T_scan_sensor holds {len(mounts)}")
        elif not is_rigid(mounts).all():
            raise InputError("T_scan_sensor holds a transform that is none: rotation and translation in metres only")
        stamp = np.asarray(0.0 if self.stamp is None else self.stamp)
        is_time = isinstance(self.stamp, SupportsFloat | None) and stamp.ndim == 0 and stamp.dtype.kind in "fiubO"
        if not isinstance(self.name, str) or not is_time:
            raise InputError(f"a scan's name is a text and its stamp seconds, got {self.name!r} and {self.stamp!r}")

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        columns = ["x y z", *(name for name in ("intensity", "time", "ring") if getattr(self, name) is not None)]
        return f"<Scan {self.name!r}: {len(self)} points, {' '.join(columns)}>"

    @cached_property
    def is_valid(self) -> Mask:
        """(N,) bool: between MIN_RANGE and MAX_RANGE from the sensor; never where a coordinate is not finite."""
        with np.errstate(over="ignore", invalid="ignore"):  # an overflow is infinite, and too far
            rays = self.points
            if self.sensor is not None and self.T_scan_sensor is not None:
                rays = rays - self.T_scan_sensor[self.sensor, :3, 3].astype(np.float32)
            squared = np.einsum("ij,ij->i", rays, rays)
        return (squared > MIN_RANGE**2) & (squared < MAX_RANGE**2)


class Sequence:
    """Scans in time order. Readers derive from it and fill in what their format has.

    A sequence must be cheap to create and to pickle: it holds paths, not points (`ArraySequence` excepted).
    """

    name: str = "sequence"
    source: Path | None = None

    def __len__(self) -> int:
        raise NotImplementedError

    def __getitem__(self, index: int) -> Scan:
        raise NotImplementedError

    def __iter__(self) -> Iterator[Scan]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        place = "" if self.source is None else f" from {self.source}"
        return f"<{type(self).__name__} {self.name!r}: {len(self)} scans{place}>"

    @property
    def address(self) -> Path | None:
        """What `open_sequence` takes to open it again: `source`, or a place within it."""
        return self.source

    @property
    def names(self) -> list[str]:
        """One name per scan; outputs are named after them."""
        return [f"{i:06d}" for i in range(len(self))]

    @property
    def stamps(self) -> npt.NDArray[np.float64] | None:
        """(len,) seconds, strictly increasing, or None where the recording has no clock."""
        return None

    @property
    def is_compensated(self) -> bool | None:
        """Whether the sensor's motion during the sweep was already taken out; None where the format does not say."""
        return None

    @property
    def reference_poses(self) -> Pose | None:
        """(len, 4, 4) T_world_sensor that came with the recording (not used unless asked for), or None."""
        return None

    @property
    def repeats(self) -> Mask | None:
        """(len,) bool: scans whose points are, one by one, those of the scan before; None where nobody looked."""
        return None

    @property
    def warnings(self) -> list[str]:
        """What the reader found to be wrong with the recording and what it made of that, in sentences."""
        return []

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return the (N,) uint32 SemanticKITTI labels of scan `index` that came with the recording, or None."""
        return None

    def truth_motion(self, index: int) -> npt.NDArray[np.float32] | None:
        """Return (N, 3) metres that each point of scan `index` itself moves until the next scan, in the sensor frame.

        The sensor's own motion is not in it: 0 for what stands, NaN where nobody knows. None without such truth.
        """
        return None

    @property
    def T_vehicle_sensor(self) -> Pose | None:
        """(4, 4) where the sensor sits on its vehicle, if the format's own vectors are in the vehicle's frame."""
        return None

    def fingerprint(self) -> str:
        """Return a text that changes when the recording does; cheap (names, sizes, times, not contents)."""
        return f"{type(self).__name__}:{self.name}:{len(self)}"


@dataclass(frozen=True, eq=False)
class Frame:
    """The valid points of one scan, motion-compensated to its reference time (mid-sweep), with their pose.

    The *level* frame is the world frame turned so that z points up and the ground under the first scan is at z = 0:
    heights, upright boxes and ground live there, so a tilted or upside-down sensor needs no special case.

    Attributes
    ----------
    points : (M, 3) float32, metres, sensor frame at the reference time.
    kept : (M,) int64, index of each point in the user's scan.
    n_points : N, number of points in the user's scan.
    T_level_sensor : (4, 4) float64.
    stamp : seconds.
    sweep_time : (M,) float32 in [-0.5, 0.5], when in the sweep each point was measured; None where unknown.
    sweep_motion : (6,) float64, se(3) motion of the sensor over one sweep, expressed in the sensor frame.
    sensor, T_scan_sensor : (M,) uint8 and (K, 4, 4) float64, as a `Scan` has them: which of several merged LiDARs
        measured each point, and where that sits; None where all rays start at the origin.
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
        """Return the rows of the points that LiDAR `k` measured, and the frame of these alone, in its coordinates."""
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
        """Return (N, ...) `values` of this frame's points at their places in the user's scan, `fill` elsewhere."""
        out = np.full((self.n_points, *values.shape[1:]), fill, values.dtype)
        out[self.kept] = values
        return out


class Frames(Protocol):
    """The frames of a recording: made when asked for, never all in memory."""

    @property
    def T_level_sensor(self) -> Pose:
        """(N, 4, 4) float64, poses of all frames, known without reading any."""

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        """(N,) seconds, of all frames."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> Frame: ...
