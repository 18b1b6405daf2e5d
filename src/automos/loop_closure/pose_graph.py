"""Poses that suit a path driven and the revisits along it, of which some may be wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.geometry import adjoint, inverse, se3_exp, se3_log
from automos.odometry.normal_equations import FIXED, NormalEquations
from automos.scan import Pose

Array = npt.NDArray[np.float64]
Ids = npt.NDArray[np.int64]

OUTLIER = 16.8
"""Squared deviations in six dimensions that one of a hundred right links exceeds."""
RELAX = 1.4
"""Factor by which each round judges more sharply (the authors' value)."""


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
