"""The least-squares step of a pose graph: factors between poses, solved for small motions of all poses at once."""

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array

NARROW = 100
"""Greatest distance, in poses, between those that a factor joins for which a banded solver is fastest."""


class NormalEquations:
    """The normal equations of N small motions (6), accumulated factor by factor."""

    def __init__(self, n: int, n_fixed: int, held: float = 0.0):
        """Take the number of poses, how many of them, the first, stay, and what holds each of the others in place.

        held : prior information.
        """
        self._n_fixed = n_fixed
        self._rhs = np.zeros((n, 6))
        self._rows = [np.arange(n)]
        self._columns = [np.arange(n)]
        self._blocks = [np.tile(held * np.eye(6), (n, 1, 1))]

    def add(self, parts: list[tuple[npt.NDArray[np.int64], Array]], information: Array, gradient: Array) -> None:
        """Add K factors, each a residual of six dimensions.

        Parameters
        ----------
        parts : list of (ids, J) for each pose that a factor joins: (K,) its row and (K, 6, 6) the Jacobian.
        information : (K, 6, 6) or, for independent dimensions, (K, 6) inverse variances of the residuals.
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
        """Return the (N, 6) motions that minimise the squared residuals of all factors; zeros for fixed poses."""
        from scipy.linalg import solveh_banded
        from scipy.sparse import coo_matrix
        from scipy.sparse.linalg import spsolve

        rows, columns, blocks = (np.concatenate(part) for part in (self._rows, self._columns, self._blocks))
        is_free = np.minimum(rows, columns) >= self._n_fixed
        rows, columns, blocks = rows[is_free] - self._n_fixed, columns[is_free] - self._n_fixed, blocks[is_free]
        steps, rhs = np.zeros_like(self._rhs), self._rhs[self._n_fixed :].ravel()
        if len(rhs) == 0:
            return steps
        is_upper = rows < columns
        blocks = np.where(is_upper[:, None, None], np.swapaxes(blocks, 1, 2), blocks)
        rows, columns = np.maximum(rows, columns), np.minimum(rows, columns)
        i = 6 * rows[:, None, None] + np.arange(6)[:, None]
        j = 6 * columns[:, None, None] + np.arange(6)
        n, width, is_lower = len(rhs), int((rows - columns).max(initial=0)) + 1, i >= j
        i, j = np.broadcast_arrays(i, j)
        i, j, values = i[is_lower], j[is_lower], blocks[is_lower]
        if width <= NARROW:
            bands = np.bincount((i - j) * n + j, values, 6 * width * n).reshape(-1, n)
            free = solveh_banded(bands, rhs, lower=True, overwrite_ab=True)
        else:
            lower = coo_matrix((values, (i, j)), (n, n)).tocsc()
            full = lower + lower.T
            full.setdiag(lower.diagonal())
            free = spsolve(full, rhs)
        steps[self._n_fixed :] = free.reshape(-1, 6)
        return steps
