"""Houses, walls and fences along a street: façades with recessed windows, doors, balconies and shop fronts.

A building's body frame has its front in the plane y = 0, from x = 0 to x = width, and stands on the side y > 0.
"""

import numpy as np

from automos.core.geometry import Array
from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import Mesh, box, join, quads, rod


def _wall_with_holes(
    width: float, z0: float, z1: float, holes: Array, material: Material, tint: float, recess: float
) -> Mesh:
    """Return a wall in y = 0 with rectangular `holes` (H, 4: x0, x1, z0, z1) in one row, panes set back by `recess`."""
    if len(holes) == 0:
        return quads([[(0, 0, z0), (width, 0, z0), (width, 0, z1), (0, 0, z1)]], material, tint)
    holes = holes[np.argsort(holes[:, 0])]
    wall: list[list[tuple[float, float, float]]] = []
    panes: list[list[tuple[float, float, float]]] = []
    edges = np.concatenate([[0.0], holes[:, :2].ravel(), [width]]).reshape(-1, 2)  # solid piers between the holes
    for a, b in edges:
        wall.append([(a, 0, z0), (b, 0, z0), (b, 0, z1), (a, 0, z1)])
    for a, b, low, high in holes:
        wall.append([(a, 0, z0), (b, 0, z0), (b, 0, low), (a, 0, low)])
        wall.append([(a, 0, high), (b, 0, high), (b, 0, z1), (a, 0, z1)])
        wall.append([(a, 0, low), (b, 0, low), (b, recess, low), (a, recess, low)])
        wall.append([(a, 0, low), (a, recess, low), (a, recess, high), (a, 0, high)])
        wall.append([(b, 0, low), (b, recess, low), (b, recess, high), (b, 0, high)])
        panes.append([(a, recess, low), (b, recess, low), (b, recess, high), (a, recess, high)])
    return join([quads(wall, material, tint), quads(panes, Material.WINDOW)])


def _storey(width: float, z0: float, height: float, rng: np.random.Generator, bay: float, shop: bool) -> Array:
    n = max(1, int(width / bay))
    centers = (np.arange(n) + 0.5) * width / n
    share = rng.uniform(0.72, 0.85) if shop else rng.uniform(0.36, 0.55)
    low, high = (0.25, 0.88) if shop else (0.32, 0.80)
    half = 0.5 * share * width / n
    return np.column_stack(
        [centers - half, centers + half, np.full(n, z0 + low * height), np.full(n, z0 + high * height)]
    )


def make_building(
    rng: np.random.Generator, width: float, depth: float, storeys: int, smooth: bool = False, shop: bool | None = None
) -> Mesh:
    """Return a building of `storeys`; a `smooth` one has windows set back but a little, no balconies, no plinth."""
    storey_height, bay = rng.uniform(2.8, 3.4), rng.uniform(2.2, 4.0)
    height = storeys * storey_height
    material = Material.WALL if rng.random() < 0.75 else Material.STONE
    tint = rng.uniform(0.55, 1.5)
    recess = rng.uniform(0.04, 0.10) if smooth else rng.uniform(0.12, 0.35)
    shop = bool(rng.random() < 0.35) if shop is None else shop
    parts = []
    for k in range(storeys):
        z0, z1 = k * storey_height - (0.6 if k == 0 else 0.0), (k + 1) * storey_height
        holes = _storey(width, k * storey_height, storey_height, rng, bay, shop and k == 0)
        if smooth and rng.random() < 0.3:
            holes = holes[:0]
        if len(holes) and rng.random() < 0.5 and k == 0:
            holes[int(rng.integers(len(holes))), 2] = 0.05  # the door
        parts.append(_wall_with_holes(width, z0, z1, holes, material, tint, recess))
        if not smooth and k > 0:
            parts += [_balcony(h, rng) for h in holes if rng.random() < 0.12]
    parts.append(_sides_and_roof(width, depth, height, rng, material, tint))
    if not smooth:
        parts.append(box((width, 0.10, 0.6), (0.5 * width, -0.05, 0.3), Material.STONE, tint))  # plinth
        parts.append(box((width, 0.25, 0.25), (0.5 * width, -0.12, height - 0.1), material, tint))  # cornice
        parts.append(rod((0.3, -0.08, 0), (0.3, -0.08, height), 0.05, Material.METAL, sections=6))  # downpipe
        if rng.random() < 0.4:
            x = rng.uniform(0.2, 0.6) * width
            parts.append(_oriel(x, min(2.6, 0.3 * width), storey_height, height, material, tint))
    return join(parts)


def _balcony(hole: Array, rng: np.random.Generator) -> Mesh:
    x0, x1, low, _ = hole
    center, depth = 0.5 * (x0 + x1), rng.uniform(0.8, 1.4)
    width = x1 - x0 + 0.8
    floor = low - 0.5
    slab = box((width, depth, 0.15), (center, -0.5 * depth, floor), Material.STONE)
    rails = [
        rod((x, -depth, floor), (x, -depth, floor + 1.0), 0.015, Material.METAL, sections=3)
        for x in np.linspace(center - width / 2, center + width / 2, 9)
    ]
    bar = rod(
        (center - width / 2, -depth, floor + 1.0),
        (center + width / 2, -depth, floor + 1.0),
        0.025,
        Material.METAL,
        sections=4,
    )
    return join([slab, bar, *rails])


def _oriel(x: float, width: float, z0: float, z1: float, material: Material, tint: float) -> Mesh:
    return box((width, 0.8, z1 - z0 - 0.5), (x + 0.5 * width, -0.4, 0.5 * (z0 + z1)), material, tint)


def _sides_and_roof(
    width: float, depth: float, height: float, rng: np.random.Generator, material: Material, tint: float
) -> Mesh:
    low = -0.6
    sides: list[list[tuple[float, float, float]]] = [
        [(0, 0, low), (0, depth, low), (0, depth, height), (0, 0, height)],
        [(width, 0, low), (width, depth, low), (width, depth, height), (width, 0, height)],
        [(0, depth, low), (width, depth, low), (width, depth, height), (0, depth, height)],
    ]
    ridge = height + (rng.uniform(2.0, 4.0) if rng.random() < 0.6 else 0.0)
    middle = 0.5 * depth
    roof: list[list[tuple[float, float, float]]] = [
        [(0, 0, height), (width, 0, height), (width, middle, ridge), (0, middle, ridge)],
        [(0, depth, height), (width, depth, height), (width, middle, ridge), (0, middle, ridge)],
    ]
    return join([quads(sides, material, tint), quads(roof, Material.STONE, 0.6)])


def make_house(rng: np.random.Generator) -> Mesh:
    """Return a detached house about 9-13 m wide with a pitched roof and a porch or garage."""
    width, depth = rng.uniform(8.0, 13.0), rng.uniform(8.0, 11.0)
    house = make_building(rng, width, depth, int(rng.integers(1, 3)), shop=False)
    if rng.random() < 0.6:
        garage = box((3.2, 5.5, 2.6), (width + 1.6, 4.0, 1.3), Material.WALL, 0.9)
        return join([house, garage])
    return house


def make_wall(rng: np.random.Generator, length: float, height: float) -> Mesh:
    """Return a garden or retaining wall along +x."""
    return box(
        (length, 0.25, height + 0.6), (0.5 * length, 0.0, 0.5 * height - 0.3), Material.STONE, rng.uniform(0.6, 1.4)
    )


def make_fence(rng: np.random.Generator, length: float, height: float = 1.2) -> Mesh:
    """Return a picket or rail fence along +x, through which most beams pass."""
    posts = np.arange(0.0, length + 0.1, 2.0)
    spacing = rng.uniform(0.12, 0.25)
    pickets = np.arange(0.0, length, spacing)
    parts = [box((0.09, 0.09, height + 0.3), (x, 0, 0.5 * height - 0.1), Material.BARK) for x in posts]
    corners = np.array([(-0.04, 0, 0.12), (0.04, 0, 0.12), (0.04, 0, height), (-0.04, 0, height)])
    parts.append(
        quads(corners[None] + pickets[:, None, None] * np.array([1.0, 0, 0]), Material.BARK, rng.uniform(0.7, 1.5))
    )
    parts += [box((length, 0.04, 0.08), (0.5 * length, 0.03, z), Material.BARK) for z in (0.3, 0.85 * height)]
    return join(parts)
