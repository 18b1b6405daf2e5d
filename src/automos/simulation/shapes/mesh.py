"""Triangle meshes with a material and a tint per face, and the few primitives everything is made of.

Bodies (cars, trucks, trams) are lofts: cross-sections along the length, joined by strips. Round and boxy parts come
from `trimesh`. Units are metres; x is forward, y left, z up, and z = 0 is the ground a thing stands on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, wraps
from itertools import pairwise
from typing import ParamSpec

import numpy as np
import numpy.typing as npt

from automos.simulation.shapes.materials import Material

Vector = Sequence[float] | npt.NDArray[np.float64]
"""Three numbers."""
_Given = ParamSpec("_Given")


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles.

    Attributes
    ----------
    vertices : (V, 3) float64
        Metres.
    faces : (F, 3) int32
        Rows of `vertices`.
    material : (F,) uint8
        Values of `Material`.
    tint : (F,) float32
        Factor on the material's reflectivity.
    """

    vertices: npt.NDArray[np.float64]
    faces: npt.NDArray[np.int32]
    material: npt.NDArray[np.uint8]
    tint: npt.NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.faces)

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> Mesh:
        """Return the mesh turned by `yaw` (radians) about +z and then shifted."""
        c, s = np.cos(yaw), np.sin(yaw)
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return replace(self, vertices=self.vertices @ R.T + (x, y, z))

    def transformed(self, T: npt.NDArray[np.float64]) -> Mesh:
        """Return the mesh mapped by the (4, 4) transform `T`."""
        return replace(self, vertices=self.vertices @ T[:3, :3].T + T[:3, 3])

    def scaled(self, factor: float | Sequence[float]) -> Mesh:
        """Return the mesh stretched by one factor or one per axis."""
        return replace(self, vertices=self.vertices * np.asarray(factor))

    def painted(self, factor: float) -> Mesh:
        """Return the mesh with the tint of all its paint multiplied by `factor`."""
        tint = self.tint.copy()
        tint[self.material == Material.PAINT] *= factor
        return replace(self, tint=tint)

    @property
    def bounds(self) -> npt.NDArray[np.float64]:
        """(2, 3) least and greatest corner."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])


def join(meshes: Iterable[Mesh]) -> Mesh:
    """Return one mesh of all `meshes`, faces in order."""
    meshes = list(meshes)
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + np.int32(start) for m, start in zip(meshes, starts, strict=True)]),
        np.concatenate([m.material for m in meshes]),
        np.concatenate([m.tint for m in meshes]),
    )


def of_parts(parts: Callable[_Given, Iterable[Mesh]]) -> Callable[_Given, Mesh]:
    """Turn a function that yields the parts of something into one that returns the whole."""

    @wraps(parts)
    def whole(*args: _Given.args, **named: _Given.kwargs) -> Mesh:
        return join(parts(*args, **named))

    return whole


def from_faces(vertices: npt.ArrayLike, faces: npt.ArrayLike, material: Material, tint: npt.ArrayLike = 1.0) -> Mesh:
    """Return a mesh of one material, and of one tint or one per face."""
    faces = np.asarray(faces, np.int32)
    materials, tints = np.full(len(faces), material, np.uint8), np.full(len(faces), tint, np.float32)
    return Mesh(np.asarray(vertices, np.float64), faces, materials, tints)


def quads(corners: npt.ArrayLike, material: Material, tint: float = 1.0) -> Mesh:
    """Return two triangles for each of `corners` (Q, 4, 3), given around the rim."""
    corners = np.asarray(corners, np.float64).reshape(-1, 4, 3)
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    faces = (4 * np.arange(len(corners))[:, None, None] + halves).reshape(-1, 3)
    return from_faces(corners.reshape(-1, 3), faces, material, tint)


_SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
_BOX_CORNERS = np.array([[*corner, z] for z in (-0.5, 0.5) for corner in _SQUARE])
_BOX_RIMS = np.array([[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])


def box(size: Vector, center: Vector, material: Material, tint: float = 1.0) -> Mesh:
    """Return a box of `size` (length, width, height) about `center`."""
    corners = _BOX_CORNERS * np.asarray(size) + np.asarray(center)
    return quads(corners[_BOX_RIMS], material, tint)


def boxes_on_both_sides(size: Vector, center: Vector, material: Material, tint: float = 1.0) -> Mesh:
    """Return two boxes of `size`, the one on the left about `center`; the one on the right comes first."""
    x, y, z = center
    return join([box(size, (x, side * y, z), material, tint) for side in (-1.0, 1.0)])


@cache
def _unit_cylinder(sections: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    import trimesh

    cylinder = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=sections)
    return np.array(cylinder.vertices) + np.array([0.0, 0.0, 0.5]), np.array(cylinder.faces, np.int32)


def rod(
    start: Vector,
    end: Vector,
    radius: float,
    material: Material,
    tint: float = 1.0,
    end_radius: float | None = None,
    sections: int = 8,
) -> Mesh:
    """Return a cylinder from `start` to `end`, tapered where `end_radius` is given."""
    vertices, faces = _unit_cylinder(sections)
    x, y, z = (float(b) - float(a) for a, b in zip(start, end, strict=True))
    length, level = math.sqrt(x * x + y * y + z * z), math.hypot(x, y)
    across = (-y / level, x / level, 0.0) if level > 1e-9 else (0.0, 1.0, 0.0)
    up = (across[1] * z, -across[0] * z, across[0] * y - across[1] * x)  # across x axis, times length
    axes = np.array([[up[0] / length, up[1] / length, up[2] / length], across, [x, y, z]])
    width = radius + ((radius if end_radius is None else end_radius) - radius) * vertices[:, 2:]
    return from_faces(vertices * np.hstack([width, width, np.ones_like(width)]) @ axes + start, faces, material, tint)


@cache
def _unit_ball() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=1, radius=1.0)
    return np.array(ball.vertices), np.array(ball.faces, np.int32)


def ball(radius: float | Vector, center: Vector, material: Material, tint: float = 1.0) -> Mesh:
    """Return a sphere, or an ellipsoid where three radii are given."""
    vertices, faces = _unit_ball()
    return from_faces(vertices * np.asarray(radius) + np.asarray(center), faces, material, tint)


@of_parts
def wheel(center: Vector, radius: float, width: float) -> Iterator[Mesh]:
    """Return a tyre with its rim; its axle lies along y."""
    x, y, z = center
    yield rod((x, y - 0.5 * width, z), (x, y + 0.5 * width, z), radius, Material.RUBBER, sections=14)
    yield rod((x, y - 0.52 * width, z), (x, y + 0.52 * width, z), 0.62 * radius, Material.METAL, 0.8, sections=10)


@dataclass(frozen=True)
class Section:
    """A cross-section of a body at `x`: bottom, belt (the widest line) and top heights, half-widths at belt and top.

    `upper` is the material of the side between belt and top and `top` that of the roof, both from here to the next
    section.
    """

    x: float
    bottom: float
    belt: float
    top: float
    half_belt: float
    half_top: float
    upper: Material = Material.PAINT
    roof: Material = Material.PAINT

    @property
    def rim(self) -> npt.NDArray[np.float64]:
        """(6, 3) its corners: up on the left, down on the right."""
        left = [(self.half_belt * 0.94, self.bottom), (self.half_belt, self.belt), (self.half_top, self.top)]
        return np.array([(self.x, y, z) for y, z in left] + [(self.x, -y, z) for y, z in reversed(left)])


@of_parts
def loft(sections: Sequence[Section], caps: Material = Material.PAINT) -> Iterator[Mesh]:
    """Return the closed body through `sections`, which run along +x."""
    for section, following in pairwise(sections):
        rim, other = section.rim, following.rim
        strip = [Material.PAINT, section.upper, section.roof, section.upper, Material.PAINT, Material.PLASTIC]
        for j, material in enumerate(strip):
            i = (j + 1) % 6
            yield quads([rim[j], rim[i], other[i], other[j]], material)
    for section in (sections[0], sections[-1]):
        yield from_faces(section.rim, [[0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4]], caps)
