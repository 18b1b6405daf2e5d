import numpy as np
import pytest

from automos.core.beam_pattern import EgoBody, Lidar, make_pattern
from automos.evidence.on_body import N_SECTORS, SWING, extent_in, extent_in_most, is_on_body, parts_of

PATTERN = make_pattern(np.radians(np.arange(-20.0, 1.0, 1.0)), np.radians(1.0))
BEHIND = N_SECTORS // 2
"""The bonnet below lies in the two sectors beside azimuth 0: the first, and the last."""


def grid(x, y, z):
    """Points (M, 3) at all combinations of the coordinates, metres."""
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)


BONNET = grid(np.arange(1.5, 2.0, 0.04), np.arange(-0.5, 0.51, 0.05), [-0.4])
PERSON = grid([2.2], np.arange(-0.2, 0.21, 0.05), np.arange(-0.7, 0.0, 0.05))
"""Stands 0.2 m before the bonnet."""


def reach_of_bonnet():
    """A body that every ray within 30 degrees of azimuth 0 meets, up to 2.1 m."""
    reach = np.zeros((PATTERN.n_rows, PATTERN.n_columns), np.float32)
    azimuth = 360.0 * (np.arange(PATTERN.n_columns) + 0.5) / PATTERN.n_columns - 180.0
    reach[:, np.abs(azimuth) < 30.0] = 2.1
    return reach


def found(points, extent):
    lidar = Lidar(0, np.eye(4), PATTERN, EgoBody(reach_of_bonnet(), np.full(N_SECTORS, extent, np.float32)))
    return is_on_body(points, np.zeros(len(points), bool), lidar)


def test_without_a_body_no_point_lies_on_it():
    assert not is_on_body(BONNET, np.zeros(len(BONNET), bool), Lidar(0, np.eye(4), PATTERN)).any()


@pytest.mark.parametrize(("extent", "is_body"), [(2.15, False), (3.0, True)])
def test_what_is_connected_belongs_to_the_body_as_far_as_it_goes_in_most_scans(extent, is_body):
    points = np.vstack([BONNET, PERSON])
    body = found(points, extent)
    assert body[: len(BONNET)].mean() > 0.95
    assert (body[len(BONNET) :] == is_body).all()


def test_ground_connects_nothing():
    points = np.vstack([BONNET, PERSON])
    lidar = Lidar(0, np.eye(4), PATTERN, EgoBody(reach_of_bonnet(), np.full(N_SECTORS, 3.0, np.float32)))
    is_ground = np.arange(len(points)) >= len(BONNET)
    assert not is_on_body(points, is_ground, lidar)[is_ground].any()


def test_a_large_part_of_which_little_lies_on_the_body_is_no_body():
    wall = grid([2.2], np.arange(-1.2, 1.2, 0.02), np.arange(-0.7, 1.5, 0.05))
    assert not found(np.vstack([BONNET, wall]), 3.0)[len(BONNET) :].any()


def test_the_extent_of_one_scan_is_the_farthest_connected_point_of_each_sector():
    points = np.vstack([BONNET, PERSON])
    no_ground = np.zeros(len(points), bool)
    extent = extent_in(points, no_ground, reach_of_bonnet(), PATTERN, max_range=10.0)
    assert extent[0] == pytest.approx(np.linalg.norm(points[points[:, 1] >= 0.0], axis=1).max())
    assert extent[BEHIND] == 0.0
    alone = extent_in(BONNET, no_ground[: len(BONNET)], reach_of_bonnet(), PATTERN, max_range=10.0)
    assert alone[0] < 2.1 < extent[0]


def test_who_stands_at_the_body_in_less_than_half_of_the_scans_does_not_extend_it():
    usual, now_and_then = np.zeros((2, N_SECTORS), np.float32)
    usual[BEHIND], now_and_then[BEHIND] = 2.0, 4.0
    expected = np.zeros(N_SECTORS)
    expected[BEHIND - SWING : BEHIND + SWING + 1] = 2.0
    np.testing.assert_allclose(extent_in_most([usual, now_and_then, usual, usual, now_and_then]), expected)


def test_a_trailer_that_swings_from_sector_to_sector_is_followed():
    scans = np.zeros((5, N_SECTORS), np.float32)
    for k in range(5):
        scans[k, BEHIND - 2 + k] = 9.0
    extent = extent_in_most(list(scans))
    assert extent[BEHIND] == pytest.approx(9.0)
    assert extent[BEHIND + N_SECTORS // 4] == 0.0


def test_parts_are_connected_across_larger_gaps_where_they_are_farther_away():
    for distance, gap, n in ((1.0, 0.4, 2), (5.0, 0.4, 1), (5.0, 2.0, 2)):
        first = grid(distance + np.arange(0.0, 0.2, 0.02), np.arange(-0.1, 0.1, 0.02), [0.0])
        part, _ = parts_of(np.vstack([first, first + np.float32([0.2 + gap, 0.0, 0.0])]))
        assert len(np.unique(part)) == n
