import numpy as np
import pytest
from grids import even_grid

from automos.core.geometry import make_transform, transform
from automos.network.augmentation import Change, apply_change, draw_change
from automos.network.images import Window, make_image
from automos.network.projection import project

GRID = even_grid(16, 64, 10, -10)


def window() -> Window:
    """Return a wall and a moving thing, seen three times from a sensor that moves."""
    rng = np.random.default_rng(0)
    azimuth = (np.arange(64) + 0.5) / 64 * 2 * np.pi - np.pi  # the middle of every column
    wall = np.stack([12 * np.cos(azimuth), 12 * np.sin(azimuth), rng.uniform(-1, 1, 64)], axis=1).astype(np.float32)
    thing = np.array([[5.0, 0.3, 0.0]], np.float32)
    T_now_past = np.stack([make_transform(t=[-0.3, 0.0, 0.0]), make_transform(t=[-0.6, 0.1, 0.0])])
    past = tuple(np.concatenate([wall, thing + np.float32(k)]) for k in (1, 2))
    now = np.concatenate([wall, thing])
    return Window(now, past, T_now_past)


def test_a_turn_by_whole_columns_rolls_the_image_and_its_residuals():
    angle = 2 * np.pi * 5 / 64
    T = make_transform([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    before = make_image(window(), GRID).channels
    after = make_image(apply_change(window(), Change(T), GRID, np.random.default_rng(0))[0], GRID).channels
    assert np.allclose(after, np.roll(before, -5, axis=2), atol=1e-4)  # counter-clockwise is to the left


def test_a_mirror_turns_the_image_and_its_residuals_round():
    before = make_image(window(), GRID).channels
    mirrored = apply_change(window(), Change(np.diag([1.0, -1.0, 1.0, 1.0])), GRID, np.random.default_rng(0))[0]
    after = make_image(mirrored, GRID).channels
    assert np.allclose(after, before[:, :, ::-1], atol=1e-4)


def test_points_and_poses_change_together():
    T = make_transform([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [1.0, 2.0, 0.5])
    before = window()
    after, _ = apply_change(before, Change(T), GRID, np.random.default_rng(0))
    for k in range(2):  # carried into the present first or changed first: the same place
        one = transform(T, transform(before.T_now_past[k], before.past[k]))
        other = transform(after.T_now_past[k], after.past[k])
        assert np.allclose(one, other, atol=1e-5)


def test_dropping_points_tells_which_stayed():
    before = window()
    after, rows = apply_change(before, Change(np.eye(4), dropped=0.5), GRID, np.random.default_rng(1))
    assert 10 < len(after.points) < 55
    assert np.array_equal(after.points, before.points[rows])
    assert all(len(points) < 60 for points in after.past)


def test_blind_pixels_have_no_points_now_or_before():
    is_blind = np.zeros((16, 64), bool)
    is_blind[:, 10:30] = True
    before = window()
    worse = Change(np.eye(4), is_blind=is_blind)
    after, rows = apply_change(before, worse, GRID, np.random.default_rng(0))
    assert np.array_equal(after.points, before.points[rows])
    for points, original in zip((after.points, *after.past), (before.points, *before.past), strict=True):
        columns = project(points, GRID)[0] % 64
        assert not ((columns >= 10) & (columns < 30)).any()
        assert len(points) == len(original) - (is_blind.reshape(-1)[project(original, GRID)[0]]).sum()


def test_a_worse_sensor_errs_along_its_rays_only():
    before = window()
    worse = Change(np.eye(4), noise=0.05, specks=0.2)
    after, _ = apply_change(before, worse, GRID, np.random.default_rng(0))
    was, now = (np.linalg.norm(points, axis=1) for points in (before.points, after.points))
    assert np.allclose(after.points / now[:, None], before.points / was[:, None], atol=1e-5)
    is_speck = np.abs(now - was) > 0.5
    assert 0.05 < is_speck.mean() < 0.4
    assert (now[is_speck] < was[is_speck]).all()
    assert 0.02 < (now - was)[~is_speck].std() < 0.1


def test_odometry_that_errs_errs_more_the_longer_ago():
    far = [np.abs(swayed(seed) - window().T_now_past)[:, :3, 3].max(axis=1) for seed in range(40)]
    near, old = np.mean(far, axis=0)
    assert 0.0 < near < old < 0.2


def swayed(seed: int) -> np.ndarray:
    change = Change(np.eye(4), sway=0.02)
    return apply_change(window(), change, GRID, np.random.default_rng(seed))[0].T_now_past


@pytest.mark.parametrize("seed", [0, 1])
def test_equal_generators_draw_equal_changes(seed):
    one, other = (draw_change(np.random.default_rng(seed), 64, 512) for _ in range(2))
    assert np.array_equal(one.T, other.T)
    assert one.dropped == other.dropped
    assert np.allclose(one.T[:3, :3] @ one.T[:3, :3].T, np.eye(3))
