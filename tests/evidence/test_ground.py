import numpy as np
import pytest

from automos.evidence.ground import find_ground
from automos.settings import GroundSettings

S = GroundSettings()
ORIGIN = np.array([0.0, 0.0, 1.8])


def rings(height_of=lambda x, y: 0.0 * x, start=3.0, noise=0.01, seed=0):
    """Ground points as a spinning sensor meets them: rings that lie further apart further away."""
    rng = np.random.default_rng(seed)
    radius = start / (1.0 - np.linspace(0.0, 1.0 - start / 60.0, 50))
    azimuth = np.radians(np.arange(0.0, 360.0, 0.5))
    r, a = (grid.ravel() for grid in np.meshgrid(radius, azimuth))
    x, y = r * np.cos(a), r * np.sin(a)
    return np.stack([x, y, height_of(x, y) + rng.normal(0.0, noise, len(x))], axis=1).astype(np.float32)


def block(x, y, low, high, half=0.4):
    """The points of an upright box around (x, y), from `low` to `high`."""
    u = np.linspace(-half, half, 9)
    a, b, z = (grid.ravel() for grid in np.meshgrid(u, u, np.linspace(low, high, 8)))
    return np.stack([x + a, y + b, z], axis=1).astype(np.float32)


def test_flat_ground_is_ground_and_what_stands_on_it_is_not():
    ground, things = rings(), np.concatenate([block(8, 3, 0.2, 1.5), block(-20, 5, 0.25, 2.0)])
    found = find_ground(np.concatenate([ground, things]), ORIGIN, S)[0]
    assert found[: len(ground)].mean() > 0.99
    assert not found[len(ground) :].any()


@pytest.mark.parametrize(("rise", "height"), [(0.15, 0.0), (-0.12, 0.0), (0.0, 250.0)])
def test_slopes_and_absolute_heights_do_not_matter(rise, height):
    ground = rings(lambda x, y: rise * x + height)
    at = height + rise * 10.0
    thing = block(10, 0, at + 0.3, at + 1.6, half=0.3)
    found = find_ground(np.concatenate([ground, thing]), ORIGIN + np.array([0.0, 0.0, height]), S)[0]
    assert found[: len(ground)].mean() > 0.98
    assert not found[len(ground) :].any()


@pytest.mark.parametrize("rise", [0.0, 0.12, 0.28])
@pytest.mark.parametrize("towards_deg", [0.0, 70.0, 200.0])
def test_with_few_beams_a_hill_is_ground_from_the_first_ring_on(rise, towards_deg):
    cos, sin = np.cos(np.radians(towards_deg)), np.sin(np.radians(towards_deg))
    ground = rings(lambda x, y: rise * (cos * x + sin * y), start=7.0)  # eight metres on it is a step of two
    far = np.hypot(ground[:, 0], ground[:, 1])
    ground = ground[np.isin(far.round(3), np.unique(far.round(3))[::7])]
    cars = [
        block(x, y, h + 0.25, h + 1.5, half=1.0) for x, y in ((6, 4), (-9, 3)) for h in [rise * (cos * x + sin * y)]
    ]
    found = find_ground(np.concatenate([ground, *cars]), ORIGIN, S)[0]
    assert found[: len(ground)].mean() > 0.97
    assert found[len(ground) :].mean() < 0.05


def test_a_pavement_behind_a_kerb_is_ground():
    ground = rings(lambda x, y: np.where(y > 4.0, 0.12, 0.0))
    assert find_ground(ground, ORIGIN, S)[0].mean() > 0.97


def test_an_overhang_is_not_ground_though_no_ground_is_seen_beneath_it():
    ground = rings()
    beneath = np.hypot(ground[:, 0] - 12, ground[:, 1]) < 4.0
    roof = block(12, 0, 2.6, 2.8, half=3.0)
    found = find_ground(np.concatenate([ground[~beneath], roof]), ORIGIN, S)[0]
    assert not found[-len(roof) :].any()


def test_mirror_images_under_the_road_do_not_pull_the_ground_down():
    ground = rings()
    ghosts = block(9, 1, -4.0, -3.0)
    alone, haunted = find_ground(ground, ORIGIN, S)[0], find_ground(np.concatenate([ground, ghosts]), ORIGIN, S)[0]
    np.testing.assert_array_equal(haunted[: len(ground)], alone)


def test_heights_are_measured_from_the_ground_under_each_point():
    slope, posts = rings(lambda x, y: 0.1 * x), np.array([[10.0, 0.0, 3.0], [-15.0, 4.0, 0.5]], np.float32)
    _, height = find_ground(np.concatenate([slope, posts]), ORIGIN, S)
    np.testing.assert_allclose(height[-2:], [2.0, 2.0], atol=0.06)


def test_no_points_no_ground():
    assert find_ground(np.zeros((0, 3), np.float32), ORIGIN, S)[0].shape == (0,)
