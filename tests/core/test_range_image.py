import numpy as np
import pytest

from automos.core.beam_pattern import make_pattern
from automos.core.range_image import NO_RAY, find_neighbours, locate, make_image, over_neighbours, project

PATTERN = make_pattern(np.radians(np.arange(-4.0, 5.0, 1.0)), np.radians(1.0))


def ray(azimuth_deg, elevation_deg, distance):
    a, e = np.radians(azimuth_deg), np.radians(elevation_deg)
    return [distance * np.cos(e) * np.cos(a), distance * np.cos(e) * np.sin(a), distance * np.sin(e)]


def test_the_extremes_around_a_cell_go_round_the_columns_and_end_at_the_rows():
    image = np.zeros((3, 5), np.uint16)
    image[0, 0] = 7
    assert over_neighbours(image, np.maximum).tolist() == [[7, 7, 0, 0, 7], [7, 7, 0, 0, 7], [0, 0, 0, 0, 0]]
    assert over_neighbours(7 - image, np.minimum).tolist() == [[0, 0, 7, 7, 0], [0, 0, 7, 7, 0], [7, 7, 7, 7, 7]]


def test_points_are_located_by_row_and_column_and_those_beside_the_beams_are_not():
    points = np.array([ray(0.5, 0.0, 10.0), ray(0.5, 2.0, 20.0), ray(0.5, 40.0, 5.0)], np.float32)
    cell, ranges = locate(points, PATTERN)
    assert (cell // PATTERN.n_columns).tolist()[:2] == [4, 6]
    assert (cell % PATTERN.n_columns).tolist()[:2] == [180, 180]
    assert cell[2] == -1
    np.testing.assert_allclose(ranges, [10.0, 20.0, 5.0], rtol=1e-6)


def test_of_several_points_in_a_cell_the_nearest_and_the_farthest_are_kept():
    points = np.array([ray(0.5, 0.0, r) for r in (12.0, 8.0, 10.0)], np.float32)
    rays = project(points, PATTERN, np.array([True, True, True])).rays
    assert rays[4, 180].tolist() == pytest.approx([800, 1200], abs=1)
    assert rays[0, 0].tolist() == [NO_RAY, 0]


def test_what_is_no_object_is_transparent_to_the_clear_levels():
    points = np.array([ray(0.5, 0.0, 8.0), ray(0.5, 1.0, 10.0)], np.float32)
    image = make_image(project(points, PATTERN), PATTERN, np.zeros(6, np.float32), np.array([False, True]))
    assert image.around[4, 180, 0] == pytest.approx(800, abs=1)
    for start, (rows, columns) in zip(PATTERN.pyramid.offsets, PATTERN.pyramid.shapes, strict=False):
        assert image.clear[start : start + rows * columns].min() == pytest.approx(1000, abs=1)


@pytest.mark.parametrize(
    ("sides", "is_between"),
    [
        ([(-1.0, 0.0, 10.2), (1.0, 0.0, 9.9)], True),
        ([(0.0, -1.0, 10.2), (0.0, 1.0, 9.9)], True),
        ([(-2.0, 0.0, 10.2), (2.0, 0.0, 9.9)], True),  # cells without a ray are passed over
        ([(-1.0, 0.0, 14.0), (-2.0, 0.0, 10.0), (1.0, 0.0, 10.0)], False),  # but no ray is
        ([(-1.0, 0.0, 10.0), (0.0, 1.0, 10.0)], False),  # a corner
        ([(-1.0, 0.0, 10.0), (1.0, 0.0, 12.0)], False),  # a vertical edge
    ],
)
def test_a_point_is_between_rays_that_ended_beside_it_on_opposite_sides(sides, is_between):
    points = np.array([ray(0.5, 0.0, 10.0), *(ray(0.5 + a, e, r) for a, e, r in sides)], np.float32)
    found = find_neighbours(project(points, PATTERN), np.ones(len(points), bool))
    assert found[2][0] == is_between
