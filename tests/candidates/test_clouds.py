import numpy as np
import pytest

from automos import load_settings
from automos.candidates.clouds import MIN_POINTS, in_clouds
from automos.candidates.observations import learn_lidars, look
from automos.pipeline import Steps
from automos.scan import OBJECT, SPECK
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


def speck_shares(weather: str, sensor: str) -> tuple[float, float]:
    """Return the shares of the points in the air, and of what stands in a street, that are specks."""
    recording = record("city", sensor, 4, 5, conditions=Conditions(weather=weather))
    settings = load_settings("default")
    frames, about = Steps(recording, settings, recording.reference_poses, workers=1).frames, settings.candidates
    lidars = learn_lidars(frames, [frames[0], frames[3]], about.ego_body, 1)
    kind, truth = look(frames[2], lidars, about.ground).kind, recording.truth(2)[frames[2].kept] & 0xFFFF
    stands, is_air = (kind == OBJECT) | (kind == SPECK), truth == 1
    return tuple(float((kind[stands & part] == SPECK).mean()) if part.any() else 0.0 for part in (is_air, ~is_air))


@pytest.mark.parametrize("sensor", ["VLP-16", "HDL-64E"])
def test_most_of_the_dust_is_specks_and_hardly_anything_else_is(sensor):
    assert speck_shares("dust", sensor)[0] > 0.5
    assert speck_shares("clear", sensor)[1] < 0.01
