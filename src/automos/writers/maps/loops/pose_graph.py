"""Pose graph of odometry and revisits, robust against outliers among the revisits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.column_data import ColumnData
from automos.core.geometry import Array, adjoint, inverse, se3_exp, se3_log
from automos.core.normal_equations import NormalEquations
from automos.core.scan import Pose

Ids = npt.NDArray[np.int64]

OUTLIER = 16.8
"""Squared normalised residual in six dimensions that one of a hundred inliers exceeds."""
RELAX = 1.4
"""Factor by which the robust kernel becomes sharper per iteration (the authors' value)."""


@dataclass(frozen=True, eq=False)
class Edges(ColumnData):
    """Measured relative poses.

    Attributes
    ----------
    first, second : (E,) int64, rows of the poses they join.
    T_first_second : (E, 4, 4) float64.
    deviation : (E, 6) float64, usual error: metres, then radians.
    """

    first: Ids
    second: Ids
    T_first_second: Pose
    deviation: Array

    def residuals(self, T: Pose) -> Array:
        """Return (E, 6) residuals of the edges for poses `T` (N, 4, 4), in the second node's frame."""
        return se3_log(inverse(self.T_first_second) @ inverse(T[self.first]) @ T[self.second])

    def squared(self, T: Pose) -> Array:
        """Return (E,) squared residuals, in units of the usual deviation."""
        return ((self.residuals(T) / self.deviation) ** 2).sum(axis=1)

    def add_to(self, equations: NormalEquations, T: Pose, trust: npt.ArrayLike = 1.0) -> None:
        """Add the edges as factors at the poses `T`, their weights scaled by (E,) `trust`."""
        information = np.reshape(trust, (-1, 1)) / self.deviation**2
        of_first = -adjoint(inverse(inverse(T[self.first]) @ T[self.second]))
        of_second = np.tile(np.eye(6), (len(self.first), 1, 1))
        parts = [(self.first, of_first), (self.second, of_second)]
        equations.add(parts, information, information * self.residuals(T))


def solve_pose_graph(T_world_node: Pose, chain: Edges, links: Edges) -> tuple[Pose, npt.NDArray[np.bool_]]:
    """Return the (N, 4, 4) poses that fit chain and links best, and which (L,) links are inliers.

    Outliers are rejected by graduated non-convexity (Yang et al., RA-L 2020): at first all links count, then those that
    contradict the chain and the other links lose weight.

    Parameters
    ----------
    T_world_node : (N, 4, 4) float64, initial guess; the first pose is fixed.
    chain : Edges, without outliers.
    links : Edges, possibly outliers.
    """
    T, squared = T_world_node, links.squared(T_world_node)
    if len(squared) == 0:
        return T, np.zeros(0, bool)
    sharpness = max(2.0 * float(squared.max()) / OUTLIER, 1.0)
    while True:
        for _ in range(3):
            equations = NormalEquations(len(T), n_fixed=1)
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
