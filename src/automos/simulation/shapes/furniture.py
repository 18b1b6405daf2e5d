"""What stands along roads: lamps, signs, lights, bollards, shelters, benches, rails, gantries, bridges."""

import numpy as np

from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import Mesh, box, join, rod

METAL = Material.METAL


def make_lamp(rng: np.random.Generator) -> Mesh:
    """Return a street lamp whose arm reaches toward -y."""
    height = rng.uniform(5.5, 9.0)
    return join(
        [
            rod((0, 0, -0.3), (0, 0, height), 0.09, METAL, 0.8, end_radius=0.05),
            rod((0, 0, height), (0, -1.2, height + 0.2), 0.04, METAL, 0.8, sections=5),
            box((0.25, 0.6, 0.12), (0, -1.4, height + 0.2), Material.PLASTIC),
        ]
    )


def make_sign(rng: np.random.Generator) -> Mesh:
    """Return a traffic sign that faces -x: retro-reflective."""
    height = rng.uniform(2.0, 2.6)
    plate = box((0.03, 0.6, 0.6), (-0.06, 0, height + 0.3), Material.RETRO, rng.uniform(0.3, 1.0))
    return join([rod((0, 0, -0.3), (0, 0, height + 0.6), 0.035, METAL, sections=6), plate])


def make_signal() -> Mesh:
    """Return a traffic light that faces -x."""
    return join(
        [
            rod((0, 0, -0.3), (0, 0, 3.3), 0.06, METAL, 0.5),
            box((0.25, 0.32, 0.95), (-0.1, 0, 2.8), Material.PLASTIC, 0.4),
        ]
    )


def make_bollard() -> Mesh:
    """Return a bollard."""
    return rod((0, 0, -0.2), (0, 0, 0.95), 0.06, METAL, 0.7)


def make_bin() -> Mesh:
    """Return a litter bin on a post."""
    return join(
        [rod((0, 0, -0.2), (0, 0, 1.1), 0.04, METAL), box((0.35, 0.35, 0.55), (0, -0.2, 0.8), Material.PLASTIC)]
    )


def make_bench() -> Mesh:
    """Return a bench along x, looking toward -y."""
    return join(
        [
            box((1.7, 0.45, 0.05), (0, 0, 0.45), Material.BARK),
            box((1.7, 0.05, 0.40), (0, 0.24, 0.72), Material.BARK),
            *(box((0.06, 0.45, 0.45), (x, 0, 0.22), METAL) for x in (-0.7, 0.7)),
        ]
    )


def make_cabinet(rng: np.random.Generator) -> Mesh:
    """Return a distribution cabinet or litter container."""
    if rng.random() < 0.5:
        return box((1.1, 0.4, 1.2), (0, 0, 0.55), Material.PLASTIC, 1.4)
    return join(
        [box((0.7, 0.75, 0.95), (0, 0, 0.62), Material.PLASTIC), box((0.6, 0.6, 0.15), (0, 0, 0.08), Material.RUBBER)]
    )


def make_guard_rail(length: float) -> Mesh:
    """Return a motorway guard rail along +x."""
    posts = [box((0.08, 0.12, 0.95), (x, 0.08, 0.25), METAL, 0.8) for x in np.arange(0.0, length, 4.0)]
    return join([*posts, box((length, 0.06, 0.31), (0.5 * length, 0, 0.6), METAL)])


def make_barrier(length: float) -> Mesh:
    """Return a concrete motorway barrier along +x."""
    return join(
        [
            box((length, 0.6, 0.45), (0.5 * length, 0, 0.05), Material.STONE),
            box((length, 0.22, 0.70), (0.5 * length, 0, 0.55), Material.STONE),
        ]
    )


def make_delineator() -> Mesh:
    """Return a roadside post with its reflector."""
    return join(
        [
            box((0.10, 0.12, 1.2), (0, 0, 0.45), Material.PLASTIC, 3.0),
            box((0.01, 0.08, 0.18), (-0.06, 0, 0.75), Material.RETRO, 0.5),
        ]
    )


def make_gantry(width: float) -> Mesh:
    """Return a sign gantry across a road that runs along x; it spans y from -width/2 to width/2."""
    half = 0.5 * width
    parts = [rod((0, s * half, -0.5), (0, s * half, 6.6), 0.2, METAL) for s in (-1.0, 1.0)]
    parts.append(box((0.5, width, 0.6), (0, 0, 6.6), METAL))
    for y in np.linspace(-0.3, 0.3, 2) * width:
        parts.append(box((0.06, 4.0, 2.2), (-0.35, y, 6.6), Material.RETRO, 0.6))
    return join(parts)


DECK_THICKNESS = 1.1
"""Metres."""


def make_viaduct(span: float, width: float, clearance: float, clear_of: float) -> Mesh:
    """Return a flat bridge along x over `span` metres, about the origin; no pier within `clear_of` metres of it."""
    half = 0.5 * width
    parts = [box((span, width, DECK_THICKNESS), (0, 0, clearance + 0.5 * DECK_THICKNESS), Material.STONE)]
    for side in (-1.0, 1.0):
        parts.append(
            box((span, 0.25, 1.0), (0, side * (half - 0.12), clearance + DECK_THICKNESS + 0.5), Material.STONE, 1.1)
        )
    for x in np.arange(clear_of + 2.0, 0.5 * span, 18.0):
        for y in (-0.3 * width, 0.3 * width):
            parts += [
                rod((s * x, y, -8.0), (s * x, y, clearance), 0.45, Material.STONE, sections=12) for s in (-1.0, 1.0)
            ]
    return join(parts)
