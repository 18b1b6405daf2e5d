import numpy as np
import pytest
from free_space_worlds import HEIGHT, spin
from worlds import Block

from automos.core.beam_pattern import learn_pattern
from automos.core.range_image import find_neighbours, make_image, project
from automos.evidence.look_through import BENEATH, BLOCKED, EDGE, HIT, THROUGH, UNSEEN, WEAK, look_through

TOLERANCES = tuple(np.float32(x) for x in (0.25, 0.005, 0.2, 0.0, 0.0))
NO_MOTION = np.zeros(6, np.float32)


def image_of(points, is_object, pattern, motion=NO_MOTION):
    return make_image(project(points, pattern), pattern, motion, is_object)


def scan_of(*blocks):
    """The frame and the range image of one scan of `blocks` on a plane."""
    frame, _, distance = spin(blocks)
    frame = frame(distance)
    pattern = learn_pattern([frame])
    return frame, image_of(frame.points, frame.points_level[:, 2] >= 0.05, pattern)


def looks(image, *places, tolerances=TOLERANCES):
    """What a scan's range image says of `places`, (x, y, height above the ground)."""
    points = np.array(places, np.float32).T - np.array([[0.0], [0.0], [HEIGHT]], np.float32)
    codes, _ = look_through(np.ascontiguousarray(points), np.eye(4, dtype=np.float32)[:3], image, tolerances)
    return codes.tolist()


@pytest.fixture(scope="module")
def wall_and_post():
    return scan_of(Block((20.0, 0.0, 3.0), (1.0, 30.0, 6.0)), Block((10.0, 5.0, 2.0), (0.3, 0.3, 4.0)))[1]


def test_before_on_and_behind_a_wall_is_through_hit_and_blocked(wall_and_post):
    assert looks(wall_and_post, (12.0, 0.0, 1.5), (19.5, 0.0, 1.5), (23.0, 0.0, 1.5)) == [THROUGH, HIT, BLOCKED]


def test_where_poses_may_be_off_rays_must_go_on_farther_behind_and_hit_no_more_than_before(wall_and_post):
    near_the_wall, far_from_it, hit = (18.8, 0.0, 1.5), (12.0, 0.0, 1.5), (19.5, 0.0, 1.5)
    assert looks(wall_and_post, near_the_wall, far_from_it, hit) == [THROUGH, THROUGH, HIT]
    off = tuple(np.float32(x) for x in (0.25, 0.005, 0.2, 0.2, 0.01))  # 0.4 m here
    assert looks(wall_and_post, near_the_wall, far_from_it, hit, tolerances=off) == [EDGE, THROUGH, HIT]


def test_where_no_ray_came_back_nothing_is_known(wall_and_post):
    assert looks(wall_and_post, (-30.0, 0.0, 3.5)) == [UNSEEN]


def test_right_beside_a_post_is_only_weakly_through(wall_and_post):
    beside, away = looks(wall_and_post, (10.1, 4.7, 1.5), (10.1, 3.4, 1.5))
    assert beside in (WEAK, EDGE)
    assert away == THROUGH


def test_the_ground_is_hit_and_a_hand_above_it_is_not_observed_free(wall_and_post):
    on_ground, above = looks(wall_and_post, (8.0, 0.0, 0.0), (8.0, 0.0, 0.12))
    assert on_ground == above == BENEATH


def test_the_ground_beneath_a_place_is_not_the_place_however_far_apart_the_rows_are(wall_and_post):
    # The row below the one through (15, 0, 0.5) meets the ground at that range.
    assert looks(wall_and_post, (15.0, 0.0, 0.5)) != [HIT]


def test_a_thing_that_returns_nothing_is_not_observed_free_by_rays_over_its_roof():
    frame, image = scan_of(Block((30.0, 0.0, 3.0), (1.0, 40.0, 6.0)))
    black = frame.points_level
    is_swallowed = (np.abs(black[:, 1]) < 0.09 * black[:, 0]) & (black[:, 2] < 1.4)  # a black car 10 m ahead
    image = image_of(frame.points[~is_swallowed], black[~is_swallowed, 2] >= 0.05, image.pattern)
    assert THROUGH not in looks(image, (10.0, 0.0, 0.6), (10.0, 0.3, 0.9))


def test_the_sensors_own_motion_is_taken_into_account():
    # Columns ahead are measured mid-sweep, to the left a quarter of a sweep before: the sensor was half a metre behind.
    frame, _, distance = spin((Block((20.0, 0.0, 3.0), (1.0, 60.0, 6.0)),))
    frame = frame(distance)
    azimuth = np.arctan2(frame.points[:, 1], frame.points[:, 0])
    motion = np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    timed = type(frame)(
        frame.points,
        frame.kept,
        frame.n_points,
        frame.T_level_sensor,
        0.0,
        (-azimuth / 6.2832).astype(np.float32),
        motion,
    )
    pattern = learn_pattern([timed])
    # The image is as the moving sensor measured it; the place asked about is in the frame at mid-sweep.
    image = image_of(frame.points, np.ones(len(azimuth), bool), pattern, motion.astype(np.float32))
    at = np.radians(40.0)
    seen = np.array([19.5, 19.5 * np.tan(at), 1.0])  # where the ray at 40 degrees ended
    shift = -at / (2.0 * np.pi) * motion[0]
    places = (seen[0] + shift, *seen[1:]), (seen[0] + shift + 0.9, *seen[1:])
    assert looks(image, *places) == [HIT, BLOCKED]


def test_walls_are_supported_and_wires_are_not():
    wire = Block((10.0, 0.0, 2.5), (0.02, 20.0, 0.16))
    frame, image = scan_of(wire, Block((20.0, 0.0, 3.0), (1.0, 60.0, 6.0)))
    level = frame.points_level
    on_wire = np.abs(level[:, 0] - 10.0) < 0.1
    on_wall = (
        (np.abs(level[:, 0] - 19.5) < 0.1) & (np.abs(level[:, 1]) < 10.0) & (level[:, 2] > 0.5) & (level[:, 2] < 3)
    )
    supported = find_neighbours(project(frame.points, image.pattern), np.ones(len(level), bool))[0] == 2
    assert on_wire.sum() > 50
    assert supported[on_wall].mean() > 0.99
    assert supported[on_wire & (level[:, 2] > 1.0)].mean() < 0.2


def test_a_drop_in_the_air_is_met_by_one_ray_only_and_a_post_by_several():
    frame, image = scan_of(Block((20.0, 0.0, 3.0), (1.0, 60.0, 6.0)), Block((10.0, 5.0, 2.0), (0.3, 0.3, 4.0)))
    points = frame.points.copy()
    drops = np.flatnonzero(np.abs(frame.points_level[:, 0] - 19.5) < 0.1)[::200]
    points[drops] *= 0.3
    n_directions, solidity, is_between = find_neighbours(project(points, image.pattern), np.ones(len(points), bool))
    assert len(drops) > 10
    assert (n_directions[drops] == 0).all()
    assert (solidity[drops] == 0).all()
    assert not is_between[drops].any()
    assert np.median(solidity[np.abs(frame.points_level[:, 0] - 19.5) < 0.1]) == 255
    assert (n_directions[np.linalg.norm(frame.points_level[:, :2] - (10.0, 5.0), axis=1) < 0.25] > 0).all()
