import numpy as np
import pytest
from grids import even_grid

from automos.core.geometry import inverse, make_transform, transform
from automos.network.images import pick_past, residual_images
from automos.network.projection import nearest_points, project

GRID = even_grid(16, 64, 10, -10)


def ranges_of(points: np.ndarray) -> np.ndarray:
    pixels, ranges = project(points, GRID)
    index = nearest_points(pixels, ranges, GRID.size)
    return np.where(index >= 0, ranges[index], 0.0).reshape(16, 64).astype(np.float32)


def seen(now: np.ndarray, before: np.ndarray) -> float:
    """Return the residual of a point at `now` metres where one ray hit something at `before` metres."""
    one, other = (np.array([[r, 0.01 * r, 0.01 * r]], np.float32) for r in (now, before))
    image = residual_images(ranges_of(one), [other], np.eye(4)[None], GRID)
    assert image.shape == (1, 16, 64)
    assert np.count_nonzero(image) <= 1
    return float(image[np.unravel_index(np.abs(image).argmax(), image.shape)])


def test_a_residual_says_whether_the_place_was_taken_free_or_hidden():
    tolerance = 0.3 + 0.02 * 10.0
    assert seen(10.0, 10.0) == pytest.approx(-1.0, abs=1e-4)  # something was here
    assert seen(10.0, 10.0 + 3 * tolerance) == pytest.approx(0.5, abs=1e-3)  # the ray went on: (3 - 1) / (3 + 1)
    assert seen(10.0, 40.0) > 0.95
    assert seen(10.0, 10.0 - 0.5 * tolerance) == pytest.approx(-0.5, abs=1e-3)
    assert seen(10.0, 6.0) == 0.0  # hidden behind something: nobody knows


def test_seen_through_is_only_what_all_rays_around_went_past():
    azimuth = np.arange(-1.5, 2.0) * 2 * np.pi / 64  # four columns beside each other

    def rays(ranges: list[float]) -> np.ndarray:
        return np.stack([ranges * np.cos(azimuth), ranges * np.sin(azimuth), 0.02 * np.array(ranges)], 1).astype("f4")

    now = ranges_of(rays([10.0] * 4))
    leaf = residual_images(now, [rays([30.0, 10.0, 30.0, 30.0])], np.eye(4)[None], GRID)[0]
    row, columns = np.nonzero(now)
    # columns go clockwise: the leaf, second from the right, holds for itself and the two beside it
    assert leaf[row, columns][::-1] == pytest.approx([-1.0, -1.0, -1.0, 0.95], abs=0.06)


def test_what_stands_still_was_there_before_however_the_sensor_moves():
    rng = np.random.default_rng(0)
    T_world_now = make_transform(t=[1.0, 0.5, 0.0])

    def wall() -> np.ndarray:
        points = [np.full(40000, 15.0), rng.uniform(-12, 12, 40000), rng.uniform(-2, 2, 40000)]
        return np.stack(points, axis=1).astype(np.float32)

    before, now = wall(), transform(inverse(T_world_now), wall())
    image = residual_images(ranges_of(now), [before], inverse(T_world_now)[None], GRID)
    assert np.median(image[image != 0]) < -0.9
    moved = residual_images(ranges_of(now), [before], np.eye(4)[None], GRID)
    assert np.median(moved[moved != 0]) > -0.6  # the motion of the sensor, not taken out


@pytest.mark.parametrize(("r_now", "r_before"), [(1.5, 10.0), (10.0, 1.5), (85.0, 10.0), (10.0, 85.0)])
def test_ranges_beyond_the_limits_leave_no_residual(r_now, r_before):
    now, before = (np.array([[r, 0.0, 0.0]], np.float32) for r in (r_now, r_before))
    assert not residual_images(ranges_of(now), [before], np.eye(4)[None], GRID).any()


def test_a_scan_that_is_missing_leaves_no_residual():
    now = ranges_of(np.array([[10.0, 0.0, 0.0]], np.float32))
    assert not residual_images(now, [None, None], np.stack([np.eye(4)] * 2), GRID).any()


def test_what_lies_beyond_the_beams_is_not_pressed_into_the_border_rows():
    now = ranges_of(np.array([[10.0, 0.0, 1.7]], np.float32))  # just inside the top row
    above = np.array([[6.0, 0.0, 4.0]], np.float32)
    assert not residual_images(now, [above], np.eye(4)[None], GRID).any()


@pytest.mark.parametrize(
    ("ages", "chosen"),
    [
        ([0.1, 0.2, 0.3, 0.4], [0, 1, 2]),  # ten scans a second
        ([0.05, 0.1, 0.15, 0.2, 0.25, 0.3], [1, 3, 5]),  # twenty
        ([0.2, 0.4], [0, 0, 1]),  # five
        ([0.1], [0, 0, -1]),  # the second scan of all
        ([], [-1, -1, -1]),
        ([3.0, 3.1], [-1, -1, -1]),  # after a pause
    ],
)
def test_residuals_look_back_in_seconds_whatever_the_rate(ages, chosen):
    assert pick_past(np.array(ages), 3, 0.1).tolist() == chosen
