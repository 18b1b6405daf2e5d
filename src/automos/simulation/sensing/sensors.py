"""LiDARs as their makers publish them: beam elevations, azimuth step, rate, reach and noise.

Sources: Velodyne's manuals of the HDL-64E S2, HDL-32E, VLP-16 and VLS-128; Ouster's OS1 datasheet (uniform 45 degrees,
mode 1024 x 10); Livox's Avia manual (70.4 x 77.2 degrees, 240 000 points/s, six lines). Livox publishes no beam angles:
the rosette is that of two equal prisms that turn at 7294 and -4664 rpm, stretched to the published field of view.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

Array32 = npt.NDArray[np.float32]

SECTORS = 256
"""Into how many sectors of azimuth the beams of a sweep are sorted."""


@dataclass(frozen=True, eq=False)
class Sensor:
    """A LiDAR.

    Attributes
    ----------
    name : str
        As its maker writes it.
    elevations : floating array
        Degrees of each beam, in ring order (from the top down for spinning sensors); empty for a rosette.
    columns : int
        Firings per sweep and beam (spinning), or firings per sweep and line (rosette).
    period : float
        Seconds per sweep.
    turn : int
        +1 turns counter-clockwise seen from above, -1 clockwise; a sweep starts and ends at the back.
    stagger : tuple of float
        Degrees by which the azimuths of successive beams differ, repeated over the beams.
    reach : float
        Metres at which a surface of 10 % reflectivity is still seen every other time.
    max_range, min_range : float
        Metres.
    noise : float
        Metres, standard deviation of one range measurement.
    ring_bias : float
        Metres, standard deviation of the beams' constant range errors left by calibration.
    divergence : float
        Radians, full angle of a beam.
    height : float
        Metres above the ground where it is usually mounted.
    forward : float
        Metres ahead of the vehicle's middle.
    organised : bool
        Missing returns are kept as points at the origin, beam by beam.
    levels : int
        Steps of its intensity scale.
    rosette : (width, height) float, optional
        The field of view in degrees, for a sensor that does not spin; else None.
    """

    name: str
    elevations: npt.NDArray[np.floating]
    columns: int
    reach: float
    max_range: float
    min_range: float
    period: float = 0.1
    noise: float = 0.012
    ring_bias: float = 0.005
    divergence: float = 0.003
    height: float = 1.8
    forward: float = 0.0
    turn: int = -1
    stagger: tuple[float, ...] = (0.0,)
    organised: bool = False
    levels: int = 255
    rosette: tuple[float, float] | None = None

    @property
    def beams(self) -> int:
        """Number of beams (lines for a rosette)."""
        return len(self.elevations)

    def pattern(self, sweep: int) -> Pattern:
        """Return the beams of one sweep in the order in which they are fired."""
        return _pattern(self, sweep if self.rosette else 0)


@dataclass(frozen=True, eq=False)
class Pattern:
    """The beams of one sweep.

    Attributes
    ----------
    direction : (N, 3) float32 unit vectors, sensor frame.
    phase : (N,) float32 in [-0.5, 0.5), when in the sweep.
    ring : (N,) uint16.
    column : (N,) int32, number of the firing.
    """

    direction: Array32
    phase: Array32
    ring: npt.NDArray[np.uint16]
    column: npt.NDArray[np.int32]

    @cached_property
    def by_sector(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Rows sorted by the sector of azimuth they point into, (N,), and where each sector's start, (SECTORS + 1,).

        Sectors go from azimuth 0 on, counter-clockwise.
        """
        turn = np.arctan2(self.direction[:, 1], self.direction[:, 0]) / (2.0 * np.pi)
        sector = np.floor(turn * SECTORS).astype(np.int64) % SECTORS
        starts = np.cumsum(np.bincount(sector, minlength=SECTORS))
        return np.argsort(sector, kind="stable"), np.concatenate([[0], starts])


PRISMS = (7294.0 / 60.0, -4664.0 / 60.0)
"""Turns per second of the two prisms of a rosette."""


@lru_cache(maxsize=4)
def _pattern(sensor: Sensor, sweep: int) -> Pattern:
    column = np.repeat(np.arange(sensor.columns, dtype=np.int32), sensor.beams)
    ring = np.tile(np.arange(sensor.beams, dtype=np.uint16), sensor.columns)
    phase = (column + 0.5) / sensor.columns - 0.5
    elevation = np.radians(sensor.elevations[ring])
    if sensor.rosette is None:
        azimuth = sensor.turn * 2.0 * np.pi * phase + np.radians(np.resize(sensor.stagger, sensor.beams)[ring])
    else:
        width, height = np.radians(sensor.rosette)
        time = (sweep + phase) * sensor.period
        a, b = (2.0 * np.pi * rate * time for rate in PRISMS)
        azimuth = 0.25 * width * (np.cos(a) + np.cos(b))
        elevation += 0.25 * height * (np.sin(a) + np.sin(b))
    level = np.cos(elevation)
    direction = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1)
    return Pattern(direction.astype(np.float32), phase.astype(np.float32), ring, column)


_HDL_64E = np.concatenate([2.0 - np.arange(32) / 3.0, -8.83 - 0.5 * np.arange(32)])
_ABOVE = np.array([15.0, 11.75, 9.7, 8.43, 7.58, 6.98, 6.48, 6.08, 5.73, 5.43, 5.18, 4.98])
_BELOW = np.array([-6.65, -6.85, -7.15, -7.65, -8.352, -9.244, -10.346, -11.742, -13.565, -16.042, -19.582, -25.0])
_VLS_128 = np.concatenate([_ABOVE, (-6.5 + 0.11 * np.arange(104))[::-1], _BELOW])
_VLS_STAGGER = (6.354, 4.548, 2.732, 0.911, -0.911, -2.732, -4.548, -6.354)
_OS1_64, _OS1_128 = np.linspace(22.5, -22.5, 64), np.linspace(22.5, -22.5, 128)
_OS1_STAGGER = (4.23, 1.41, -1.41, -4.23)

_USUAL = (  # elevations, columns, reach, greatest and least range; then what is not as of most
    Sensor(
        "HDL-64E", _HDL_64E, 2083, 50.0, 120.0, 0.9, noise=0.018, ring_bias=0.015, divergence=0.002, height=1.73, turn=1
    ),
    Sensor("HDL-32E", 10.67 - 4.0 / 3.0 * np.arange(32), 1084, 40.0, 100.0, 0.9, period=0.05, height=1.84),
    Sensor("VLP-16", 15.0 - 2.0 * np.arange(16), 1800, 40.0, 100.0, 0.5),
    Sensor("OS1-64", _OS1_64, 1024, 50.0, 120.0, 0.5, stagger=_OS1_STAGGER, organised=True, levels=4096),
    Sensor("OS1-128", _OS1_128, 1024, 50.0, 120.0, 0.5, stagger=_OS1_STAGGER, organised=True, levels=4096),
    Sensor("VLS-128", _VLS_128, 1876, 180.0, 245.0, 1.0, height=1.9, stagger=_VLS_STAGGER),
    Sensor("Avia", np.linspace(0.5, -0.5, 6), 4000, 190.0, 450.0, 1.0, height=1.65, forward=0.9, rosette=(70.4, 76.2)),
)
_SLOW = replace(_USUAL[0], name="HDL-64E-5Hz", columns=4167, period=0.2)  # the same unit at half its usual speed
SENSORS = {sensor.name: sensor for sensor in (*_USUAL, _SLOW)}
"""All sensors by name."""
