"""What is known of a scan before and after it is followed."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import numpy.typing as npt

from automos.core.scan import Pose, Scan
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.window import Window

Stamped = tuple[Window, list[float]]
"""Scans, and their stamps in seconds."""


@dataclass(frozen=True, eq=False)
class TimedScan:
    """A scan, read when needed, with its stamp (s), its gap to the previous one in periods, and the period (s)."""

    read: Callable[[], Scan]
    stamp: float
    gap: float
    period: float

    @property
    def scan(self) -> Scan:
        """The scan."""
        return self.read()


@dataclass(frozen=True, eq=False)
class Posed:
    """The pose of a scan.

    Attributes
    ----------
    T_world_sensor : (4, 4) float64
        In the path's own world.
    timing : SweepTiming
        Source of the point times.
    sweep_motion : (6,) float64
        Motion during the sweep, for its compensation.
    doubt : (6,) float64
        Twist by which the scan before was refined with this one: about as much as this one is off.
    """

    T_world_sensor: Pose
    timing: SweepTiming
    sweep_motion: npt.NDArray[np.float64]
    doubt: npt.NDArray[np.float64] = field(default_factory=partial(np.zeros, 6))


Followed = tuple[TimedScan, Posed]
"""A scan and where it was found."""
