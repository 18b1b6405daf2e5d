"""Scans and sequences of scans: what every reader returns and every stage takes.

The number and order of the points of a scan never change. Stages that cannot use some points (NaN, zero range) work on
a :class:`Frame`, which stores the row of each of its points in the scan.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import SupportsFloat

import numpy as np
import numpy.typing as npt

from automos.core.arrays import Array as Array
from automos.core.arrays import Ints as Ints
from automos.core.arrays import Mask, Points, Pose, hold_array
from automos.core.errors import InputError
from automos.core.frames import Frame as Frame
from automos.core.frames import Frames as Frames
from automos.core.geometry import inverse, is_rigid, transform, with_exact_rotations
from automos.core.upright_boxes import TrueBoxes

OBJECT, GROUND, EGO_BODY, SPECK = range(4)
"""Kinds of points of a frame: what may be an object, and what is none (a speck: a drop, dust, an insect, noise)."""
MIN_RANGE = 0.1
"""Metres. Drivers write "no return" as a point at (or a rounding error from) the origin."""
MAX_RANGE = 20_000.0
"""Metres. No sensor sees as far: what lies beyond is a damaged number, or a map's coordinate."""
LATEST = 1e11
"""Seconds: three thousand years. Larger numbers count milliseconds or less, and are not times."""


@dataclass(frozen=True, eq=False)
class Scan:
    """One sweep of the sensor, in the sensor frame, in the user's order of points.

    Attributes
    ----------
    points : (N, 3) float32
        Metres, sensor frame. NaN, infinite and zero-range rows are allowed.
    intensity : (N,) float32, optional
        Reflectance, in the unit of the recording.
    time : (N,) float32, optional
        Seconds after the first point of the sweep.
    ring : (N,) uint16, optional
        Beam number.
    stamp : float, optional
        Seconds; None if the recording has no clock.
    name : str
        Stem of the file it came from; results of this scan have the same name.
    sensor : (N,) uint8, optional
        Which of several merged LiDARs measured each point.
    T_scan_sensor : (K, 4, 4) float64, optional
        Pose of each of these LiDARs in the frame of `points`. If not given, rays start at the origin.

    Raises
    ------
    InputError
        An array has the wrong shape or type, or only one of `sensor` and `T_scan_sensor` is given.

    Examples
    --------
    >>> import numpy as np
    >>> import automos
    >>> automos.Scan(np.zeros((100, 3)), intensity=np.ones(100), stamp=0.1, name="000001")
    <Scan '000001': 100 points, x y z intensity>
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
        else:
            object.__setattr__(self, "T_scan_sensor", with_exact_rotations(mounts))
        stamp = np.asarray(0.0 if self.stamp is None else self.stamp)
        is_time = isinstance(self.stamp, SupportsFloat | None) and stamp.ndim == 0 and stamp.dtype.kind in "fiubO"
        if not isinstance(self.name, str) or not is_time:
            given = f"{self.name!r:.80} and {self.stamp!r:.80}"
            raise InputError(f"a scan's name is a text and its stamp seconds, got {given}")

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        columns = ["x y z", *(name for name in ("intensity", "time", "ring") if getattr(self, name) is not None)]
        return f"<Scan {self.name!r}: {len(self)} points, {' '.join(columns)}>"

    @cached_property
    def rays(self) -> Points:
        """(N, 3) float32, metres: each point in the frame of the LiDAR that measured it; `points` if there is one."""
        if self.sensor is None or self.T_scan_sensor is None:
            return self.points
        rays = np.empty_like(self.points)
        for k, T_sensor_scan in enumerate(inverse(self.T_scan_sensor)):
            rows = np.flatnonzero(self.sensor == k)
            rays[rows] = transform(T_sensor_scan, self.points[rows])
        return rays

    @property
    def n_sensors(self) -> int:
        """Number of LiDARs that measured it, 1 if it names none."""
        return 1 if self.T_scan_sensor is None else len(self.T_scan_sensor)

    def of_sensor(self, k: int) -> tuple[npt.NDArray[np.int64] | slice, Scan]:
        """Return the rows of the points of LiDAR `k`, and a scan of these points alone, in its coordinates."""
        if self.sensor is None or self.T_scan_sensor is None:
            return slice(None), self
        rows = np.flatnonzero(self.sensor == k)
        names = ("intensity", "time", "ring")
        columns = {name: None if (all_of := getattr(self, name)) is None else all_of[rows] for name in names}
        return rows, Scan(self.rays[rows], stamp=self.stamp, name=self.name, **columns)

    @cached_property
    def is_valid(self) -> Mask:
        """(N,) bool: between MIN_RANGE and MAX_RANGE from the sensor; never where a coordinate is not finite."""
        with np.errstate(over="ignore", invalid="ignore"):  # an overflow is infinite, and too far
            squared = np.einsum("ij,ij->i", self.rays, self.rays)
        return (squared > MIN_RANGE**2) & (squared < MAX_RANGE**2)


class Sequence:
    """Scans in time order. Readers derive from it and override what their format provides.

    A sequence must be cheap to create and to pickle: it holds paths, not points (except `ArraySequence`). Scans are
    read in several threads and, from copies, in other processes; of a class of your own, in one thread at a time.

    Attributes
    ----------
    name : str
        Name of the recording.
    source : Path, optional
        Where it was read from.
    """

    name: str = "sequence"
    source: Path | None = None

    def __len__(self) -> int:
        raise NotImplementedError

    def __getitem__(self, index: int) -> Scan:
        raise NotImplementedError

    def _scan_number(self, index: int) -> int:
        """Return the number of scan `index`, which may count from the end; IndexError where there is none such.

        Readers call it first. A part of a recording would need its times, poses and truth, too: InputError for a slice.
        """
        found = range(len(self))[index]
        if isinstance(found, range):
            raise InputError(f"a recording gives one scan at a time: write [recording[i] for i in {found}]")
        return found

    def __iter__(self) -> Iterator[Scan]:
        return map(self.__getitem__, range(len(self)))

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
        """(len,) seconds, strictly increasing, or None if the recording has no clock."""
        return None

    @property
    def about(self) -> dict[str, str]:
        """What is known of how it was recorded, in words: `files`, `times` (where stamps are from), `frame`."""
        return {}

    @property
    def is_compensated(self) -> bool | None:
        """Whether scans are already motion-compensated; None if the format does not say."""
        return None

    @property
    def reference_poses(self) -> Pose | None:
        """(len, 4, 4) T_world_sensor that came with the recording (not used unless asked for), or None."""
        return None

    @property
    def repeats(self) -> Mask | None:
        """(len,) bool: scans that are identical to the one before; None if this was not checked."""
        return None

    @property
    def warnings(self) -> list[str]:
        """What is wrong with the recording and how the reader handled it, in sentences."""
        return []

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return the (N,) uint32 SemanticKITTI labels of scan `index` that came with the recording, or None."""
        return None

    def truth_motion(self, index: int) -> npt.NDArray[np.float32] | None:
        """Return the true motion of each point of scan `index` until the next scan, or None.

        Returns
        -------
        (N, 3) float32 or None
            Metres, sensor frame, without the sensor's own motion: 0 for static points, NaN where it is unknown.
        """
        return None

    def truth_boxes(self, index: int) -> TrueBoxes | None:
        """Return the true boxes of scan `index` that came with the recording, or None."""
        return None

    @property
    def T_vehicle_sensor(self) -> Pose | None:
        """(4, 4) where the sensor sits on its vehicle, if the format's own vectors are in the vehicle's frame."""
        return None

    def fingerprint(self) -> str:
        """Return a string that changes when the recording does; cheap (names, sizes and times, not contents)."""
        return f"{type(self).__name__}:{self.name}:{len(self)}"
