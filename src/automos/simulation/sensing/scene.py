"""Surfaces that beams hit: a mesh in the ray tracer's tree, and the nearest hit on each beam.

A pane lets some beams through, swallows some and returns the rest; a beam that passes goes on to what is behind.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from automos.simulation.sensing.sensors import Array32
from automos.simulation.shapes.materials import column
from automos.simulation.shapes.mesh import Mesh

EGO = -1
"""Object id of the ego vehicle's own body."""
AIR = -2
"""Object id of drops and dust."""
WHOLE_PANE = 0.8
"""How far a pane behaves as a whole (1) or beam by beam (0)."""
PANE_DIMS = 0.5
"""Share of an echo that comes back through a pane, both ways together."""
_BEHIND_PANE = 0.02
"""Metres behind a pane where a beam that passed it starts again."""
_MAX_PANES = 4


@dataclass(eq=False)
class Hits:
    """The nearest surface on each of N beams.

    Attributes
    ----------
    distance : (N,) float32 metres, inf if nothing is hit.
    material : (N,) uint8.
    tint : (N,) float32.
    cosine : (N,) float32 of the angle of incidence.
    object : (N,) int32, id of the object hit, 0 for scenery, or EGO or AIR.
    lost : (N,) bool, the surface swallowed the beam.
    """

    distance: Array32
    material: npt.NDArray[np.uint8]
    tint: Array32
    cosine: Array32
    object: npt.NDArray[np.int32]
    lost: npt.NDArray[np.bool_]

    @classmethod
    def none(cls, n: int, reach: float) -> Self:
        """Return no hits for `n` beams of `reach` metres."""
        distance, material, tint = np.full(n, reach, np.float32), np.zeros(n, np.uint8), np.zeros(n, np.float32)
        return cls(distance, material, tint, np.ones(n, np.float32), np.zeros(n, np.int32), np.ones(n, np.bool_))


@cache
def _device() -> Any:
    """Return the one device all scenes share; each device of its own would cost threads and memory."""
    from embreex.rtcore import EmbreeDevice

    return EmbreeDevice()


class Scene:
    """A mesh ready to be hit. Not picklable, as the ray tracer's trees are not."""

    def __init__(self, mesh: Mesh, owner: npt.NDArray[np.int32] | int):
        """Build the tree over `mesh`; `owner` is the object id of each face, or of all."""
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene = EmbreeScene(_device())
        vertices = np.ascontiguousarray(mesh.vertices, np.float32)
        TriangleMesh(self._scene, vertices, np.ascontiguousarray(mesh.faces, np.int32))
        corners = mesh.vertices[mesh.faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        self._normal, self._material, self._tint = normal.astype(np.float32), mesh.material, mesh.tint
        self._owner = np.broadcast_to(np.asarray(owner, np.int32), len(mesh.faces))
        self._lost, self._passed = column("lost")[mesh.material], column("passed")[mesh.material]
        # A pane behaves as a whole: curtained or not, tinted or not. Both triangles of a quad share its luck.
        seed = int(1e4 * np.abs(mesh.tint).sum()) + len(mesh)
        self._luck = np.random.default_rng(seed).random(len(mesh) // 2 + 1, np.float32)[np.arange(len(mesh)) // 2]

    def first(self, origin: Array32, direction: Array32, reach: Array32) -> tuple[npt.NDArray[np.int32], Array32]:
        """Return ((N,) face or -1, (N,) distance) of the first face on each beam within `reach`."""
        found = self._scene.run(origin, direction, dists=reach.copy(), output=True)  # it writes to what it is given
        return found["primID"], found["tfar"]

    def cast(
        self, origin: Array32, direction: Array32, hits: Hits, rows: npt.NDArray[np.int64] | None, chance: Array32
    ) -> None:
        """Update `hits` (at `rows`, all where None) where this scene is nearer.

        `chance` (N,) in [0, 1) decides for each beam whether a pane swallows, passes or returns it.
        """
        best = hits.distance if rows is None else hits.distance[rows]
        face, distance = self.first(origin, direction, best)
        found = np.flatnonzero(face >= 0)
        if len(found) == 0:
            return
        face, distance = face[found], distance[found]
        is_pane = self._passed[face] > 0
        own = 1.0 - WHOLE_PANE * is_pane
        chance = own * chance[found] + (1.0 - own) * self._luck[face]
        face, distance, dimmed = self._through_panes(origin, direction, best, found, face, distance, chance)
        at = found if rows is None else rows[found]
        hits.tint[at] *= dimmed  # where it goes on to something behind this scene
        kept = face >= 0
        at, found, face, chance = at[kept], found[kept], face[kept], chance[kept]
        hits.distance[at] = distance[kept]
        hits.material[at] = self._material[face]
        hits.tint[at] = self._tint[face] * dimmed[kept]
        hits.cosine[at] = np.abs(np.einsum("ij,ij->i", self._normal[face], direction[found]))
        hits.object[at] = self._owner[face]
        hits.lost[at] = chance < self._lost[face]

    def _through_panes(self, origin, direction, best, found, face, distance, chance):  # type: ignore[no-untyped-def]
        """Return face, distance and dimming with the beams that pass panes followed to what is behind them."""
        dimmed = np.ones(len(found), np.float32)
        for _ in range(_MAX_PANES):
            lost, passed = self._lost[face], self._passed[face]
            goes_on = np.flatnonzero((face >= 0) & (chance >= lost) & (chance < lost + passed))
            if len(goes_on) == 0:
                break
            dimmed[goes_on] *= PANE_DIMS
            chance[goes_on] = (chance[goes_on] - lost[goes_on]) / passed[goes_on]
            rays = found[goes_on]
            start = distance[goes_on] + np.float32(_BEHIND_PANE)
            left = np.maximum(best[rays] - start, 0.0).astype(np.float32)
            next_face, further = self.first(origin[rays] + start[:, None] * direction[rays], direction[rays], left)
            face[goes_on] = next_face
            distance[goes_on] = start + further
        return face, distance, dimmed
