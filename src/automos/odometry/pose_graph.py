"""A chain of poses with extra links between some: all poses solved together, links that contradict the rest given up.

Gauss-Newton on SE(3), sparse. Links are judged by graduated non-convexity (Yang et al., RA-L 2020): at first all are
believed, then those that cannot be reconciled with the chain and the other links count ever less.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.geometry import adjoint, inverse, se3_exp, se3_log
from automos.scan import Pose

Array = npt.NDArray[np.float64]

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

    first: npt.NDArray[np.int64]
    second: npt.NDArray[np.int64]
    T_first_second: Pose
    deviation: Array

    def __len__(self) -> int:
        return len(self.first)


def solve_pose_graph(T_world_node: Pose, chain: Edges, links: Edges) -> tuple[Pose, npt.NDArray[np.bool_]]:
    """Return the (N, 4, 4) poses that suit chain and links best, and which (L,) links they suit.

    Parameters
    ----------
    T_world_node : (N, 4, 4) first guess; the first pose stays.
    chain : edges believed.
    links : edges that may be wrong.
    """
    T = T_world_node
    if len(links) == 0:
        return T, np.zeros(0, bool)
    edges = Edges(*(np.concatenate([getattr(e, n) for e in (chain, links)]) for n in Edges.__annotations__))
    squared = _squared(_residuals(T, edges)[len(chain) :], links)
    sharpness = max(2.0 * float(squared.max()) / OUTLIER, 1.0)
    while True:
        for _ in range(3):
            trust = (sharpness * OUTLIER / (squared + sharpness * OUTLIER)) ** 2
            step = _solve_step(T, edges, np.concatenate([np.ones(len(chain)), trust]))
            T = T @ se3_exp(step)
            squared = _squared(_residuals(T, edges)[len(chain) :], links)
            if np.abs(step).max() < 1e-6:
                break
        if sharpness == 1.0:
            return T, squared < OUTLIER
        sharpness = max(sharpness / RELAX, 1.0)


def _residuals(T: Pose, edges: Edges) -> Array:
    """Return (E, 6) deviations of the poses from the edges, in the second node's frame."""
    return se3_log(inverse(edges.T_first_second) @ inverse(T[edges.first]) @ T[edges.second])


def _squared(residuals: Array, edges: Edges) -> Array:
    return ((residuals / edges.deviation) ** 2).sum(axis=1)


def _solve_step(T: Pose, edges: Edges, trust: Array) -> Array:
    """Return the (N, 6) small motions of all nodes, in their own frames, that one Gauss-Newton step takes."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import spsolve

    n = len(T)
    scale = np.sqrt(trust)[:, None] / edges.deviation  # (E, 6)
    residual = scale * _residuals(T, edges)
    of_second = scale[:, :, None] * np.eye(6)
    of_first = -scale[:, :, None] * adjoint(inverse(inverse(T[edges.first]) @ T[edges.second]))
    row = 6 * np.arange(len(edges))[:, None, None] + np.arange(6)[:, None] + np.zeros(6, int)
    column = np.arange(6) + np.zeros((6, 1), int)
    rows = np.concatenate([row.ravel(), row.ravel()])
    columns = np.concatenate(
        [(6 * edges.first[:, None, None] + column).ravel(), (6 * edges.second[:, None, None] + column).ravel()]
    )
    J = coo_matrix((np.concatenate([of_first.ravel(), of_second.ravel()]), (rows, columns)), (6 * len(edges), 6 * n))
    J = J.tocsc()[:, 6:]  # the first pose stays
    step = spsolve((J.T @ J).tocsc(), -(J.T @ residual.ravel()))
    return np.concatenate([np.zeros(6), step]).reshape(n, 6)
