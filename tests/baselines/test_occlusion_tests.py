"""M-detector's depth images, tests and clusters, on cases computed by hand."""

import numpy as np
import pytest

from automos.baselines.depth_images import Window, agrees, direction_of, draw, is_even, stack, surface_at
from automos.baselines.m_detector import KITTI, complete_clusters, find_events
from automos.baselines.range_image import image_shape
from automos.core.scan import Frame

SHAPE = image_shape(float(np.degrees(KITTI.row)), float(np.degrees(KITTI.column)), -30.0, 30.0)
HERE = np.eye(4)


def screen(r: float, half_width: float = 0.1, half_height: float = 0.06) -> np.ndarray:
    """Return points at range `r` in a patch of directions (rad) ahead, as close as rays of a HDL-64E."""
    azimuth, elevation = np.meshgrid(
        np.arange(-half_width, half_width, 0.0035), np.arange(-half_height, half_height, 0.007)
    )
    flat = r * np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    return flat.reshape(3, -1).T.astype(np.float32)


def image(points, stamp=0.0, moving=False):
    return draw(points, np.full(len(points), moving), HERE, stamp, SHAPE)


def events(points, past):
    """Return which of `points`, seen now, are events against the scans `past`, each 0.1 s older than the one before."""
    images = [image(was, -0.1 * i) for i, was in enumerate(past, start=1)]
    frame = Frame(points, np.arange(len(points)), len(points), HERE, 0.0)
    return find_events(frame, 0.0, images, KITTI, SHAPE)


def test_what_lies_around_a_direction_is_found_across_the_seam():
    behind = np.array([[-10.0, 0.001, 0.0], [-10.0, -0.001, 0.0]], np.float32)
    drawn = image(behind[:1])
    azimuth, elevation, r = direction_of(*behind[1])
    assert agrees(drawn.start, drawn.rays, azimuth, elevation, r, Window(0.01, 0.01), 0.15, SHAPE)
    assert not agrees(drawn.start, drawn.rays, azimuth, elevation, r + 0.2, Window(0.01, 0.01), 0.15, SHAPE)


def test_what_was_found_to_move_does_not_stand():
    points = screen(10.0)
    drawn = image(points, moving=True)
    assert not agrees(drawn.start, drawn.rays, 0.0, 0.0, 10.0, Window(0.01, 0.01), 0.15, SHAPE)


def test_a_slanted_surface_is_not_even():
    slanted = screen(10.0)
    slanted[:, 0] += 3.0 * slanted[:, 2]
    for points, even in ((screen(10.0), True), (slanted, False)):
        now = stack([image(points)])
        assert is_even(now.start[0], now.rays, 0.0, 0.0, 10.0, Window(0.01, 0.01), 0.05, 0.5, SHAPE) == even


def test_case_1_what_hides_the_wall_of_two_images_is_an_event_and_of_one_is_none():
    wall, mover = screen(20.0), screen(10.0, 0.03, 0.03)
    assert events(mover, [wall, wall, wall]).all()
    assert not events(mover, [wall]).any()
    assert not events(wall, [wall, wall, wall]).any()


def test_case_1_an_image_in_which_it_stood_there_says_nothing():
    wall, car = screen(20.0), screen(10.0, 0.03, 0.03)
    stood = np.concatenate([wall, car])
    assert events(car, [stood, wall, wall, stood]).all()  # two images were hidden
    assert not events(car, [stood, wall, stood, stood]).any()


def test_case_1_who_walks_along_the_ray_is_an_event_though_he_lay_there_a_scan_ago():
    wall = screen(20.0)
    past = [
        np.concatenate([wall, screen(10.0 + 0.1 * k, 0.02, 0.05)]) for k in range(1, 5)
    ]  # 1 m/s, towards the sensor
    assert events(screen(10.0, 0.02, 0.05), past).mean() > 0.9  # at his rim a surface leads from him to the wall
    assert not events(screen(10.0, 0.02, 0.05), past[:1]).any()  # within 0.15 m of where he stood


def test_case_1_what_lies_little_before_a_surface_that_ran_on_through_there_is_none():
    wall = [screen(20.0)] * 3
    assert not events(screen(18.7, 0.03, 0.03), wall).any()  # 0.5 m, and 0.1 more for each metre beyond 10
    assert events(screen(18.3, 0.03, 0.03), wall).all()


@pytest.mark.parametrize("speed", [8.0, -8.0])
def test_cases_2_and_3_what_goes_along_the_ray_is_an_event(speed):
    seen = [screen(15.0 - 0.1 * i * speed) for i in range(4)]
    middle = events(seen[0], seen[1:])[np.abs(seen[0][:, 1:]).max(axis=1) < 0.5]
    assert middle.all()


def test_cases_2_and_3_what_leaps_once_is_none():
    assert not events(screen(15.8), [screen(15.0)] * 4).any()  # not hidden twice
    assert not events(screen(15.8), [screen(15.0), screen(11.0), screen(11.0)]).any()  # not about as fast


def test_the_surface_through_what_stands_is_a_plane_and_needs_three_points():
    slanted = screen(10.0)
    slanted *= (1.0 + 0.2 * slanted[:, 1:2] / 10.0).astype(np.float32)  # 2 m further per radian to the left
    drawn = image(slanted)
    around = Window(0.015, 0.007)
    found = surface_at(drawn.start, drawn.rays, 0.05, 0.0, 10.0, around, 5.0, SHAPE)
    assert found == pytest.approx(10.0 * (1.0 + 0.2 * np.sin(0.05)), abs=0.01)
    assert surface_at(drawn.start, drawn.rays, 0.05, 0.0, 20.0, around, 5.0, SHAPE) == np.inf  # too far behind
    few = image(slanted[:2])
    azimuth, elevation, r = direction_of(*slanted[0])
    assert surface_at(few.start, few.rays, azimuth, elevation, r, around, 5.0, SHAPE) == np.inf
    moving = image(slanted, moving=True)
    assert surface_at(moving.start, moving.rays, 0.05, 0.0, 10.0, around, 5.0, SHAPE) == np.inf


def test_clusters_are_completed_and_scattered_events_dropped():
    step = np.arange(0.0, 1.5, 0.1)
    car = np.stack(np.meshgrid(step, step, [0.5, 0.8]), -1).reshape(-1, 3).astype(np.float32)
    bush = car + np.float32([10.0, 0.0, 0.0])
    points = np.concatenate([car, bush])
    is_event = np.zeros(len(points), bool)
    is_event[: len(car)] = np.random.default_rng(0).random(len(car)) < 0.5
    is_event[len(car) :: 40] = True  # every fortieth of the bush
    found = complete_clusters(points, is_event, np.ones(len(points), bool), KITTI)
    assert found[: len(car)].mean() > 0.9
    assert not found[len(car) :].any()
