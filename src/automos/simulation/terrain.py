"""The ground: gentle hills, roads with crown and kerbs, rough verges; as a height anywhere and as a mesh.

Roads are one signed distance field (metres, negative on the carriageway), joined smoothly so that junctions get rounded
corners. The mesh has pairs of vertices along the kerb lines, so that a kerb is a step and not a ramp.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.kernels import kernel
from automos.simulation.shapes.materials import Material
from automos.simulation.shapes.mesh import Mesh
from automos.simulation.traffic.paths import Path, Range

KERB_RAMP = 0.04
"""Metres over which a kerb rises."""
CROWN = 0.02
"""Cross slope of a road."""
LINE_STEP, CHUNK = 4, 16
"""Samples of a path per segment of a road's middle line, and segments looked at together."""


@dataclass(frozen=True, eq=False)
class Road:
    """A carriageway about `center` with `half_width`, and a raised `sidewalk` of that width on both sides (0: none)."""

    center: Path
    half_width: float
    sidewalk: float = 0.0


def make_hills(rng: np.random.Generator, waves: Sequence[Range]) -> Array:
    """Return (H, 4) hills for `Terrain`: waves of (amplitude, length) in metres, in random directions."""
    rows = []
    for amplitude, length in waves:
        angle, k = rng.uniform(0.0, 2 * np.pi), 2 * np.pi / length
        rows.append((amplitude, k * np.cos(angle), k * np.sin(angle), rng.uniform(0.0, 2 * np.pi)))
    return np.array(rows)


@dataclass(frozen=True, eq=False)
class Terrain:
    """Heights of the ground.

    Attributes
    ----------
    roads : tuple of Road
        Carriageways.
    hills : (H, 4) float64
        Amplitude in metres, wave vector in rad/m (two columns), phase in radians.
    kerb : float
        Metres, step from the carriageway to the sidewalk or verge.
    verge : Material
        Material beyond the sidewalks.
    roughness : float
        Metres, scatter of the ground beyond the sidewalks.
    corner : float
        Metres, how far junction corners are rounded.
    """

    roads: tuple[Road, ...]
    hills: Array
    kerb: float = 0.12
    verge: Material = Material.GRASS
    roughness: float = 0.04
    corner: float = 4.0
    seed: int = 0

    def road_distance(self, xy: Array) -> Array:
        """Return (N,) metres to the nearest carriageway, negative on it, for `xy` (N, 2)."""
        half = np.array([road.half_width for road in self.roads])
        return _union_distance(np.ascontiguousarray(xy, np.float64), *self._chunks, half, self.corner)

    @cached_property
    def _chunks(self) -> tuple[Array, npt.NDArray[np.int64], npt.NDArray[np.int64], Array]:
        """The middle lines cut into chunks: (L, 2) points, (C + 1,) where chunks start, (C,) road, (C, 3) circles."""
        points, starts, owner, circles = [], [0], [], []
        for k, road in enumerate(self.roads):
            line = np.concatenate([road.center.xy[:-1:LINE_STEP], road.center.xy[-1:]])
            for i in range(0, len(line) - 1, CHUNK):
                piece = line[i : i + CHUNK + 1]
                middle = 0.5 * (piece.min(axis=0) + piece.max(axis=0))
                circles.append((*middle, np.linalg.norm(piece - middle, axis=1).max()))
                points.append(piece)
                starts.append(starts[-1] + len(piece))
                owner.append(k)
        return np.concatenate(points), np.array(starts), np.array(owner), np.array(circles)

    def base(self, xy: Array) -> Array:
        """Return (N,) metres, the height of the hills alone."""
        z = np.zeros(len(xy))
        for amplitude, kx, ky, phase in self.hills:
            z += amplitude * np.sin(kx * xy[:, 0] + ky * xy[:, 1] + phase)
        return z

    def height(self, xy: Array, distance: Array | None = None) -> Array:
        """Return (N,) metres, the height of the ground with crown and kerbs but without its roughness."""
        distance = self.road_distance(xy) if distance is None else distance
        rise = np.clip((distance + 0.5 * KERB_RAMP) / KERB_RAMP, 0.0, 1.0)
        return self.base(xy) + CROWN * np.clip(-distance, 0.0, 4.0) + self.kerb * rise

    def mesh(self, reach: float) -> Mesh:
        """Return the ground within `reach` metres of the roads."""
        from scipy.spatial import Delaunay

        rng = np.random.default_rng([self.seed, 77])
        xy = self._vertices(reach, rng)
        distance = self.road_distance(xy)
        wild = np.clip((distance - self._walk) / 2.0, 0.0, 1.0)
        z = self.height(xy, distance) + rng.normal(0.0, 1.0, len(xy)) * (0.005 + self.roughness * wild)
        faces = Delaunay(xy).simplices.astype(np.int32)
        lengths = np.linalg.norm(xy[faces] - xy[np.roll(faces, 1, axis=1)], axis=2)
        faces = faces[lengths.max(axis=1) < 25.0]
        middle = distance[faces].mean(axis=1)
        material = np.select([middle < 0.0, middle < self._walk], [Material.ASPHALT, Material.PAVEMENT], self.verge)
        patches = 1.0 + 0.25 * np.sin(0.31 * xy[faces[:, 0], 0]) * np.sin(0.23 * xy[faces[:, 0], 1] + 1.0)
        tint = (patches * rng.uniform(0.9, 1.1, len(faces))).astype(np.float32)
        return Mesh(np.column_stack([xy, z]), faces, material.astype(np.uint8), tint)

    @property
    def _walk(self) -> float:
        return max((road.sidewalk for road in self.roads), default=0.0)

    def _vertices(self, reach: float, rng: np.random.Generator) -> Array:
        from scipy.spatial import cKDTree

        centers = np.concatenate([road.center.xy[::4] for road in self.roads])
        tree = cKDTree(centers)
        low, high = centers.min(axis=0) - reach, centers.max(axis=0) + reach
        parts = [self._edges()]
        for spacing, inner, outer in ((1.2, -np.inf, 9.0), (3.0, 9.0, 30.0), (9.0, 30.0, np.inf)):
            xs, ys = (np.arange(a, b, spacing) for a, b in zip(low, high, strict=True))
            grid = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
            grid += rng.uniform(-0.3, 0.3, grid.shape) * spacing
            grid = grid[np.isfinite(tree.query(grid, distance_upper_bound=reach)[0])]
            distance = self.road_distance(grid)
            parts.append(grid[(distance >= inner) & (distance < outer) & (np.abs(distance) > 0.6)])
        return np.concatenate(parts)

    def _edges(self) -> Array:
        """Return (2K, 2) vertices just inside and just outside every road's edge, in pairs across it."""
        from scipy.spatial import cKDTree

        edges = np.concatenate([r.center.beside(s * r.half_width).xy[::2] for r in self.roads for s in (-1.0, 1.0)])
        for _ in range(5):  # walk down to the zero line of the joined field
            edges = edges - self.road_distance(edges)[:, None] * self._gradient(edges)
        gradient = self._gradient(edges)
        good = (np.abs(self.road_distance(edges)) < 0.01) & (np.linalg.norm(gradient, axis=1) > 0.5)
        edges, gradient = edges[good], gradient[good]
        drop = np.zeros(len(edges), bool)
        for i, j in sorted(cKDTree(edges).query_pairs(0.6)):
            drop[j] |= not drop[i]
        edges, gradient = edges[~drop], gradient[~drop]
        gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
        return np.concatenate([edges - 0.5 * KERB_RAMP * gradient, edges + 0.5 * KERB_RAMP * gradient])

    def _gradient(self, xy: Array) -> Array:
        """Return the (N, 2) gradient of the distance to the nearest carriageway."""
        step = 0.05
        slope = [self.road_distance(xy + d) - self.road_distance(xy - d) for d in step * np.eye(2)]
        return np.column_stack(slope) / (2 * step)


@kernel
def _union_distance(xy, points, starts, owner, circles, half, corner):  # type: ignore[no-untyped-def]
    """Distance to the union of thick polylines; where two come near each other their edge is rounded by `corner`."""
    out, squared = np.empty(len(xy)), np.empty(len(half))
    for i in range(len(xy)):
        squared[:] = np.inf
        for c in range(len(owner)):
            r = owner[c]
            away = np.hypot(xy[i, 0] - circles[c, 0], xy[i, 1] - circles[c, 1]) - circles[c, 2]
            if away > 0.0 and away * away > squared[r]:
                continue
            for k in range(starts[c], starts[c + 1] - 1):
                ax, ay = points[k, 0], points[k, 1]
                ux, uy = points[k + 1, 0] - ax, points[k + 1, 1] - ay
                px, py = xy[i, 0] - ax, xy[i, 1] - ay
                t = min(max((px * ux + py * uy) / (ux * ux + uy * uy), 0.0), 1.0)
                squared[r] = min(squared[r], (px - t * ux) ** 2 + (py - t * uy) ** 2)
        best = np.inf
        for r in range(len(half)):
            d = np.sqrt(squared[r]) - half[r]
            h = max(corner - abs(best - d), 0.0) / corner if best < np.inf else 0.0
            best = min(best, d) - 0.25 * h * h * corner
        out[i] = best
    return out
