import numpy as np
import pytest

from automos.core.normal_equations import NARROW, NormalEquations


def chain_of(n: int, far: int, n_fixed: int, seed: int = 0) -> tuple[NormalEquations, np.ndarray, np.ndarray]:
    """Return equations of `n` poses, each joined to the one `far` before it, and the same as dense H (6n, 6n) and g."""
    rng = np.random.default_rng(seed)
    first, second = np.arange(n - far), np.arange(far, n)
    J = rng.normal(size=(2, n - far, 6, 6))
    information = rng.uniform(0.5, 2.0, (n - far, 6))
    gradient = rng.normal(size=(n - far, 6))
    equations = NormalEquations(n, n_fixed, held=0.1)
    equations.add([(first, J[0]), (second, J[1])], information, gradient)
    H, g = 0.1 * np.eye(6 * n), np.zeros(6 * n)
    for k in range(n - far):
        row = np.zeros((6, 6 * n))
        row[:, 6 * first[k] :][:, :6], row[:, 6 * second[k] :][:, :6] = J[0, k], J[1, k]
        H += row.T @ np.diag(information[k]) @ row
        g -= row.T @ gradient[k]
    return equations, H, g


@pytest.mark.parametrize("n_fixed", [0, 1, 4])
@pytest.mark.parametrize("far", [1, 3, NARROW + 1])
def test_free_poses_solve_the_dense_equations_and_fixed_ones_stay(n_fixed, far):
    equations, H, g = chain_of(far + 9, far, n_fixed)
    free = slice(6 * n_fixed, None)
    found = equations.solve()
    np.testing.assert_allclose(found[n_fixed:].ravel(), np.linalg.solve(H[free, free], g[free]), rtol=1e-8, atol=1e-10)
    assert not found[:n_fixed].any()


def test_where_all_poses_are_fixed_none_moves():
    assert not NormalEquations(1, 1, held=0.1).solve().any()
