"""Furnishing a road with what grows: trees, bushes, hedges, high grass. A few shapes are grown and used many times."""

from functools import cache

import numpy as np

from automos.simulation.roadside import along
from automos.simulation.shapes import vegetation
from automos.simulation.shapes.mesh import Mesh
from automos.simulation.traffic.paths import Path
from automos.simulation.world import Site

CAR = 2.4
"""Metres around the middle of a standing thing that nothing grows in."""


@cache
def _tree_templates() -> tuple[Mesh, ...]:
    rng = np.random.default_rng([0, 3])
    return tuple(vegetation.make_tree(rng, rng.uniform(6.0, 12.0)) for _ in range(8))


def a_tree(site: Site) -> Mesh:
    """Return a tree: one of a few grown shapes, turned and stretched at random."""
    rng = site.rng
    tree = _tree_templates()[int(rng.integers(8))]
    scale = rng.uniform(0.8, 1.2)
    return tree.scaled((scale, scale, scale * rng.uniform(0.9, 1.1))).moved(yaw=rng.uniform(0, 2 * np.pi))


def place_trees(
    site: Site,
    path: Path,
    offset: float,
    spacing: tuple[float, float],
    clearance: float = 0.7,
    sway: float = 0.0,
) -> None:
    """Plant trees along a path; with `sway` (radians) they rock in the wind."""
    for x, y, _ in along(site, path, offset, spacing, clearance):
        if not site.is_free(x, y, CAR):
            continue
        if sway > 0:
            site.sway(a_tree(site), x, y, sway)
        else:
            site.add(a_tree(site), x, y)


def scatter_bushes(
    site: Site, path: Path, offsets: tuple[float, float], spacing: tuple[float, float], sway: float = 0.0
) -> None:
    """Scatter bushes between two offsets (metres left of the path)."""
    for x, y, heading in along(site, path, 0.0, spacing, -np.inf):
        off = site.rng.uniform(min(offsets), max(offsets))
        x, y = x - off * np.sin(heading), y + off * np.cos(heading)
        radius = site.rng.uniform(0.4, 1.3)
        if site.terrain.road_distance(np.array([[x, y]]))[0] < radius + 0.5 or not site.is_free(x, y, radius + CAR):
            continue
        bush = vegetation.make_bush(site.rng, radius, radius * site.rng.uniform(1.0, 1.9))
        if sway > 0:
            site.sway(bush, x, y, sway)
        else:
            site.add(bush, x, y)


def place_thickets(
    site: Site, path: Path, offsets: tuple[float, float], spacing: tuple[float, float], heights: tuple[float, float]
) -> None:
    """Grow tall shrubs between two offsets: the edge of a wood."""
    rng = site.rng
    templates = [vegetation.make_thicket(rng, 0.35 * h + 0.3, h) for h in rng.uniform(*heights, 8)]
    for x, y, heading in along(site, path, 0.0, spacing, -np.inf):
        off = rng.uniform(min(offsets), max(offsets))
        x, y = x - off * np.sin(heading), y + off * np.cos(heading)
        if site.terrain.road_distance(np.array([[x, y]]))[0] > 2.5 and site.is_free(x, y, 1.5 + CAR):
            site.add(templates[int(rng.integers(8))].scaled(rng.uniform(0.8, 1.2)), x, y, rng.uniform(0, 2 * np.pi))


def scatter_tufts(site: Site, path: Path, offsets: tuple[float, float], per_metre: float) -> None:
    """Scatter high grass between two offsets."""
    rng = site.rng
    templates = [vegetation.make_tuft(rng, rng.uniform(0.3, 0.9), rng.uniform(0.15, 0.6)) for _ in range(12)]
    n = int(per_metre * path.length)
    xy, _ = path.at(rng.uniform(0, path.length, n), rng.uniform(min(offsets), max(offsets), n))
    free = site.terrain.road_distance(xy) > 1.0
    for (x, y), z in zip(xy[free], site.terrain.height(xy[free]), strict=True):
        if site.is_free(x, y, CAR):
            site.add(templates[int(rng.integers(len(templates)))], x, y, rng.uniform(0, 2 * np.pi), z=z)


def place_hedges(site: Site, path: Path, offset: float, share: float) -> None:
    """Plant clipped hedges along a `share` of a path."""
    rng = site.rng
    s = rng.uniform(0.0, 20.0)
    while s < path.length - 8.0:
        length = rng.uniform(5.0, 8.0)
        if rng.random() < share:
            (ends, _), height = path.at([s, s + 0.5 * length, s + length], offset), rng.uniform(0.8, 2.0)
            if site.terrain.road_distance(ends).min() > 0.8 and site.is_free(
                float(ends[1, 0]), float(ends[1, 1]), 0.5 * length + 1.0
            ):
                turn = float(np.arctan2(*(ends[2] - ends[0])[::-1]))
                x, y = ends[0].tolist()
                site.add(vegetation.make_hedge(rng, length, height), x, y, turn)
        s += length
