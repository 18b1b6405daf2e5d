"""R-GPF on bins of a few points: planes, seeds and distances by hand."""

import numpy as np
import pytest

from automos.baselines.erasor_bins import fit_region_ground

R_GPF = {"seed_height": 0.5, "n_skipped": 5, "n_lowest": 20, "n_iterations": 3, "distance": 0.25}


def ground(n: int = 8) -> np.ndarray:
    """Return n x n points half a metre apart on z = 0 from x = 8 m on."""
    x, y = np.meshgrid(8.0 + 0.5 * np.arange(n), 0.5 * (np.arange(n) - n // 2))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])


def post() -> np.ndarray:
    """Return the points of a post from 0.3 to 1.5 m."""
    z = np.arange(0.3, 1.6, 0.2)
    return np.column_stack([np.full(len(z), 9.65), np.full(len(z), 0.15), z])


@pytest.mark.parametrize("slope", [0.0, 0.1, -0.2])
@pytest.mark.parametrize("heading", [0.0, 1.0, 2.5])
def test_a_tilted_plane_and_what_lies_under_it_is_ground_and_a_post_is_not(slope, heading):
    tilt = slope * np.array([np.cos(heading), np.sin(heading)])
    # slopes of a bin 4 m across: 0.8 m of height, more than the seeds' 0.5 m, so the fit must grow
    flat, high, low = ground(), post(), ground(2) - [0.0, 0.0, 0.3]
    points = np.concatenate([flat, high, low])
    points[:, 2] += (points[:, :2] - [9.8, 0.0]) @ tilt
    expected = np.r_[np.ones(len(flat), bool), np.zeros(len(high), bool), np.ones(len(low), bool)]
    is_ground = fit_region_ground(points, **R_GPF | {"n_skipped": 4, "n_iterations": 6})
    np.testing.assert_array_equal(is_ground, expected)


def test_the_plane_starts_above_the_very_lowest_points():
    # a mirror image 1 m below: with it the start would be there and nothing else a seed
    points = np.concatenate([ground(), [[9.0, 0.0, -1.0]]])
    assert fit_region_ground(points, **R_GPF | {"n_skipped": 1}).all()
    assert not fit_region_ground(points, **R_GPF | {"n_skipped": 0, "n_lowest": 1})[:64].any()


def test_the_first_seeds_are_those_less_than_the_seed_height_above_the_lowest():
    # two points: too few for a plane, so the seeds are the answer; the start is the mean of both, 0.4
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.8]])
    np.testing.assert_array_equal(fit_region_ground(points, **R_GPF | {"n_skipped": 0}), [True, True])
    np.testing.assert_array_equal(
        fit_region_ground(points, **R_GPF | {"n_skipped": 0, "seed_height": 0.3}), [True, False]
    )
    # the lowest skipped, the start is 0.8
    np.testing.assert_array_equal(fit_region_ground(points, **R_GPF | {"seed_height": 0.1}), [True, True])


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_a_bin_of_few_or_equal_points_is_ground(n):
    assert fit_region_ground(np.full((n, 3), 1.0), **R_GPF).all()


def test_the_distance_is_measured_at_right_angles_to_the_plane():
    # on a slope of 1 a point 0.3 m above the plane is 0.21 m away from it
    flat = ground()
    flat[:, 2] += flat[:, 0]
    above = flat[27:28] + np.array([0.0, 0.0, 0.3])
    is_ground = fit_region_ground(np.concatenate([flat, above]), **R_GPF | {"seed_height": 9.0})
    assert is_ground.all()
    is_ground = fit_region_ground(
        np.concatenate([flat, above + np.array([0.0, 0.0, 0.1])]), **R_GPF | {"seed_height": 9.0}
    )
    np.testing.assert_array_equal(is_ground, [*[True] * 64, False])
