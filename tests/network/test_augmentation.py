import numpy as np
import pytest

from automos.geometry import make_transform, transform
from automos.network.augmentation import Change, apply_change, draw_change
from automos.network.images import SensorView, Window, make_image
from automos.network.projection import even_grid

VIEW = SensorView(even_grid(16, 64, 10, -10), 1.0)


def window() -> Window:
    """Return a wall and a moving thing, seen three times from a sensor that moves."""
    rng = np.random.default_rng(0)
    azimuth = (np.arange(64) + 0.5) / 64 * 2 * np.pi - np.pi  # the middle of every column
    wall = np.stack([12 * np.cos(azimuth), 12 * np.sin(azimuth), rng.uniform(-1, 1, 64)], axis=1).astype(np.float32)
    thing = np.array([[5.0, 0.3, 0.0]], np.float32)
    T_now_past = np.stack([make_transform(t=[-0.3, 0.0, 0.0]), make_transform(t=[-0.6, 0.1, 0.0])])
    past = tuple(np.concatenate([wall, thing + np.float32(k)]) for k in (1, 2))
    now = np.concatenate([wall, thing])
    return Window(now, np.ones(len(now), np.float32), past, T_now_past)


def change(T: np.ndarray, dropped: float = 0.0, keeps_intensity: bool = True) -> Change:
    return Change(T, dropped, keeps_intensity)


def test_a_turn_by_whole_columns_rolls_the_image_and_its_residuals():
    angle = 2 * np.pi * 5 / 64
    T = make_transform([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    before = make_image(window(), VIEW).channels
    after = make_image(apply_change(window(), change(T), np.random.default_rng(0))[0], VIEW).channels
    for channel in (0, 4, 5, 6):  # range, intensity, residuals; counter-clockwise is to the left
        assert np.allclose(after[channel], np.roll(before[channel], -5, axis=1), atol=1e-4)


def test_a_mirror_turns_the_image_and_its_residuals_round():
    before = make_image(window(), VIEW).channels
    mirrored = apply_change(window(), change(np.diag([1.0, -1.0, 1.0, 1.0])), np.random.default_rng(0))[0]
    after = make_image(mirrored, VIEW).channels
    for channel in (0, 5, 6):
        assert np.allclose(after[channel], before[channel][:, ::-1], atol=1e-4)


def test_points_and_poses_change_together():
    T = make_transform([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [1.0, 2.0, 0.5])
    before = window()
    after, _ = apply_change(before, change(T), np.random.default_rng(0))
    for k in range(2):  # carried into the present first or changed first: the same place
        one = transform(T, transform(before.T_now_past[k], before.past[k]))
        other = transform(after.T_now_past[k], after.past[k])
        assert np.allclose(one, other, atol=1e-5)


def test_dropping_points_tells_which_stayed():
    before = window()
    after, rows = apply_change(before, change(np.eye(4), dropped=0.5), np.random.default_rng(1))
    assert 10 < len(after.points) < 55
    assert np.array_equal(after.points, before.points[rows])
    assert all(len(points) < 60 for points in after.past)


def test_intensities_may_be_left_out():
    after, _ = apply_change(window(), change(np.eye(4), keeps_intensity=False), np.random.default_rng(0))
    assert after.intensity is None
    assert not make_image(after, VIEW).channels[4].any()


@pytest.mark.parametrize("seed", [0, 1])
def test_equal_generators_draw_equal_changes(seed):
    one, other = (draw_change(np.random.default_rng(seed), 512) for _ in range(2))
    assert np.array_equal(one.T, other.T)
    assert one.dropped == other.dropped
    assert np.allclose(one.T[:3, :3] @ one.T[:3, :3].T, np.eye(3))
