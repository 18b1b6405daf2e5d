"""What carries the sensor: a car, and what rides along farther away or moves about: hulls, trailers, an operator.

A rig's parts are fixed to the body, swing behind it, or walk. Body frame: x forward, y left, z up, origin on the
ground under the car's middle.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np

from automos.core.geometry import Array
from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import Mesh, box, boxes_on_both_sides, join, of_parts, rod
from automos.simulation.shapes.people import make_walker
from automos.simulation.traffic.driving import DT
from automos.simulation.traffic.motion import EgoMotion, transforms
from automos.simulation.world import World

WALK = 1.4
"""m/s, the most a walking operator does."""
GAIT = {2: (0.025, 1.9), 3: (0.05, 0.95), 4: (0.02, 1.9), 5: (0.035, 0.95)}
"""Heave in metres, yaw, pitch, roll in radians of a walker's back, and how often a second."""
WAVES = {2: (0.12, 0.23), 4: (0.035, 0.34), 5: (0.07, 0.27)}
"""Heave in metres, pitch and roll in radians of a small boat, and how often a second."""
CLEARANCE = 0.5
"""Metres around a rig that other road users leave free."""


@dataclass(frozen=True, eq=False)
class Part:
    """A piece of a rig.

    Attributes
    ----------
    frames : tuple of Mesh
        Meshes; more than one for what changes its shape as it goes, shown in turn along `stride` metres.
    hinge : float
        X of the joint about which it swings, with `length` metres from there to its axle; rigid where 0.
    """

    frames: tuple[Mesh, ...]
    stride: float = 1.0
    hinge: float = 0.0
    length: float = 0.0


@dataclass(frozen=True, eq=False)
class Rig:
    """A carrier of the sensor.

    Attributes
    ----------
    parts : tuple of Part
        What the sensor may see of it.
    mount : (x, y, z) float, optional
        The sensor in the body frame; None: where the sensor is usually mounted.
    ride : callable
        The motion of the body, from that of the car in its place.
    footprint : (rear, front, half width) float, optional
        Metres that nobody else drives or walks through; None: the car's, whom all others mind.
    """

    parts: tuple[Part, ...]
    mount: tuple[float, float, float] | None = None
    ride: Callable[[EgoMotion], EgoMotion] = lambda motion: motion
    footprint: tuple[float, float, float] | None = None


def placed(part: Part, ego: EgoMotion, time: float) -> tuple[int, Array]:
    """Return which frame of `part` is shown at `time` seconds, and its (4, 4) pose T_body_part."""
    at, steps, frame = time / DT, np.arange(len(ego.state)), 0
    if len(part.frames) > 1:
        way = float(np.interp(at, steps, _travelled(ego)))
        frame = int(way / part.stride * len(part.frames)) % len(part.frames)
    swing = float(np.interp(at, steps, _swing(part, ego))) if part.length else 0.0
    return frame, transforms(np.array([part.hinge, 0.0, 0.0, swing, 0.0, 0.0]))


@lru_cache(maxsize=4)
def _travelled(ego: EgoMotion) -> Array:
    """Return (T,) metres the body has gone."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ego.state[:, :2], axis=0), axis=1))])


@lru_cache(maxsize=4)
def _swing(part: Part, ego: EgoMotion) -> Array:
    """Return (T,) radians from the body's heading to the trailer's, whose axle follows its hinge without slipping."""
    yaw = ego.state[:, 3]
    hinge = ego.state[:, :2] + part.hinge * np.column_stack([np.cos(yaw), np.sin(yaw)])
    heading = np.empty(len(yaw))
    heading[0] = yaw[0]
    for k, (dx, dy) in enumerate(np.diff(hinge, axis=0)):
        across = dy * np.cos(heading[k]) - dx * np.sin(heading[k])
        heading[k + 1] = heading[k] + across / part.length
    return heading - yaw


def ride_on(world: World, rig: Rig) -> World:
    """Return `world` with `rig` in the car's place; whoever would pass through it is gone."""
    if rig.footprint is None:
        return world
    ego = rig.ride(world.ego)
    rear, front, half = rig.footprint
    motion = world.motion
    n = min(len(ego.state), len(motion.state))
    offset = motion.state[:n, :, :2] - ego.state[:n, None, :2]
    cos, sin = np.cos(ego.state[:n, None, 3]), np.sin(ego.state[:n, None, 3])
    ahead, left = cos * offset[..., 0] + sin * offset[..., 1], cos * offset[..., 1] - sin * offset[..., 0]
    around = np.array([0.5 * float(np.hypot(*thing.size[:2])) for thing in world.movers]) + CLEARANCE
    beside = np.array([0.5 * float(thing.size[1]) for thing in world.movers]) + CLEARANCE
    inside = (ahead > rear - around) & (ahead < front + around) & (np.abs(left) < half + beside)
    kept = np.flatnonzero(~np.any(inside & motion.present[:n], axis=0))
    return replace(world, ego=ego, movers=tuple(world.movers[k] for k in kept), motion=motion.of(kept))


# ------------------------------------------------------------------------------------------------------ their rides
def _walk(motion: EgoMotion) -> EgoMotion:
    """Return the motion of somebody who walks where the car drives."""
    way = _travelled(motion)
    time = DT * np.arange(len(way))
    pace = np.minimum(way, WALK * time)
    rising = np.concatenate([[True], np.diff(way) > 1e-6])
    state = np.column_stack([np.interp(pace, way[rising], column[rising]) for column in motion.state.T])
    state[:, 4:] = 0.0
    steps = np.clip(np.gradient(pace, DT) / WALK, 0.0, 1.0)
    return EgoMotion(_shaken(state, GAIT, steps))


def _float(motion: EgoMotion) -> EgoMotion:
    """Return the motion of a boat that goes where the car drives."""
    return EgoMotion(_shaken(motion.state.copy(), WAVES, np.ones(len(motion.state))))


def _shaken(state: Array, how: dict[int, tuple[float, float]], strength: Array) -> Array:
    time = DT * np.arange(len(state))
    for column, (amplitude, rate) in how.items():
        wave = np.sin(2 * np.pi * rate * time + column) + 0.4 * np.sin(2 * np.pi * 1.43 * rate * time + 2 * column)
        state[:, column] += amplitude * strength * wave
    return state


# ----------------------------------------------------------------------------------------------------- their shapes
@of_parts
def _car() -> Iterator[Mesh]:
    """Return what a sensor on the roof sees of its car."""
    roof = 1.42
    yield box((1.20, 1.00, 0.06), (-0.10, 0.0, roof - 0.03), Material.PAINT, 0.8)
    yield box((0.30, 0.50, 0.06), (0.63, 0.0, roof - 0.03), Material.PAINT, 0.8)
    yield box((0.25, 1.16, 0.06), (-0.775, 0.0, roof - 0.03), Material.PAINT, 0.8)
    yield box((0.65, 1.40, 0.05), (1.55, 0.0, 0.75), Material.PAINT, 0.8)  # the bonnet
    yield boxes_on_both_sides((0.08, 0.06, 0.08), (0.55, 0.42, roof + 0.03), Material.PLASTIC)
    for y in (-0.42, 0.42):
        yield rod((-0.85, y, roof), (-0.85, y, roof + 0.13), 0.04, Material.METAL)
    yield rod((-0.30, -0.62, roof), (-0.30, 0.62, roof), 0.03, Material.METAL)


@of_parts
def _hull() -> Iterator[Mesh]:
    """Return a small motor boat of 11 m with a cabin behind the sensor's mast, rails and a flagstaff."""
    yield box((11.0, 3.4, 0.9), (-0.8, 0.0, 0.65), Material.PLASTIC, 2.0)
    yield box((3.0, 2.4, 1.7), (-3.2, 0.0, 1.9), Material.PLASTIC, 2.2)
    yield box((0.02, 2.0, 0.6), (-1.69, 0.0, 2.2), Material.CAR_GLASS)
    yield box((1.0, 0.8, 0.7), (2.6, 0.0, 1.4), Material.PLASTIC, 1.5)
    for x in (-5.5, -4.0, 2.0, 4.0):
        for y in (-1.6, 1.6):
            yield rod((x, y, 1.1), (x, y, 1.9), 0.03, Material.METAL)
    for x in (-4.7, 3.0):
        yield boxes_on_both_sides((3.5, 0.04, 0.04), (x, 1.6, 1.9), Material.METAL)
    yield rod((-6.0, 0.0, 1.1), (-6.0, 0.0, 3.6), 0.03, Material.METAL)
    yield rod((0.0, 0.0, 1.1), (0.0, 0.0, 1.85), 0.05, Material.METAL)


@of_parts
def _tractor() -> Iterator[Mesh]:
    yield box((2.2, 2.4, 2.1), (1.5, 0.0, 1.9), Material.PAINT)
    yield box((0.25, 0.35, 0.7), (2.0, -1.45, 2.2), Material.PLASTIC)
    yield box((0.5, 0.12, 0.08), (1.3, 1.3, 2.3), Material.METAL)


@of_parts
def _trailer() -> Iterator[Mesh]:
    """Return a box trailer whose kingpin is the origin, 1.2 m behind its front face."""
    yield box((10.0, 2.5, 2.8), (-3.8, 0.0, 2.5), Material.PAINT, 0.8)
    yield box((9.0, 1.0, 0.3), (-3.8, 0.0, 0.95), Material.METAL, 0.4)
    for x in (-6.4, -7.6):
        yield rod((x, 1.15, 0.5), (x, 1.2, 0.5), 0.5, Material.RUBBER)


@cache
def rigs() -> dict[str, Rig]:
    """Return all rigs by name."""
    operator = make_walker(np.random.default_rng(1))
    pack = box((0.25, 0.35, 0.5), (-0.3, 0.0, 1.25), Material.PLASTIC)
    boom = rod((-0.35, 0.0, 1.3), (-1.1, 0.0, 1.35), 0.03, Material.METAL)
    walker = Part(tuple(join([frame, pack, boom]) for frame in operator.frames), operator.stride)
    trailer = Part((_trailer(),), hinge=-0.6, length=6.4)
    return {
        "car": Rig((Part((_car(),)),)),
        "boat": Rig((Part((_hull(),)),), (0.0, 0.0, 2.0), _float, (-6.5, 5.0, 1.8)),
        "truck": Rig((Part((_tractor(),)), trailer), (1.3, 1.6, 2.45), footprint=(-9.5, 2.8, 1.5)),
        "backpack": Rig((walker,), (-1.1, 0.0, 1.45), _walk, (-1.3, 0.6, 0.5)),
    }


RIGS = ("car", "boat", "truck", "backpack")
"""Names of the rigs."""
