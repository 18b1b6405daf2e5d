"""Houses, walls and fences along a street: façades with recessed windows, doors, balconies and shop fronts.

A building's body frame has its front in the plane y = 0, from x = 0 to x = width, and stands on the side y > 0.
"""

from collections.abc import Iterator

import numpy as np

from automos.core.geometry import Array
from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import Mesh, box, of_parts, quads, rod

Corner = tuple[float, float, float]


def _upright(x0: float, x1: float, z0: float, z1: float, y: float = 0.0) -> list[Corner]:
    """Return the corners of a rectangle that looks along y."""
    return [(x0, y, z0), (x1, y, z0), (x1, y, z1), (x0, y, z1)]


@of_parts
def _wall_with_holes(
    width: float, z0: float, z1: float, holes: Array, material: Material, tint: float, recess: float
) -> Iterator[Mesh]:
    """Return a wall in y = 0 with rectangular `holes` (H, 4: x0, x1, z0, z1) in one row, panes set back by `recess`."""
    holes = holes[np.argsort(holes[:, 0])]
    edges = np.concatenate([[0.0], holes[:, :2].ravel(), [width]]).reshape(-1, 2)  # solid piers between the holes
    wall = [_upright(a, b, z0, z1) for a, b in edges]
    for a, b, low, high in holes:
        wall += [_upright(a, b, z0, low), _upright(a, b, high, z1)]
        wall.append([(a, 0, low), (b, 0, low), (b, recess, low), (a, recess, low)])
        wall += [[(x, 0, low), (x, recess, low), (x, recess, high), (x, 0, high)] for x in (a, b)]
    yield quads(wall, material, tint)
    yield quads([_upright(a, b, low, high, recess) for a, b, low, high in holes], Material.WINDOW)


def _storey(width: float, z0: float, height: float, rng: np.random.Generator, bay: float, shop: bool) -> Array:
    n = max(1, int(width / bay))
    centers = (np.arange(n) + 0.5) * width / n
    share = rng.uniform(0.72, 0.85) if shop else rng.uniform(0.36, 0.55)
    low, high = (0.25, 0.88) if shop else (0.32, 0.80)
    half = 0.5 * share * width / n
    heights = np.tile([z0 + low * height, z0 + high * height], (n, 1))
    return np.column_stack([centers - half, centers + half, heights])


@of_parts
def make_building(
    rng: np.random.Generator, width: float, depth: float, storeys: int, smooth: bool = False, shop: bool | None = None
) -> Iterator[Mesh]:
    """Return a building of `storeys`; a `smooth` one has windows set back but a little, no balconies, no plinth."""
    storey_height, bay = rng.uniform(2.8, 3.4), rng.uniform(2.2, 4.0)
    height = storeys * storey_height
    material = Material.WALL if rng.random() < 0.75 else Material.STONE
    tint = rng.uniform(0.55, 1.5)
    recess = rng.uniform(0.04, 0.10) if smooth else rng.uniform(0.12, 0.35)
    shop = bool(rng.random() < 0.35) if shop is None else shop
    for k in range(storeys):
        z0, z1 = k * storey_height - (0.6 if k == 0 else 0.0), (k + 1) * storey_height
        holes = _storey(width, k * storey_height, storey_height, rng, bay, shop and k == 0)
        if smooth and rng.random() < 0.3:
            holes = holes[:0]
        if len(holes) and rng.random() < 0.5 and k == 0:
            holes[int(rng.integers(len(holes))), 2] = 0.05  # the door
        yield _wall_with_holes(width, z0, z1, holes, material, tint, recess)
        if not smooth and k > 0:
            yield from (_balcony(hole, rng) for hole in holes if rng.random() < 0.12)
    yield _sides_and_roof(width, depth, height, rng, material, tint)
    if not smooth:
        yield box((width, 0.10, 0.6), (0.5 * width, -0.05, 0.3), Material.STONE, tint)  # plinth
        yield box((width, 0.25, 0.25), (0.5 * width, -0.12, height - 0.1), material, tint)  # cornice
        yield rod((0.3, -0.08, 0), (0.3, -0.08, height), 0.05, Material.METAL, sections=6)  # downpipe
        if rng.random() < 0.4:
            x, wide = rng.uniform(0.2, 0.6) * width, min(2.6, 0.3 * width)
            middle = (x + 0.5 * wide, -0.4, 0.5 * (storey_height + height))
            yield box((wide, 0.8, height - storey_height - 0.5), middle, material, tint)  # oriel


@of_parts
def _balcony(hole: Array, rng: np.random.Generator) -> Iterator[Mesh]:
    x0, x1, low, _ = hole
    center, depth = 0.5 * (x0 + x1), rng.uniform(0.8, 1.4)
    width, floor = x1 - x0 + 0.8, low - 0.5
    left, right, rail = center - width / 2, center + width / 2, floor + 1.0
    yield box((width, depth, 0.15), (center, -0.5 * depth, floor), Material.STONE)
    yield rod((left, -depth, rail), (right, -depth, rail), 0.025, Material.METAL, sections=4)
    for x in np.linspace(left, right, 9):
        yield rod((x, -depth, floor), (x, -depth, rail), 0.015, Material.METAL, sections=3)


@of_parts
def _sides_and_roof(
    width: float, depth: float, height: float, rng: np.random.Generator, material: Material, tint: float
) -> Iterator[Mesh]:
    low = -0.6
    sides = [[(x, 0.0, low), (x, depth, low), (x, depth, height), (x, 0.0, height)] for x in (0.0, width)]
    yield quads([*sides, _upright(0, width, low, height, depth)], material, tint)
    ridge = height + (rng.uniform(2.0, 4.0) if rng.random() < 0.6 else 0.0)
    middle = 0.5 * depth
    roof = [[(0, y, height), (width, y, height), (width, middle, ridge), (0, middle, ridge)] for y in (0.0, depth)]
    yield quads(roof, Material.STONE, 0.6)


@of_parts
def make_house(rng: np.random.Generator) -> Iterator[Mesh]:
    """Return a detached house about 9-13 m wide with a pitched roof and a porch or garage."""
    width, depth = rng.uniform(8.0, 13.0), rng.uniform(8.0, 11.0)
    yield make_building(rng, width, depth, int(rng.integers(1, 3)), shop=False)
    if rng.random() < 0.6:
        yield box((3.2, 5.5, 2.6), (width + 1.6, 4.0, 1.3), Material.WALL, 0.9)


def make_wall(rng: np.random.Generator, length: float) -> Mesh:
    """Return a garden or retaining wall along +x."""
    height = rng.uniform(0.6, 1.4)
    middle = (0.5 * length, 0.0, 0.5 * height - 0.3)
    return box((length, 0.25, height + 0.6), middle, Material.STONE, rng.uniform(0.6, 1.4))


@of_parts
def make_fence(rng: np.random.Generator, length: float) -> Iterator[Mesh]:
    """Return a picket fence along +x, through which most beams pass."""
    height, spacing = 1.2, rng.uniform(0.12, 0.25)
    for x in np.arange(0.0, length + 0.1, 2.0):
        yield box((0.09, 0.09, height + 0.3), (x, 0, 0.5 * height - 0.1), Material.BARK)
    pickets = [_upright(x - 0.04, x + 0.04, 0.12, height) for x in np.arange(0.0, length, spacing)]
    yield quads(pickets, Material.BARK, rng.uniform(0.7, 1.5))
    for z in (0.3, 0.85 * height):
        yield box((length, 0.04, 0.08), (0.5 * length, 0.03, z), Material.BARK)
