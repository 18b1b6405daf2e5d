"""People on foot and on two wheels, with limbs that move as they go.

A walker's frames are phases of one stride: hips swing, the knee of the forward-moving leg bends, arms swing against
the legs. A cyclist's frames are phases of one turn of the pedals.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import Mesh, ball, box, join, of_parts, rod
from automos.simulation.shapes.things import Thing

N_PHASES = 10
PHASES = 2.0 * np.pi * np.arange(N_PHASES) / N_PHASES
"""Radians."""


def _limb(points: npt.ArrayLike, radii: tuple[float, ...], material: Material, tint: float) -> Mesh:
    points = np.asarray(points, np.float64)
    bones = zip(points[:-1], points[1:], radii[:-1], radii[1:], strict=True)
    return join([rod(a, b, ra, material, tint, end_radius=rb, sections=6) for a, b, ra, rb in bones])


def _leg(side: float, phase: float, height: float, tint: float, swing: float) -> Mesh:
    """Return a leg whose hip angle follows `phase` (radians); the knee bends while the foot comes forward."""
    thigh, shin = 0.245 * height, 0.25 * height
    hip = swing * np.sin(phase)
    knee = 1.1 * swing * max(0.0, np.cos(phase)) + 0.08
    a = np.array([0.0, side * 0.055 * height, 0.52 * height])
    b = a + thigh * np.array([np.sin(hip), 0.0, -np.cos(hip)])
    c = b + shin * np.array([np.sin(hip - knee), 0.0, -np.cos(hip - knee)])
    c[2] = max(c[2], 0.05)
    toe = c + np.array([0.13 * height, 0.0, -0.02])
    return _limb([a, b, c, toe], (0.075, 0.055, 0.045, 0.04), Material.CLOTH, tint)


def _arm(side: float, phase: float, height: float, tint: float, swing: float) -> Mesh:
    upper, lower = 0.17 * height, 0.16 * height
    shoulder = swing * np.sin(phase)
    a = np.array([0.0, side * 0.125 * height, 0.81 * height])
    b = a + upper * np.array([np.sin(shoulder), 0.1 * side, -np.cos(shoulder)])
    c = b + lower * np.array([np.sin(shoulder + 0.4), 0.0, -np.cos(shoulder + 0.4)])
    return _limb([a, b, c], (0.05, 0.042, 0.035), Material.CLOTH, tint)


@of_parts
def _torso(height: float, tint: float, lean: float = 0.0, hip: float = 0.5) -> Iterator[Mesh]:
    foot = np.array([0.0, 0.0, hip * height])
    along = np.array([np.sin(lean), 0.0, np.cos(lean)])
    chest = foot + 0.32 * height * along
    head = foot + 0.43 * height * along
    yield ball((0.075 * height, 0.10 * height, 0.09 * height), foot, Material.CLOTH, 0.7 * tint)
    yield ball((0.078 * height, 0.125 * height, 0.19 * height), 0.45 * foot + 0.55 * chest, Material.CLOTH, tint)
    yield rod(chest, head, 0.04 * height, Material.SKIN, sections=6)
    yield ball((0.055 * height, 0.048 * height, 0.07 * height), head, Material.SKIN)


def make_walker(rng: np.random.Generator, child: bool = False) -> Thing:
    """Return a person whose frames are the phases of a stride; bags and bulk vary."""
    height = rng.uniform(1.05, 1.4) if child else rng.uniform(1.55, 1.92)
    shirt, trousers = rng.uniform(0.2, 1.8, 2)
    trunk = [_torso(height, shirt)]
    if rng.random() < 0.3:
        trunk.append(box((0.16, 0.30, 0.42), (-0.17, 0.0, 0.72 * height), Material.CLOTH, rng.uniform(0.2, 1.2)))
    elif rng.random() < 0.25:
        trunk.append(box((0.30, 0.12, 0.30), (0.05, 0.14 * height + 0.06, 0.36 * height), Material.PLASTIC))
    frames = []
    for phase in PHASES:
        legs = [_leg(s, phase + turn, height, trousers, 0.45) for s, turn in ((1.0, 0.0), (-1.0, np.pi))]
        arms = [_arm(s, phase + turn, height, shirt, 0.4) for s, turn in ((1.0, np.pi), (-1.0, 0.0))]
        frames.append(join([*trunk, *legs, *arms]).scaled((1.0, rng.uniform(0.999, 1.001), 1.0)))
    return Thing("person", tuple(frames), stride=0.85 * height)


def make_stander(rng: np.random.Generator) -> Thing:
    """Return a person who stands."""
    height = rng.uniform(1.55, 1.92)
    shirt, trousers = rng.uniform(0.2, 1.8, 2)
    limbs = [_leg(s, 0.0 if s > 0 else np.pi, height, trousers, 0.05) for s in (1.0, -1.0)]
    limbs += [_arm(s, 0.0, height, shirt, 0.05) for s in (1.0, -1.0)]
    return Thing("person", (join([_torso(height, shirt), *limbs]),))


@of_parts
def _ring(x: float, radius: float, tyre: float) -> Iterator[Mesh]:
    """Return a bicycle wheel: a thin tyre, a hub and some spokes, mostly air."""
    angles = np.linspace(0.0, 2.0 * np.pi, 13)
    rim = np.column_stack([x + radius * np.cos(angles), np.zeros(13), radius + radius * np.sin(angles)])
    rim[:, 2] = np.maximum(rim[:, 2], tyre)
    for a, b in pairwise(rim):
        yield rod(a, b, tyre, Material.RUBBER, 2.0, sections=4)
    for k in range(0, 12, 2):
        yield rod((x, 0.0, radius), rim[k], 0.006, Material.METAL, sections=3)


@of_parts
def _bicycle() -> Iterator[Mesh]:
    rear, front, radius = -0.52, 0.53, 0.34
    saddle, crank, head, bars = (-0.20, 0, 0.90), (-0.08, 0, 0.30), (0.36, 0, 0.88), (0.38, 0, 1.02)
    hub, fork, grips = (rear, 0, radius), (front, 0, radius), ((0.36, -0.28, 1.03), (0.36, 0.28, 1.03))
    frame = [(saddle, crank), (crank, head), (saddle, head), (crank, hub), (saddle, hub), (head, fork), (head, bars)]
    for a, b in [*frame, grips]:
        yield rod(a, b, 0.022, Material.METAL, sections=5)
    yield _ring(rear, radius, 0.022)
    yield _ring(front, radius, 0.022)
    yield box((0.24, 0.14, 0.06), (-0.20, 0, 0.94), Material.PLASTIC)
    yield box((0.02, 0.06, 0.06), (-0.60, 0, 0.75), Material.RETRO)


@of_parts
def _seated(
    tint: float, hip: tuple[float, float], hands: tuple[float, float], feet: npt.NDArray, lean: float
) -> Iterator[Mesh]:
    """Return a rider: `hip` and `hands` are (x, z); `feet` is (2, 3)."""
    height = 1.75
    yield _torso(height, tint, lean, hip=0.0).moved(x=hip[0], z=hip[1])
    shoulder = np.array([hip[0] + 0.30 * height * np.sin(lean), 0.0, hip[1] + 0.30 * height * np.cos(lean)])
    for side, foot in zip((1.0, -1.0), feet, strict=True):
        a = np.array([hip[0], side * 0.10, hip[1]])
        reach = foot - a
        span = float(np.linalg.norm(reach))
        bend = np.sqrt(max(0.44**2 - (0.5 * min(span, 0.87)) ** 2, 0.0))
        across = np.array([-reach[2], 0.0, reach[0]]) / max(span, 1e-6)
        knee = a + 0.5 * reach + bend * across * np.sign(across[0] if across[0] else 1.0)
        toe = foot + np.array([0.15, 0.0, 0.0])
        yield _limb([a, knee, foot, toe], (0.075, 0.055, 0.045, 0.035), Material.CLOTH, 0.6 * tint)
        top = shoulder + np.array([0.0, side * 0.20, 0.0])
        grip = np.array([hands[0], side * 0.25, hands[1]])
        yield _limb([top, 0.5 * (top + grip) + (0, 0, -0.06), grip], (0.05, 0.04, 0.035), Material.CLOTH, tint)


def make_cyclist(rng: np.random.Generator) -> Thing:
    """Return a bicycle with its rider; the frames are phases of the pedals."""
    bicycle, tint = _bicycle(), rng.uniform(0.3, 1.8)
    frames = []
    for phase in PHASES:
        turn = np.array([phase, phase + np.pi])
        feet = np.column_stack([-0.08 + 0.17 * np.cos(turn), [0.12, -0.12], 0.34 - 0.17 * np.sin(turn)])
        frames.append(join([bicycle, _seated(tint, (-0.20, 0.98), (0.36, 1.05), feet, 0.6)]))
    return Thing("bicyclist", tuple(frames), stride=5.0, axles=(-0.52, 0.53))


def make_parked_bicycle(rng: np.random.Generator) -> Thing:
    """Return a bicycle without a rider."""
    return Thing("bicycle", (_bicycle().scaled(rng.uniform(0.95, 1.05)),), axles=(-0.52, 0.53))


@of_parts
def _scooter(tint: float) -> Iterator[Mesh]:
    for x in (-0.62, 0.62):
        yield rod((x, -0.06, 0.24), (x, 0.06, 0.24), 0.24, Material.RUBBER, sections=12)
    yield box((0.75, 0.32, 0.36), (-0.42, 0, 0.62), Material.PAINT, tint)
    yield box((0.55, 0.36, 0.08), (0.12, 0, 0.32), Material.PLASTIC)
    yield box((0.10, 0.42, 0.62), (0.45, 0, 0.66), Material.PAINT, tint)
    yield rod((0.62, 0, 0.24), (0.42, 0, 1.02), 0.045, Material.METAL, sections=6)
    yield rod((0.42, -0.33, 1.03), (0.42, 0.33, 1.03), 0.025, Material.METAL, sections=6)
    yield box((0.70, 0.28, 0.10), (-0.40, 0, 0.82), Material.PLASTIC)
    yield box((0.02, 0.20, 0.14), (-0.80, 0, 0.55), Material.RETRO, 0.5)


@of_parts
def _motorcycle(tint: float) -> Iterator[Mesh]:
    for x in (-0.72, 0.72):
        yield rod((x, -0.08, 0.31), (x, 0.08, 0.31), 0.31, Material.RUBBER, sections=12)
    yield box((0.55, 0.34, 0.40), (0.0, 0, 0.45), Material.METAL, 0.6)
    yield ball((0.32, 0.17, 0.17), (0.15, 0, 0.82), Material.PAINT, tint)
    yield box((0.62, 0.26, 0.12), (-0.38, 0, 0.80), Material.PLASTIC)
    yield rod((0.72, 0, 0.31), (0.42, 0, 0.98), 0.05, Material.METAL, sections=6)
    yield rod((0.40, -0.38, 1.02), (0.40, 0.38, 1.02), 0.025, Material.METAL, sections=6)
    yield box((0.02, 0.20, 0.14), (-0.98, 0, 0.60), Material.RETRO, 0.5)


def make_motorcyclist(rng: np.random.Generator, passenger: bool = False) -> Thing:
    """Return a scooter or motorcycle with its rider."""
    paint, tint = rng.uniform(0.1, 1.5), rng.uniform(0.3, 1.6)
    if rng.random() < 0.6:
        machine, seat, hands, lean = _scooter(paint), (-0.28, 0.92), (0.42, 1.05), 0.1
        feet = np.array([[0.12, 0.14, 0.40], [0.12, -0.14, 0.40]])
    else:
        machine, seat, hands, lean = _motorcycle(paint), (-0.25, 0.90), (0.40, 1.04), 0.35
        feet = np.array([[-0.10, 0.2, 0.35], [-0.10, -0.2, 0.35]])
    parts = [machine, _seated(tint, seat, hands, feet, lean)]
    if passenger:
        behind, hold = (seat[0] - 0.38, seat[1] + 0.03), (seat[0], seat[1] + 0.3)
        parts.append(_seated(rng.uniform(0.3, 1.6), behind, hold, feet - (0.45, 0.0, 0.0), lean))
    return Thing("motorcyclist", (join(parts),), axles=(-0.68, 0.68))


def make_parked_scooter(rng: np.random.Generator) -> Thing:
    """Return a scooter or motorcycle on its stand."""
    paint = rng.uniform(0.1, 1.5)
    return Thing("motorcycle", (_scooter(paint) if rng.random() < 0.6 else _motorcycle(paint),), axles=(-0.68, 0.68))
