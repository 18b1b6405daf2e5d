import numpy as np
import pytest

from automos.core.covariances import across, eigenvalues, eigenvector, variance_along

RNG = np.random.default_rng(0)


def packed(C):
    return np.array([C[0, 0], C[0, 1], C[0, 2], C[1, 1], C[1, 2], C[2, 2]])


def covariance(deviations):
    """Return a matrix with these deviations along directions that are turned at random."""
    Q, _ = np.linalg.qr(RNG.normal(size=(3, 3)))
    return Q @ np.diag(np.square(deviations)) @ Q.T


@pytest.mark.parametrize("deviations", [(0.02, 0.3, 0.4), (0.01, 0.01, 0.5), (0.2, 0.2, 0.2), (0.0, 0.0, 0.3)])
def test_eigenvalues_are_those_of_linear_algebra(deviations):
    C = covariance(deviations)
    np.testing.assert_allclose(eigenvalues(packed(C)), np.linalg.eigvalsh(C), atol=1e-8)


def test_an_eigenvalue_that_is_apart_has_its_direction():
    C, found = covariance((0.02, 0.3, 0.4)), np.empty(3)
    value, vectors = np.linalg.eigh(C)
    eigenvector(packed(C), value[0], found)
    assert abs(found @ vectors[:, 0]) == pytest.approx(1.0, abs=1e-9)


def test_nothing_has_no_extent():
    assert eigenvalues(np.zeros(6)) == (0.0, 0.0, 0.0)


def test_an_edge_is_measured_along_both_directions_across_it():
    C, first, second = covariance((0.02, 0.05, 0.6)), np.empty(3), np.empty(3)
    value, vectors = np.linalg.eigh(C)
    variances = across(packed(C), np.ascontiguousarray(vectors[:, 2]), first, second)
    np.testing.assert_allclose(variances, value[:2], atol=1e-9)
    assert abs(first @ vectors[:, 0]) == pytest.approx(1.0, abs=1e-6)
    assert abs(second @ vectors[:, 1]) == pytest.approx(1.0, abs=1e-6)


def test_the_variance_along_a_direction_is_the_quadratic_form():
    C, a = covariance((0.1, 0.2, 0.3)), np.array([0.6, 0.0, 0.8])
    assert variance_along(packed(C), a) == pytest.approx(a @ C @ a)
