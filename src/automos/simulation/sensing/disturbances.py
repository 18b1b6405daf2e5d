"""What spoils a sweep: drops and dust in the air, and bright signs that bleed into the beams beside them."""

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.simulation.sensing.scene import AIR, Hits
from automos.simulation.sensing.sensors import Sensor
from automos.simulation.shapes.materials import Material

Array32 = npt.NDArray[np.float32]

DROPS_PER_METRE = 0.002
"""Chance that a beam meets a drop of heavy rain that returns, per metre of its path."""
DROPS_SEEN = 8.0
"""Metres within which drops return."""
RAIN_DIMS = 0.6
"""Share of an echo that is left in heavy rain."""
PUFFS = 10
"""Clouds of dust about the ego's way."""
PUFF_RADIUS = (0.8, 2.5)
"""Metres."""
PUFF_DENSITY = 0.25
"""Chance that a beam returns from a puff, per metre of its path in it."""
WIND = 1.5
"""m/s at which puffs drift."""
BLEEDS = 3
"""Firings to both sides into which a sign bleeds; half as many beams up and down."""
BLEED_CHANCE = 0.5
"""Of a beam beside a sign to be overpowered by it."""
BLEED_RANGE = 40.0
"""Metres up to which signs are bright enough for that."""
WEATHER = ("clear", "rain", "dust")
"""Names of the kinds of weather."""


def add_rain(hits: Hits, rng: np.random.Generator) -> None:
    """Put drops before what the beams hit; echoes from behind them get weaker."""
    distance = rng.standard_exponential(len(hits.distance), np.float32) / np.float32(DROPS_PER_METRE)
    hits.tint *= np.float32(RAIN_DIMS)
    _return_from_air(hits, distance, distance < np.minimum(hits.distance, DROPS_SEEN))


def add_dust(
    hits: Hits, origin: Array, direction: Array32, way: Array, time: float, seed: int, rng: np.random.Generator
) -> None:
    """Put drifting puffs of dust before what the beams hit.

    Parameters
    ----------
    origin : (3,) float64
        Where the sensor is, site frame.
    direction : (N, 3) array
        The beams, site frame.
    way : (K, 3) float64
        Where the sensor comes by, site frame: about these places the puffs are.
    time : float
        Seconds since the recording's start.
    seed : int
        Of the puffs' places, radii and winds.
    """
    still = np.random.default_rng([seed, 31])
    center = way[still.integers(0, len(way), PUFFS)] + still.normal(0.0, 1.0, (PUFFS, 3)) * (6.0, 6.0, 0.5)
    center[:, 2] -= 0.6
    center[:, :2] += WIND * time * still.standard_normal((PUFFS, 2))
    for middle, radius in zip(center, still.uniform(*PUFF_RADIUS, PUFFS), strict=True):
        to_middle = middle - origin
        along = np.einsum("ij,j->i", direction, to_middle)
        half_chord = np.sqrt(np.maximum(radius**2 - (to_middle @ to_middle - along**2), 0.0))
        depth = rng.standard_exponential(len(along)) / PUFF_DENSITY
        distance = np.maximum(along - half_chord, 0.0) + depth
        _return_from_air(hits, distance.astype(np.float32), (depth < 2.0 * half_chord) & (distance < hits.distance))


def _return_from_air(hits: Hits, distance: Array32, is_met: npt.NDArray[np.bool_]) -> None:
    rows = np.flatnonzero(is_met)
    hits.distance[rows] = distance[rows]
    hits.material[rows] = Material.CLOTH
    hits.tint[rows] = 0.3
    hits.cosine[rows] = 1.0
    hits.object[rows] = AIR
    hits.lost[rows] = False


def bleed(hits: Hits, sensor: Sensor, rng: np.random.Generator) -> None:
    """Let beams beside one that hits a near retro-reflector report that one's range and object."""
    columns, beams = sensor.columns, sensor.beams
    grid = np.arange(len(hits.distance)).reshape(columns, beams)
    bright = (hits.material == Material.RETRO) & (hits.distance < BLEED_RANGE) & ~hits.lost
    column, beam = np.divmod(np.flatnonzero(bright), beams)
    source = grid[column, beam]
    fields: list[npt.NDArray] = [hits.distance, hits.material, hits.tint, hits.cosine, hits.object, hits.lost]
    kept = [values[source].copy() for values in fields]
    for step in range(-BLEEDS, BLEEDS + 1):
        for up in range(-(BLEEDS // 2), BLEEDS // 2 + 1):
            beside = beam + up
            rows = (beside >= 0) & (beside < beams) & (rng.random(len(beam)) < BLEED_CHANCE)
            target = grid[(column[rows] + step) % columns, beside[rows]]
            dark = ~bright[target]
            for values, from_ in zip(fields, kept, strict=True):
                values[target[dark]] = from_[rows][dark]
