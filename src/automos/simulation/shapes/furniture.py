"""What stands and grows along roads: lamps, signs, lights, benches, rails, gantries, bridges; trees, bushes, hedges.

Foliage is a cloud of leaf-sized triangles, so that beams enter it as they enter leaves.
"""

from collections.abc import Iterator

import numpy as np

from automos.core.geometry import Array
from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import Mesh, ball, box, boxes_on_both_sides, from_faces, join, of_parts, rod

METAL = Material.METAL


@of_parts
def make_lamp(rng: np.random.Generator) -> Iterator[Mesh]:
    """Return a street lamp whose arm reaches toward -y."""
    height = rng.uniform(5.5, 9.0)
    yield rod((0, 0, -0.3), (0, 0, height), 0.09, METAL, 0.8, end_radius=0.05)
    yield rod((0, 0, height), (0, -1.2, height + 0.2), 0.04, METAL, 0.8, sections=5)
    yield box((0.25, 0.6, 0.12), (0, -1.4, height + 0.2), Material.PLASTIC)


def make_sign(rng: np.random.Generator) -> Mesh:
    """Return a traffic sign that faces -x: retro-reflective."""
    height = rng.uniform(2.0, 2.6)
    plate = box((0.03, 0.6, 0.6), (-0.06, 0, height + 0.3), Material.RETRO, rng.uniform(0.3, 1.0))
    return join([rod((0, 0, -0.3), (0, 0, height + 0.6), 0.035, METAL, sections=6), plate])


@of_parts
def make_signal() -> Iterator[Mesh]:
    """Return a traffic light that faces -x."""
    yield rod((0, 0, -0.3), (0, 0, 3.3), 0.06, METAL, 0.5)
    yield box((0.25, 0.32, 0.95), (-0.1, 0, 2.8), Material.PLASTIC, 0.4)


def make_bollard() -> Mesh:
    """Return a bollard."""
    return rod((0, 0, -0.2), (0, 0, 0.95), 0.06, METAL, 0.7)


@of_parts
def make_bin() -> Iterator[Mesh]:
    """Return a litter bin on a post."""
    yield rod((0, 0, -0.2), (0, 0, 1.1), 0.04, METAL)
    yield box((0.35, 0.35, 0.55), (0, -0.2, 0.8), Material.PLASTIC)


@of_parts
def make_bench() -> Iterator[Mesh]:
    """Return a bench along x, looking toward -y."""
    yield box((1.7, 0.45, 0.05), (0, 0, 0.45), Material.BARK)
    yield box((1.7, 0.05, 0.40), (0, 0.24, 0.72), Material.BARK)
    for x in (-0.7, 0.7):
        yield box((0.06, 0.45, 0.45), (x, 0, 0.22), METAL)


@of_parts
def make_cabinet(rng: np.random.Generator) -> Iterator[Mesh]:
    """Return a distribution cabinet or litter container."""
    if rng.random() < 0.5:
        yield box((1.1, 0.4, 1.2), (0, 0, 0.55), Material.PLASTIC, 1.4)
    else:
        yield box((0.7, 0.75, 0.95), (0, 0, 0.62), Material.PLASTIC)
        yield box((0.6, 0.6, 0.15), (0, 0, 0.08), Material.RUBBER)


@of_parts
def make_guard_rail(length: float) -> Iterator[Mesh]:
    """Return a motorway guard rail along +x."""
    for x in np.arange(0.0, length, 4.0):
        yield box((0.08, 0.12, 0.95), (x, 0.08, 0.25), METAL, 0.8)
    yield box((length, 0.06, 0.31), (0.5 * length, 0, 0.6), METAL)


@of_parts
def make_barrier(length: float) -> Iterator[Mesh]:
    """Return a concrete motorway barrier along +x."""
    yield box((length, 0.6, 0.45), (0.5 * length, 0, 0.05), Material.STONE)
    yield box((length, 0.22, 0.70), (0.5 * length, 0, 0.55), Material.STONE)


@of_parts
def make_delineator() -> Iterator[Mesh]:
    """Return a roadside post with its reflector."""
    yield box((0.10, 0.12, 1.2), (0, 0, 0.45), Material.PLASTIC, 3.0)
    yield box((0.01, 0.08, 0.18), (-0.06, 0, 0.75), Material.RETRO, 0.5)


@of_parts
def make_gantry(width: float) -> Iterator[Mesh]:
    """Return a sign gantry across a road that runs along x; it spans y from -width/2 to width/2."""
    for y in (-0.5 * width, 0.5 * width):
        yield rod((0, y, -0.5), (0, y, 6.6), 0.2, METAL)
    yield box((0.5, width, 0.6), (0, 0, 6.6), METAL)
    yield boxes_on_both_sides((0.06, 4.0, 2.2), (-0.35, 0.3 * width, 6.6), Material.RETRO, 0.6)


DECK_THICKNESS = 1.1
"""Metres."""


@of_parts
def make_viaduct(span: float, width: float, clearance: float, clear_of: float) -> Iterator[Mesh]:
    """Return a flat bridge along x over `span` metres, about the origin; no pier within `clear_of` metres of it."""
    yield box((span, width, DECK_THICKNESS), (0, 0, clearance + 0.5 * DECK_THICKNESS), Material.STONE)
    rail = (0, 0.5 * width - 0.12, clearance + DECK_THICKNESS + 0.5)
    yield boxes_on_both_sides((span, 0.25, 1.0), rail, Material.STONE, 1.1)
    for away in np.arange(clear_of + 2.0, 0.5 * span, 18.0):
        for y in (-0.3 * width, 0.3 * width):
            for x in (-away, away):
                yield rod((x, y, -8.0), (x, y, clearance), 0.45, Material.STONE, sections=12)


def leaves(centers: Array, size: float, rng: np.random.Generator) -> Mesh:
    """Return one triangle of about `size` metres, turned at random, at each of `centers` (N, 3)."""
    corners = centers[:, None, :] + rng.normal(0.0, 0.5 * size, (len(centers), 3, 3))
    corners[..., 2] = np.maximum(corners[..., 2], 0.02)
    faces = np.arange(3 * len(centers)).reshape(-1, 3)
    return from_faces(corners.reshape(-1, 3), faces, Material.LEAVES, rng.uniform(0.5, 1.5, len(centers)))


def _in_ellipsoid(n: int, radii: Array, rng: np.random.Generator, hollow: float) -> Array:
    """Return (n, 3) points in an ellipsoid, denser toward its skin as `hollow` goes from 0 to 1."""
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    depth = rng.random(n) ** ((1.0 - 0.8 * hollow) / 3.0)
    return direction * depth[:, None] * radii


@of_parts
def make_tree(rng: np.random.Generator, height: float) -> Iterator[Mesh]:
    """Return a deciduous tree: trunk, branches, and a canopy of several lumps."""
    trunk_height = height * rng.uniform(0.24, 0.36)
    radius = 0.012 * height + rng.uniform(0.03, 0.10)
    lean = rng.normal(0.0, 0.02, 2) * height
    top = np.array([lean[0], lean[1], 0.75 * height])
    yield ball((radius * 2.2, radius * 2.2, 0.25), (0, 0, 0), Material.BARK)
    yield rod((0, 0, 0), top, radius, Material.BARK, end_radius=0.3 * radius, sections=8)
    spread = height * rng.uniform(0.24, 0.34)
    for _ in range(int(rng.integers(5, 9))):
        angle, up = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 0.95)
        out = spread * rng.uniform(0.35, 0.75) * np.sin(np.pi * min(up, 0.9))
        z = trunk_height + up * (0.82 * height - trunk_height)
        tip = np.array([out * np.cos(angle), out * np.sin(angle), z]) + np.array([*lean, 0.0])
        foot = top * rng.uniform(0.35, 0.8)
        yield rod(foot, tip, 0.35 * radius, Material.BARK, end_radius=0.1 * radius, sections=5)
        lump = spread * rng.uniform(0.45, 0.7)
        radii = np.array([lump, lump, 0.8 * lump])
        n = int(13.0 * 4.2 * lump**3 / 0.35)
        yield leaves(tip + _in_ellipsoid(min(max(n, 40), 420), radii, rng, 0.5), 0.32, rng)


def make_bush(rng: np.random.Generator, radius: float, height: float) -> Mesh:
    """Return a bush: dense foliage down to the ground."""
    n = int(np.clip(260 * radius**2 * height, 60, 700))
    centers = _in_ellipsoid(n, np.array([radius, radius, 0.6 * height]), rng, 0.6) + np.array([0.0, 0.0, 0.5 * height])
    return leaves(np.maximum(centers, (-np.inf, -np.inf, 0.05)), 0.16, rng)


def make_thicket(rng: np.random.Generator, radius: float, height: float) -> Mesh:
    """Return a tall shrub or young tree, leafy from the ground up: what grows at the edge of a wood."""
    n = 600
    up = rng.random(n) ** 0.8
    shape = np.sqrt(np.clip(1.15 - up**2, 0.05, 1.0))
    angle, out = rng.uniform(0, 2 * np.pi, n), radius * shape * np.sqrt(rng.random(n))
    lumps = 1.0 + 0.25 * np.sin(3.0 * angle + rng.uniform(0, 6.0)) * np.sin(2.5 * up * height)
    centers = np.column_stack([out * lumps * np.cos(angle), out * lumps * np.sin(angle), 0.1 + up * height])
    stem = rod((0, 0, 0), (0, 0, 0.7 * height), 0.05, Material.BARK, end_radius=0.01, sections=5)
    return join([stem, leaves(centers, 0.38, rng)])


def make_hedge(rng: np.random.Generator, length: float, height: float) -> Mesh:
    """Return a clipped hedge along +x from 0 to `length`: leaves, and the wood that stops the beams that pass them."""
    depth = 0.7
    centers = rng.uniform(
        (0, -0.5 * depth, 0.02), (length, 0.5 * depth, height), (int(140 * length * height * depth), 3)
    )
    wood = box((length, 0.1 * depth, 0.9 * height), (0.5 * length, 0.0, 0.45 * height), Material.BARK, 0.8)
    return join([wood, leaves(centers, 0.15, rng)])


def make_tuft(rng: np.random.Generator, radius: float, height: float) -> Mesh:
    """Return a patch of high grass or herbs."""
    n = int(np.clip(120 * radius**2, 12, 150))
    angle, out = rng.uniform(0, 2 * np.pi, n), radius * np.sqrt(rng.random(n))
    centers = np.column_stack([out * np.cos(angle), out * np.sin(angle), height * rng.random(n) * 0.7])
    return leaves(centers, 0.11, rng)
