"""What every beam of a sweep hits: the still world once, every moving body in its own frame, the nearest hit wins.

A beam leaves from where the sensor is at the beam's own time, and a moving body is cast at where it is at that time, so
sweeps are distorted by both motions as real ones are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from automos.simulation.materials import column
from automos.simulation.mesh import Mesh

Array = npt.NDArray[np.float64]
Array32 = npt.NDArray[np.float32]

EGO = -1
"""Object id of the ego vehicle's own body."""
_BEHIND_PANE = 0.02
"""Metres behind a pane where a beam that passed it starts again."""
_MAX_PANES = 4


@dataclass(eq=False)
class Hits:
    """The nearest surface on each of N beams.

    Attributes
    ----------
    distance : (N,) float32 metres, inf where nothing is hit.
    material : (N,) uint8.
    tint : (N,) float32.
    cosine : (N,) float32 of the angle of incidence.
    object : (N,) int32, id of the object hit, 0 for scenery, EGO for the ego's own body.
    lost : (N,) bool, the surface swallowed the beam.
    """

    distance: Array32
    material: npt.NDArray[np.uint8]
    tint: Array32
    cosine: Array32
    object: npt.NDArray[np.int32]
    lost: npt.NDArray[np.bool_]

    @staticmethod
    def none(n: int, reach: float) -> Hits:
        """Return no hits for `n` beams of `reach` metres."""
        return Hits(
            np.full(n, reach, np.float32),
            np.zeros(n, np.uint8),
            np.zeros(n, np.float32),
            np.ones(n, np.float32),
            np.zeros(n, np.int32),
            np.ones(n, np.bool_),
        )


class Scene:
    """A mesh ready to be hit. Not picklable, as the ray tracer's trees are not."""

    def __init__(self, mesh: Mesh, owner: npt.NDArray[np.int32] | int):
        """Build the tree over `mesh`; `owner` is the object id of each face, or of all."""
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene = EmbreeScene()
        vertices = np.ascontiguousarray(mesh.vertices, np.float32)
        TriangleMesh(self._scene, vertices, np.ascontiguousarray(mesh.faces, np.int32))
        corners = mesh.vertices[mesh.faces]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        self._normal = normal.astype(np.float32)
        self._material = mesh.material
        self._tint = mesh.tint
        self._owner = np.broadcast_to(np.asarray(owner, np.int32), len(mesh.faces))
        lost, passed = column("lost"), column("passed")
        self._lost = lost[mesh.material]
        self._passed = passed[mesh.material]

    def first(self, origin: Array32, direction: Array32, reach: Array32) -> tuple[npt.NDArray[np.int32], Array32]:
        """Return ((N,) face or -1, (N,) distance) of the first face on each beam within `reach`."""
        found = self._scene.run(origin, direction, dists=reach, output=True)
        return found["primID"], found["tfar"]

    def cast(self, origin: Array32, direction: Array32, hits: Hits, rows: npt.NDArray[np.int64] | None, chance: Array32) -> None:
        """Update `hits` (at `rows`, all where None) where this scene is nearer.

        `chance` (N,) in [0, 1) decides for each beam whether a pane swallows, passes or returns it.
        """
        best = hits.distance if rows is None else hits.distance[rows]
        face, distance = self.first(origin, direction, best)
        found = np.flatnonzero(face >= 0)
        if len(found) == 0:
            return
        face, distance, chance = face[found], distance[found], chance[found]
        face, distance = self._through_panes(origin, direction, best, found, face, distance, chance)
        kept = face >= 0
        found, face, distance, chance = found[kept], face[kept], distance[kept], chance[kept]
        at = found if rows is None else rows[found]
        hits.distance[at] = distance
        hits.material[at] = self._material[face]
        hits.tint[at] = self._tint[face]
        hits.cosine[at] = np.abs(np.einsum("ij,ij->i", self._normal[face], direction[found]))
        hits.object[at] = self._owner[face]
        hits.lost[at] = chance < self._lost[face]

    def _through_panes(self, origin, direction, best, found, face, distance, chance):  # type: ignore[no-untyped-def]
        """Return face and distance with the beams that pass panes followed to what is behind them."""
        for _ in range(_MAX_PANES):
            lost, passed = self._lost[face], self._passed[face]
            goes_on = np.flatnonzero((face >= 0) & (chance >= lost) & (chance < lost + passed))
            if len(goes_on) == 0:
                break
            chance[goes_on] = (chance[goes_on] - lost[goes_on]) / passed[goes_on]
            rays = found[goes_on]
            start = distance[goes_on] + np.float32(_BEHIND_PANE)
            left = np.maximum(best[rays] - start, 0.0).astype(np.float32)
            next_face, further = self.first(origin[rays] + start[:, None] * direction[rays], direction[rays], left)
            face[goes_on] = next_face
            distance[goes_on] = start + further
        return face, distance


def sweep_rays(direction: Array32, column_of: npt.NDArray[np.int32], poses: Array) -> tuple[Array32, Array32]:
    """Return ((N, 3) origins, (N, 3) directions) in the site frame of beams fired at the (C, 4, 4) `poses` of their column."""
    origins = np.empty_like(direction)
    turned = np.empty_like(direction)
    _sweep_rays(direction, column_of, poses, origins, turned)
    return origins, turned


@numba.njit(cache=True, nogil=True)
def _sweep_rays(direction, column_of, poses, origins, turned):  # type: ignore[no-untyped-def]
    for i in range(len(direction)):
        T = poses[column_of[i]]
        x, y, z = direction[i]
        for k in range(3):
            turned[i, k] = T[k, 0] * x + T[k, 1] * y + T[k, 2] * z
            origins[i, k] = T[k, 3]


def rays_at_body(
    origins: Array32, directions: Array32, phase: Array32, reach: Array32, start: Array, end: Array, center: Array, radius: float
) -> tuple[npt.NDArray[np.int64], Array32, Array32]:
    """Return the beams that may hit a body, in the body's frame.

    Parameters
    ----------
    origins, directions : (N, 3) site frame.
    phase : (N,) in [-0.5, 0.5], when in the sweep.
    reach : (N,) metres, the nearest hit so far.
    start, end : (6,) states of the body at the sweep's start and end; in between it moves evenly.
    center : (3,) middle of the body, body frame.
    radius : metres, of the sphere about `center` that holds the body.

    Returns
    -------
    (K,) rows, (K, 3) origins and (K, 3) directions in the body frame.
    """
    from automos.simulation.motion import transforms

    middle = transforms(0.5 * (start + end))
    here = middle[:3, :3] @ center + middle[:3, 3]
    margin = radius + 0.5 * float(np.linalg.norm(end[:3] - start[:3])) + 0.6 * radius * abs(end[3] - start[3])
    rows = _near_rays(origins, directions, reach, here, margin)
    local_origins = np.empty((len(rows), 3), np.float32)
    local_directions = np.empty((len(rows), 3), np.float32)
    _into_body(origins, directions, phase, rows, start, end, local_origins, local_directions)
    return rows, local_origins, local_directions


@numba.njit(cache=True, nogil=True)
def _near_rays(origins, directions, reach, center, radius):  # type: ignore[no-untyped-def]
    rows = np.empty(len(origins), np.int64)
    n = 0
    r2 = radius * radius
    for i in range(len(origins)):
        x, y, z = center[0] - origins[i, 0], center[1] - origins[i, 1], center[2] - origins[i, 2]
        along = x * directions[i, 0] + y * directions[i, 1] + z * directions[i, 2]
        off2 = x * x + y * y + z * z - along * along
        if off2 > r2 or along < -radius:
            continue
        if along - np.sqrt(r2 - off2) > reach[i]:
            continue
        rows[n] = i
        n += 1
    return rows[:n].copy()


@numba.njit(cache=True, nogil=True)
def _into_body(origins, directions, phase, rows, start, end, local_origins, local_directions):  # type: ignore[no-untyped-def]
    for j in range(len(rows)):
        i = rows[j]
        u = phase[i] + 0.5
        yaw = start[3] + u * (end[3] - start[3])
        pitch = start[4] + u * (end[4] - start[4])
        roll = start[5] + u * (end[5] - start[5])
        cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
        x = origins[i, 0] - (start[0] + u * (end[0] - start[0]))
        y = origins[i, 1] - (start[1] + u * (end[1] - start[1]))
        z = origins[i, 2] - (start[2] + u * (end[2] - start[2]))
        a, b, c = directions[i, 0], directions[i, 1], directions[i, 2]
        m00, m01, m02 = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
        m10, m11, m12 = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
        m20, m21, m22 = -sp, cp * sr, cp * cr
        local_origins[j, 0] = m00 * x + m10 * y + m20 * z
        local_origins[j, 1] = m01 * x + m11 * y + m21 * z
        local_origins[j, 2] = m02 * x + m12 * y + m22 * z
        local_directions[j, 0] = m00 * a + m10 * b + m20 * c
        local_directions[j, 1] = m01 * a + m11 * b + m21 * c
        local_directions[j, 2] = m02 * a + m12 * b + m22 * c
