"""Least squares over poses: what refinement and loop closure solve, each with factors of its own.

Gauss-Newton on SE(3): the unknowns are small motions of all poses, each in its own frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.geometry import adjoint, inverse, se3_exp, se3_log
from automos.scan import Pose

Array = npt.NDArray[np.float64]
Ids = npt.NDArray[np.int64]

OUTLIER = 16.8
"""Squared deviations in six dimensions that one of a hundred right links exceeds."""
RELAX = 1.4
"""Factor by which each round judges more sharply (the authors' value)."""
FIXED = 1e12
"""Information that keeps a pose where it is, to the micrometre."""
NARROW = 100
"""Poses between those that a factor joins, at most, for which a banded solver is the fastest."""


class NormalEquations:
    """The normal equations of N small motions (6), added up factor by factor."""

    def __init__(self, held: npt.ArrayLike):
        """Take (N,) information by which each pose is held where it is."""
        held = np.asarray(held, np.float64)
        self._rhs = np.zeros((len(held), 6))
        self._rows, self._columns = [np.arange(len(held))], [np.arange(len(held))]
        self._blocks = [held[:, None, None] * np.eye(6)]

    def add(self, parts: list[tuple[Ids, Array]], information: Array, gradient: Array) -> None:
        """Add K factors, each a residual of six dimensions.

        Parameters
        ----------
        parts : of each pose that a factor joins, (K,) its number and (K, 6, 6) the residual's derivative by its motion.
        information : (K, 6, 6) or, of independent dimensions, (K, 6) inverse variances of the residuals.
        gradient : (K, 6) information times residual.
        """
        for a, (first, A) in enumerate(parts):
            At = np.swapaxes(A, 1, 2)
            np.subtract.at(self._rhs, first, np.einsum("kij,kj->ki", At, gradient))
            At_H = At @ information if information.ndim == 3 else At * information[:, None]
            for second, B in parts[: a + 1]:
                self._rows.append(first)
                self._columns.append(second)
                self._blocks.append(At_H @ B)

    def solve(self) -> Array:
        """Return the (N, 6) motions that suit all factors best."""
        from scipy.linalg import solveh_banded
        from scipy.sparse import coo_matrix
        from scipy.sparse.linalg import spsolve

        rows, columns, blocks = (np.concatenate(part) for part in (self._rows, self._columns, self._blocks))
        is_upper = rows < columns
        blocks = np.where(is_upper[:, None, None], np.swapaxes(blocks, 1, 2), blocks)
        rows, columns = np.maximum(rows, columns), np.minimum(rows, columns)
        i = 6 * rows[:, None, None] + np.arange(6)[:, None]
        j = 6 * columns[:, None, None] + np.arange(6)
        n, width, is_lower = self._rhs.size, int((rows - columns).max(initial=0)) + 1, i >= j
        i, j = np.broadcast_arrays(i, j)
        i, j, values = i[is_lower], j[is_lower], blocks[is_lower]
        if width <= NARROW:
            bands = np.bincount((i - j) * n + j, values, 6 * width * n).reshape(-1, n)
            return solveh_banded(bands, self._rhs.ravel(), lower=True, overwrite_ab=True).reshape(-1, 6)
        lower = coo_matrix((values, (i, j)), (n, n)).tocsc()
        full = lower + lower.T
        full.setdiag(lower.diagonal())
        return spsolve(full, self._rhs.ravel()).reshape(-1, 6)


@dataclass(frozen=True, eq=False)
class Edges:
    """Measured relative poses.

    Attributes
    ----------
    first, second : (E,) int64, rows of the poses they join.
    T_first_second : (E, 4, 4).
    deviation : (E, 6) usual error: metres, then radians.
    """

    first: Ids
    second: Ids
    T_first_second: Pose
    deviation: Array

    def residuals(self, T: Pose) -> Array:
        """Return (E, 6) deviations of the poses `T` (N, 4, 4) from the edges, in the second node's frame."""
        return se3_log(inverse(self.T_first_second) @ inverse(T[self.first]) @ T[self.second])

    def squared(self, T: Pose) -> Array:
        """Return (E,) squared deviations of the poses, in units of the usual ones."""
        return ((self.residuals(T) / self.deviation) ** 2).sum(axis=1)

    def add_to(self, equations: NormalEquations, T: Pose, trust: npt.ArrayLike = 1.0) -> None:
        """Add that the poses `T` suit the edges, (E,) `trust` being the share of its weight that each has."""
        information = np.reshape(trust, (-1, 1)) / self.deviation**2
        of_first = -adjoint(inverse(inverse(T[self.first]) @ T[self.second]))
        of_second = np.tile(np.eye(6), (len(self.first), 1, 1))
        parts = [(self.first, of_first), (self.second, of_second)]
        equations.add(parts, information, information * self.residuals(T))


def solve_pose_graph(T_world_node: Pose, chain: Edges, links: Edges) -> tuple[Pose, npt.NDArray[np.bool_]]:
    """Return the (N, 4, 4) poses that suit chain and links best, and which (L,) links they suit.

    Links are judged by graduated non-convexity (Yang et al., RA-L 2020): at first all are believed, then those that
    cannot be reconciled with the chain and the other links count ever less.

    Parameters
    ----------
    T_world_node : (N, 4, 4) first guess; the first pose stays.
    chain : edges believed.
    links : edges that may be wrong.
    """
    T, squared = T_world_node, links.squared(T_world_node)
    if len(squared) == 0:
        return T, np.zeros(0, bool)
    sharpness = max(2.0 * float(squared.max()) / OUTLIER, 1.0)
    while True:
        for _ in range(3):
            equations = NormalEquations(FIXED * (np.arange(len(T)) == 0))
            chain.add_to(equations, T)
            links.add_to(equations, T, (sharpness * OUTLIER / (squared + sharpness * OUTLIER)) ** 2)
            step = equations.solve()
            T = T @ se3_exp(step)
            squared = links.squared(T)
            if np.abs(step).max() < 1e-6:
                break
        if sharpness == 1.0:
            return T, squared < OUTLIER
        sharpness = max(sharpness / RELAX, 1.0)
