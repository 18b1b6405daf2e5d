import numpy as np
import pytest

from automos.objects.segments import segment_points
from automos.settings import SegmentSettings

S = SegmentSettings()
ROWS, COLUMNS = np.radians(0.4), np.radians(0.2)


def cloud(x, y, low=0.2, high=1.6, half=0.3, step=0.15):
    u, z = np.arange(-half, half + 1e-6, step), np.arange(low, high + 1e-6, step)
    a, b, c = (grid.ravel() for grid in np.meshgrid(u, u, z))
    return np.stack([x + a, y + b, c], axis=1).astype(np.float32)


def segments(*clouds, settings=S, rows=ROWS):
    points = np.concatenate(clouds)
    ids = segment_points(points, points[:, 2], (rows, COLUMNS), settings)
    return ids, np.split(ids, np.cumsum([len(c) for c in clouds])[:-1])


def test_things_apart_are_apart_and_each_is_whole():
    _, parts = segments(cloud(5, 0), cloud(5, 2), cloud(-8, 3))
    assert [set(part.tolist()) for part in parts] == [{0}, {1}, {2}]


def test_parts_nearer_than_the_gap_are_one():
    _, (a, b) = segments(cloud(5, 0, step=0.05), cloud(5, 0.9, step=0.05))
    assert set(a.tolist()) == set(b.tolist())


@pytest.mark.parametrize("shift", np.linspace(0.0, 0.25, 6))
@pytest.mark.parametrize("turn", [0.0, 0.7, 1.5])
def test_the_gap_is_that_between_points_wherever_the_borders_of_cells_are(shift, turn):
    c, s = np.cos(turn), np.sin(turn)
    walls = [cloud(5.0 + shift, y, half=0.04, step=0.04) for y in (0.0, 0.08 + 0.7 * S.gap, 0.16 + 2.3 * S.gap)]
    turned = [(wall @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])).astype(np.float32) for wall in walls]
    _, (a, b, far) = segments(*turned)
    assert set(a.tolist()) == set(b.tolist())
    assert set(far.tolist()).isdisjoint(a.tolist())


def test_a_crown_and_the_car_beneath_it_are_two():
    _, (car, crown) = segments(cloud(6, 0, high=1.5), cloud(6, 0, low=2.6, high=4.0))
    assert set(car.tolist()).isdisjoint(crown.tolist())


def test_a_mirror_image_under_the_ground_belongs_to_nothing():
    _, (car, image) = segments(cloud(6, 0), cloud(6, 0, low=-5.2, high=-4.9))
    assert set(car.tolist()) == {0}
    assert set(image.tolist()) == {-1}


def test_far_away_the_gap_between_rows_of_rays_holds_nothing_apart():
    low, high = cloud(40, 0, low=0.2, high=0.4), cloud(40, 0, low=1.9, high=2.1)
    sparse, dense = segments(low, high, rows=np.radians(2.0))[0], segments(low, high, rows=np.radians(0.2))[0]
    assert sparse.max() == 0
    assert dense.max() == 1


@pytest.mark.parametrize("setting", ["gap", "gap_rays"])
@pytest.mark.parametrize("value", [1e3, 1e9])
def test_gaps_wider_than_all_that_is_looked_at_are_no_problem(setting, value):
    wide = S.model_copy(update={setting: value, "max_range": 30.0})
    ids, _ = segments(cloud(6, 0), cloud(6, 0, low=3.0, high=4.0), cloud(-25, 3, low=4.0, high=9.0), settings=wide)
    assert ids[0] == 0
    assert ids.max() < 3


def test_points_beyond_the_range_belong_to_nothing():
    ids, _ = segments(cloud(S.max_range + 5, 0))
    assert (ids == -1).all()


def test_the_order_of_points_does_not_matter():
    points = np.concatenate([cloud(5, 0), cloud(5, 2), cloud(-8, 3)])
    order = np.random.default_rng(0).permutation(len(points))
    ids, shuffled = segments(points)[0], segments(points[order])[0]
    for k in range(3):
        assert len(set(ids[order][shuffled == k].tolist())) == 1


@pytest.mark.parametrize("n", [0, 1])
def test_few_points_are_no_problem(n):
    ids, _ = segments(np.full((n, 3), 3.0, np.float32))
    assert ids.tolist() == [0] * n
