"""The tests' own world, by hand: a wrong truth would make every other test agree with a mistake."""

import numpy as np
import pytest
from worlds import SENSOR_HEIGHT, Block, cast, drive, record, rider

from automos.core.geometry import transform
from automos.core.labels import Label
from automos.core.upright_boxes import Boxes, points_in_boxes

ORIGIN = np.array([0.0, 0.0, SENSOR_HEIGHT])


@pytest.mark.parametrize(
    ("ray", "distance", "hit"),
    [
        ((1, 0, 0), 4.0, 0),  # the face of the cube around (5, 0, 2)
        ((-1, 0, 0), np.inf, -1),
        ((0, 0, -1), SENSOR_HEIGHT, -1),
        ((0.6, 0.8, 0), np.inf, -1),
        ((-0.8, 0, -0.6), SENSOR_HEIGHT / 0.6, -1),
        ((0, 1, 0), 10.0 - np.sqrt(2.0), 1),  # the edge of the same cube, turned by an eighth, around (0, 10, 2)
    ],
)
def test_a_ray_ends_at_what_it_meets_first(ray, distance, hit):
    blocks = [Block((5, 0, 2), (2, 2, 2)), Block((0, 10, 2), (2, 2, 2), yaw=np.pi / 4), Block((9, 0, 2), (2, 9, 2))]
    got = cast(blocks, ORIGIN, np.array([ray], float), time=0.0)
    np.testing.assert_allclose(got[0], distance)
    np.testing.assert_array_equal(got[1], hit)


def test_a_block_is_where_its_velocity_has_taken_it():
    distance, _ = cast([Block((5, 0, 2), (2, 2, 2), velocity=(3, 0, 0))], ORIGIN, np.array([[1.0, 0, 0]]), time=2.0)
    np.testing.assert_allclose(distance, 10.0)


def test_moving_points_lie_on_moving_blocks_and_no_others_do():
    block = rider(-4.0, 5.0, yaw=0.3, speed=5.0)
    world = record((block, Block((0, -8, 2), (20, 1, 4))), drive(6))
    for i, (scan, truth, T) in enumerate(zip(world.sequence, world.truth, drive(6), strict=True)):
        center = np.array([block.center]) + 0.1 * i * np.array([block.velocity])
        box = Boxes(center, np.array([block.size]), np.array([block.yaw]), np.ones(1))
        # three centimetres: the noise of the range, three times over
        is_on = points_in_boxes(transform(T, scan.points.astype(float)), box, margin=0.03) == 0
        assert truth[is_on].tolist().count(Label.STATIC) <= 0.02 * is_on.sum()  # ground at its feet
        assert is_on[truth == Label.MOVING].mean() > 0.98
        assert (truth == Label.MOVING).sum() > 30
