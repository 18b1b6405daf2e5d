"""The vehicle that carries the sensor: how its body pitches, rolls and shakes, and what of it the beams hit."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import Mesh, box, join, rod
from automos.simulation.traffic.driving import DT
from automos.simulation.traffic.motion import transforms

PITCH_PER_ACCELERATION = 0.006
"""rad per m/s^2: the nose dives when braking."""
ROLL_PER_ACCELERATION = 0.007
"""rad per m/s^2: the body leans out of the bend."""
SHAKE = (0.008, 0.0042, 0.0042)
"""Heave in metres, pitch and roll in radians: how far an uneven road moves the body (standard deviation)."""
SHAKE_SPEED = 2.5
"""m/s from which on a road shakes the body fully; slower, in proportion."""
BUMPS = (2.0, 20.0)
"""Metres, wavelengths of the unevenness."""
BODY_INERTIA = 0.12
"""Seconds over which a body evens out the corners of its wheels' motion."""
SETTLING = 0.25
"""Seconds in which the suspension follows."""


@dataclass(frozen=True, eq=False)
class EgoMotion:
    """Poses of the ego vehicle's body.

    Attributes
    ----------
    state : (T, 6) float64
        As in `Motion`, every DT seconds, suspension included.
    """

    state: Array

    @cached_property
    def _spline(self):  # type: ignore[no-untyped-def]
        from scipy.interpolate import CubicSpline

        return CubicSpline(DT * np.arange(len(self.state)), self.state, axis=0)

    def at(self, time: npt.ArrayLike) -> Array:
        """Return (..., 4, 4) T_site_body at `time` seconds."""
        time = np.clip(np.asarray(time, np.float64), 0.0, DT * (len(self.state) - 1))
        return transforms(self._spline(time))


def ride(state: Array, speed: Array, rng: np.random.Generator, unevenness: float = 1.0) -> EgoMotion:
    """Return the ego's motion from its wheels' (T, 6) `state` and (T,) `speed`: braking, bends and bumps move the body.

    `unevenness` is 1 for a city street with patches and cobbles, less for smoother roads.
    """
    acceleration = np.gradient(speed, DT)
    lateral = speed * np.gradient(state[:, 3], DT)
    out = _smooth(state)
    out[:, 4] -= PITCH_PER_ACCELERATION * _settle(acceleration)
    out[:, 5] += ROLL_PER_ACCELERATION * _settle(lateral)
    travelled = np.cumsum(speed) * DT
    strength = unevenness * _settle(np.clip(speed / SHAKE_SPEED, 0.0, 1.0))
    for column, amplitude in zip((2, 4, 5), SHAKE, strict=True):
        waves = np.exp(rng.uniform(np.log(BUMPS[0]), np.log(BUMPS[1]), 8))
        weights = np.sqrt(2.0) * waves / (waves + 4.0) / np.sqrt(len(waves))  # springs swallow the short ones
        phases = rng.uniform(0, 2 * np.pi, len(waves))
        out[:, column] += (
            amplitude * strength * (weights * np.sin(2 * np.pi * travelled[:, None] / waves + phases)).sum(axis=1)
        )
    return EgoMotion(out)


def _smooth(state: Array) -> Array:
    """Return the states averaged over a quarter of a second: a body has no corners in its motion."""
    return _gaussian(state, BODY_INERTIA)


def _settle(values: Array) -> Array:
    return _gaussian(values, SETTLING)


def _gaussian(values: Array, seconds: float) -> Array:
    """Return `values` (T, ...) smoothed over time; beyond the ends they are taken to go on as they went."""
    from scipy.ndimage import gaussian_filter1d

    margin = min(int(5 * seconds / DT), len(values) - 1)
    padded = np.pad(values, [(margin, margin)] + [(0, 0)] * (values.ndim - 1), mode="reflect", reflect_type="odd")
    return gaussian_filter1d(padded, seconds / DT, axis=0)[margin : margin + len(values)]


def ego_body(roof: float = 1.42) -> Mesh:
    """Return what the sensor may see of its own vehicle, body frame with the sensor above the origin."""
    roof_z, bonnet_z = roof - 0.03, 0.75
    return join(
        [
            box((1.20, 1.00, 0.06), (-0.10, 0.0, roof_z), Material.PAINT, 0.8),
            box((0.30, 0.50, 0.06), (0.63, 0.0, roof_z), Material.PAINT, 0.8),
            box((0.25, 1.16, 0.06), (-0.775, 0.0, roof_z), Material.PAINT, 0.8),
            box((0.65, 1.40, 0.05), (1.55, 0.0, bonnet_z), Material.PAINT, 0.8),
            *(box((0.08, 0.06, 0.08), (0.55, y, roof + 0.03), Material.PLASTIC) for y in (-0.42, 0.42)),
            *(rod((-0.85, y, roof), (-0.85, y, roof + 0.13), 0.04, Material.METAL) for y in (-0.42, 0.42)),
            rod((-0.30, -0.62, roof), (-0.30, 0.62, roof), 0.03, Material.METAL),
        ]
    )
