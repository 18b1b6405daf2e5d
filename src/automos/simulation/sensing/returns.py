"""From hits to a scan: which beams come back, with what range error and intensity, and what spoils a sweep.

A beam returns while its echo is strong enough: reflectivity x cos(incidence)**falloff / range**2 against the sensor's
reach on a 10 % target. A beam that straddles an edge reports a range in between when both echoes fall into one pulse.
Drops and dust in the air take beams away or return them, and bright signs bleed into the beams beside them.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array, inverse
from automos.core.scan import Scan
from automos.simulation.sensing.scene import AIR, EGO, Hits
from automos.simulation.sensing.sensors import Array32, Pattern, Sensor
from automos.simulation.shapes.materials import Material, column

PULSE = 1.2
"""Metres: two echoes nearer to each other than this merge into one."""
FADE = 0.06
"""Width, as a share of the range, over which returns die out at a surface's limit of visibility."""
MISFIRE = 0.002
"""Share of beams that fail for no reason."""
FULL_SCALE = 1.1
"""Reflectivity that saturates the intensity scale."""


@dataclass(frozen=True, eq=False)
class Returns:
    """What comes back of N beams.

    Attributes
    ----------
    distance : (N,) float32 metres, measured.
    intensity : (N,) float32 in [0, 1].
    is_return : (N,) bool.
    straddles : (N,) int64, for mixed returns the row of the other beam's hit that took part, else -1.
    """

    distance: Array32
    intensity: Array32
    is_return: npt.NDArray[np.bool_]
    straddles: npt.NDArray[np.int64]


def measure(sensor: Sensor, pattern: Pattern, hits: Hits, rng: np.random.Generator) -> Returns:
    """Return what `sensor` reports of `hits`; `rng` supplies the noise."""
    n = len(hits.distance)
    echo = column("reflectivity")[hits.material] * hits.tint * hits.cosine ** column("falloff")[hits.material]
    limit = sensor.reach * np.sqrt(10.0 * np.maximum(echo, 1e-6))
    margin = (1.0 - hits.distance / limit) / FADE
    seen = rng.random(n, np.float32) < 1.0 / (1.0 + np.exp(-np.clip(margin, -30.0, 30.0)))
    seen &= ~hits.lost & (rng.random(n, np.float32) > MISFIRE)
    mixed, straddles = _mix_edges(sensor, hits.distance, ~hits.lost, rng)
    noise = rng.standard_normal(n, np.float32) * (sensor.noise * (1.0 + hits.distance / 100.0))
    fuzz = rng.standard_exponential(n, np.float32) * column("fuzz")[hits.material]
    distance = mixed + noise + fuzz + ring_bias(sensor)[pattern.ring]
    seen &= (distance > sensor.min_range) & (distance < sensor.max_range)
    strength = np.clip(echo / FULL_SCALE * (1.0 + 0.08 * rng.standard_normal(n, np.float32)), 0.0, 1.0)
    intensity = np.round(strength * sensor.levels) / sensor.levels
    return Returns(distance.astype(np.float32), intensity.astype(np.float32), seen, straddles)


def ring_bias(sensor: Sensor) -> Array32:
    """Return (beams,) metres: each beam's constant range error, the same for every unit of a kind."""
    rng = np.random.default_rng(sum(map(ord, sensor.name)))
    return (sensor.ring_bias * rng.standard_normal(sensor.beams)).astype(np.float32)


def _mix_edges(sensor: Sensor, distance, is_hit, rng):  # type: ignore[no-untyped-def]
    """Return (N,) distances with edges blurred, and for each blurred beam the row it shares an edge with."""
    n = len(distance)
    other = np.arange(n) + sensor.beams  # the next firing of the same beam
    other[-sensor.beams :] -= 2 * sensor.beams
    gap = distance[other] - distance
    chance = 0.5 * min(1.0, sensor.divergence / (2.0 * np.pi / sensor.columns))
    blurred = (np.abs(gap) > 0.25) & (np.abs(gap) < PULSE) & is_hit & is_hit[other]
    blurred &= rng.random(n, np.float32) < chance
    share = rng.random(n, np.float32)
    return np.where(blurred, distance + share * gap, distance), np.where(blurred, other, -1)


@dataclass(frozen=True, eq=False)
class Cast:
    """A scan and, for each of its points, the object it is on (0 scenery, EGO, AIR) and whether that is known."""

    scan: Scan
    object: npt.NDArray[np.int32]
    is_clear: npt.NDArray[np.bool_]


def read_out(
    sensor: Sensor, pattern: Pattern, hits: Hits, returns: Returns, points: npt.NDArray, stamp: float, name: str
) -> Cast:
    """Return the scan of a sweep's (N, 3) `points`, one per beam, as the sensor gives it away."""
    object_ = np.where(returns.is_return, hits.object, EGO).astype(np.int32)
    is_mixed = (returns.straddles >= 0) & (hits.object != hits.object[returns.straddles])
    if sensor.organised:
        points[~returns.is_return] = 0.0
        rows = np.arange(len(points)).reshape(sensor.columns, sensor.beams).T.ravel()
    else:
        rows = np.flatnonzero(returns.is_return)
    scan = Scan(
        np.ascontiguousarray(points[rows], np.float32),
        intensity=np.where(returns.is_return, returns.intensity, 0.0).astype(np.float32)[rows],
        time=((pattern.phase[rows] + 0.5) * sensor.period).astype(np.float32),
        ring=pattern.ring[rows],
        stamp=stamp,
        name=name,
    )
    return Cast(scan, object_[rows], (returns.is_return & ~is_mixed)[rows])


def compensate(points: npt.NDArray, pattern: Pattern, T_site_sensor: Array, T_site_middle: Array) -> npt.NDArray:
    """Return the points as seen from where the sensor is at mid-sweep."""
    T = (inverse(T_site_middle) @ T_site_sensor)[pattern.column]
    return (np.einsum("nij,nj->ni", T[:, :3, :3], points) + T[:, :3, 3]).astype(np.float32)


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
    bright = (hits.material == Material.RETRO) & (hits.distance < BLEED_RANGE) & ~hits.lost
    source = np.flatnonzero(bright)
    column, beam = np.divmod(source, beams)
    fields = vars(hits).values()
    kept = [values[source] for values in fields]
    for step in range(-BLEEDS, BLEEDS + 1):
        for up in range(-(BLEEDS // 2), BLEEDS // 2 + 1):
            beside = beam + up
            rows = (beside >= 0) & (beside < beams) & (rng.random(len(beam)) < BLEED_CHANCE)
            target = (column[rows] + step) % columns * beams + beside[rows]
            dark = ~bright[target]
            for values, from_ in zip(fields, kept, strict=True):
                values[target[dark]] = from_[rows][dark]
