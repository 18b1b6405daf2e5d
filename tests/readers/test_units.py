"""Coordinates in metres, centimetres, millimetres, and of a map."""

import numpy as np
import pytest
from sweeps import points_of, sweep

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.readers.units import are_angles, unit_of


def street(n=2000, seed=0):
    """Return points around a sensor as a street has them: many near, some 80 m away."""
    rng = np.random.default_rng(seed)
    azimuth, ranges = rng.uniform(-np.pi, np.pi, n), rng.gamma(1.5, 10.0, n) + 1.0
    return np.column_stack([ranges * np.cos(azimuth), ranges * np.sin(azimuth), rng.uniform(-1.8, 3.0, n)])


@pytest.mark.parametrize(("factor", "unit"), [(1.0, 1.0), (3.0, 1.0), (100.0, 0.01), (1000.0, 0.001)])
def test_the_unit_is_the_one_under_which_ranges_are_those_of_a_lidar(factor, unit):
    found, words = unit_of(factor * street())
    assert found == unit
    assert len(words) == (unit != 1.0)


EVEN = np.random.default_rng(0).uniform(-900.0, 900.0, (1000, 3))


@pytest.mark.parametrize(
    "cloud", [np.zeros((0, 3)), np.zeros((9, 3)), np.full((9, 3), np.nan), street() + 500_000.0, EVEN]
)
def test_nothing_and_a_map_are_in_metres(cloud):
    assert unit_of(cloud) == (1.0, [])


def test_a_folder_in_centimetres_is_read_in_metres_with_a_warning(tmp_path):
    for i in range(3):
        cloud = np.column_stack([100.0 * street(seed=i), np.zeros(2000)]).astype(np.float32)
        cloud.tofile(tmp_path / f"{i:06d}.bin")
    sequence = open_sequence(tmp_path)
    np.testing.assert_allclose(sequence[1].points, street(seed=1), rtol=1e-5, atol=1e-5)
    assert any("centimetres" in words for words in sequence.warnings)


def test_a_folder_of_maps_is_refused_still(tmp_path):
    cloud = np.column_stack([street() + 500_000.0, np.zeros(2000)]).astype(np.float32)
    cloud.tofile(tmp_path / "000000.bin")
    with pytest.raises(InputError, match="of a map"):
        open_sequence(tmp_path)[0]


def polar(cloud, turn, order, noise=0.0, from_above=False):
    """Return range, azimuth and elevation (`turn` is half a turn) in some order, the directions off by a little."""
    away = np.linalg.norm(cloud, axis=1)
    around, up = np.arctan2(cloud[:, 1], cloud[:, 0]), np.arcsin(cloud[:, 2] / away)
    rng = np.random.default_rng(0)
    around = around + rng.normal(0.0, noise, len(away))
    up = 0.5 * np.pi - up if from_above else up
    return np.column_stack([away, around * turn / np.pi, up * turn / np.pi])[:, order]


@pytest.mark.parametrize("turn", [np.pi, 180.0])
@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (0, 2, 1)])
@pytest.mark.parametrize("noise", [0.0, 2e-3])
@pytest.mark.parametrize("from_above", [False, True])
def test_ranges_and_angles_are_no_coordinates(tmp_path, turn, order, noise, from_above):
    for k in range(3):
        polar(points_of(sweep(seed=k)), turn, order, noise, from_above).astype("<f4").tofile(tmp_path / f"{k}.bin")
    with pytest.raises(InputError, match=r"holds ranges and angles, as it seems.*; write the coordinates"):
        open_sequence(tmp_path)


@pytest.mark.parametrize("turn", [np.pi, 180.0])
@pytest.mark.parametrize("half", [40, 60])
@pytest.mark.parametrize("noise", [0.0, 2e-3])
def test_ranges_and_angles_of_a_view_to_the_front_are_no_coordinates_and_coordinates_are(turn, half, noise):
    cloud = points_of(sweep(n_beams=32)).astype(float)
    front = cloud[np.abs(np.degrees(np.arctan2(cloud[:, 1], cloud[:, 0]))) < half]
    assert are_angles(polar(front, turn, (0, 1, 2), noise))
    assert not are_angles(front)


@pytest.mark.parametrize("width", [2.0 * np.pi, 360.0])
def test_a_view_to_the_front_that_is_as_wide_as_a_turn_is_no_angle(width):
    cloud = points_of(sweep())
    front = cloud[cloud[:, 0] > np.abs(cloud[:, 1])].astype(float)
    front *= width / np.ptp(front[:, 1])
    assert not are_angles(front)
    assert not are_angles(cloud)
    assert not are_angles(np.zeros((0, 3)))


@pytest.mark.recordings
@pytest.mark.parametrize("name", ["kitti_0005", "lyft_5hz", "room_vlp16", "handheld_xt32"])
def test_real_sweeps_told_in_angles_are_known(recording_of, name):
    cloud = open_sequence(recording_of(name))[5].rays.astype(float)
    cloud = cloud[np.linalg.norm(cloud, axis=1) > 0.5]
    assert not are_angles(cloud)
    assert all(are_angles(polar(cloud, *told)) for told in ((np.pi, (0, 1, 2)), (180.0, (1, 2, 0))))
    if name != "handheld_xt32":  # of which only what is near was kept, in some directions
        assert all(are_angles(polar(cloud, turn, (0, 1, 2), from_above=True)) for turn in (np.pi, 180.0))
