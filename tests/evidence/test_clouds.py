from functools import cache

import numpy as np
import pytest

from automos import load_settings
from automos.core.directions import raw_points
from automos.core.range_image import UNIT, locate
from automos.core.scan import GROUND, OBJECT, SPECK, Frame
from automos.evidence.clouds import MIN_POINTS, in_clouds
from automos.evidence.ground import map_ground
from automos.evidence.observations import Seen, learn_lidars, look
from automos.pipeline import Steps
from automos.simulation import Conditions, record


def cube_of(n: int, corner: tuple[float, float, float]) -> np.ndarray:
    """Return (n, 3) points in a cube of half a metre."""
    return np.random.default_rng(n).uniform(0.0, 0.5, (n, 3)) + corner


@pytest.mark.parametrize(
    ("n", "n_between", "is_cloud"),
    [(MIN_POINTS, 0, True), (MIN_POINTS - 1, 0, False), (100, 30, True), (100, 31, False), (100, 100, False)],
)
def test_many_points_of_which_few_are_between_two_neighbours_are_a_cloud(n, n_between, is_cloud):
    inside = in_clouds(cube_of(n, (10.2, 4.2, 0.2)), np.arange(n) < n_between, np.ones(n, bool))
    assert inside.tolist() == [is_cloud] * n


def test_a_solid_object_beside_a_cloud_is_not_in_it_and_ground_does_not_count():
    dust, car = cube_of(81, (10.2, 4.2, 0.2)), cube_of(80, (11.2, 4.2, 0.2))
    points, is_car = np.vstack([dust, car]), np.arange(161) >= 81
    assert in_clouds(points, is_car, np.ones(161, bool)).tolist() == (~is_car).tolist()
    assert not in_clouds(points, is_car, is_car).any()


def test_what_is_seen_through_the_windows_of_a_car_is_no_cloud():
    inside, body = cube_of(80, (10.2, 4.2, 0.2)), cube_of(160, (12.2, 4.2, 0.2))
    points, is_body = np.vstack([inside, body]), np.arange(240) >= 80
    assert not in_clouds(points, is_body, np.ones(240, bool)).any()


def test_far_points_and_no_numbers_are_in_no_cloud():
    points = np.vstack([cube_of(60, (5000.2, 0.2, 0.2)), np.full((60, 3), np.nan), np.full((60, 3), -1e30)])
    assert not in_clouds(points, np.zeros(180, bool), np.ones(180, bool)).any()


@cache
def look_at_street(weather: str, sensor: str) -> tuple[Frame, Seen, np.ndarray]:
    """Return a scan of a simulated street, what is observed in it, and which of its points are in the air."""
    recording = record("city", sensor, 4, 5, conditions=Conditions(weather=weather))
    settings = load_settings("default")
    frames, about = Steps(recording, settings, recording.reference_poses, workers=1).frames, settings.candidates
    lidars = learn_lidars([frames[0], frames[3]])
    ground = map_ground(frames[2].points_level, frames[2].origin_level, about.ground)
    return frames[2], look(frames[2], lidars, ground, about.ground), (recording.truth(2)[frames[2].kept] & 0xFFFF) == 1


@pytest.mark.parametrize("sensor", [pytest.param("VLP-16", marks=pytest.mark.slow), "HDL-64E"])
def test_most_of_the_dust_is_specks_and_hardly_anything_else_is(sensor):
    _, dusty, is_air = look_at_street("dust", sensor)
    _, clear, _ = look_at_street("clear", sensor)
    stands = (clear.kind == OBJECT) | (clear.kind == SPECK)
    assert (dusty.kind[is_air & (dusty.kind != GROUND)] == SPECK).mean() > 0.5
    assert (clear.kind[stands] == SPECK).mean() < 0.01


def test_rays_that_end_in_a_cloud_are_in_no_range_image():
    frame, seen, is_air = look_at_street("dust", "HDL-64E")
    image = seen.views[0].image
    cell, ranges = locate(raw_points(frame), image.pattern)
    difference = np.abs(image.rays.reshape(-1, 2)[cell] * UNIT - ranges[:, None]).min(axis=1)
    is_there = (difference < 2.0 * UNIT) & (cell >= 0)
    assert is_there[seen.kind == OBJECT].mean() > 0.95
    assert is_there[is_air & (seen.kind == SPECK)].mean() < 0.2


@pytest.mark.parametrize("sensor", [pytest.param("VLP-16", marks=pytest.mark.slow), "HDL-64E"])
def test_what_is_seen_through_dust_looks_nearly_as_solid_as_without(sensor):
    _, dusty, is_air = look_at_street("dust", sensor)
    _, clear, _ = look_at_street("clear", sensor)
    through = dusty.solidity[(dusty.kind == OBJECT) & ~is_air]
    assert through.mean() > clear.solidity[clear.kind == OBJECT].mean() - 0.06 * 255  # 0.1 less if grains count
