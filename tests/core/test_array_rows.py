"""Whether the rows of an array are scans: whatever order, padding or size they have, and whichever way images lie."""

import numpy as np
import pytest

from automos.core.array_rows import are_scans

BEAMS, STEPS = 16, 360


def image(rng, tilt=0.0):
    """Return (BEAMS, STEPS, 3) what a sensor sees that leans by `tilt`."""
    elevation, azimuth = np.meshgrid(np.linspace(-0.3, 0.2, BEAMS), np.linspace(-np.pi, np.pi, STEPS), indexing="ij")
    rays = np.stack(
        [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1
    )
    turn = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    return rng.uniform(2, 60, (BEAMS, STEPS, 1)) * rays @ turn.T


@pytest.mark.parametrize("tilt", [0.0, 0.8, np.pi / 2])
def test_the_rows_of_an_image_are_no_scans_whichever_way_it_lies_and_the_sensor_leans(tilt):
    rows = image(np.random.default_rng(0), tilt)
    rows[::3, ::4] = 0.0
    rows[1::3, ::5] = np.nan
    assert are_scans(rows) is False
    assert are_scans(rows.swapaxes(0, 1)) is False


@pytest.mark.parametrize("n_scans", [2, 7, 300])
def test_rows_that_all_see_the_same_directions_are_scans(n_scans):
    rng = np.random.default_rng(1)
    scans = np.stack([image(rng).reshape(-1, 3) for _ in range(n_scans)])
    assert are_scans(scans) is True
    shuffled = np.stack([rng.permutation(scan) for scan in scans])
    assert are_scans(shuffled) is True
    shuffled[:, -1500:] = [np.nan, np.inf, 0.0]  # as many as the shortest has not
    assert are_scans(shuffled) is True
    assert are_scans(np.concatenate([shuffled, np.full((*shuffled.shape[:2], 1), 9.0)], axis=-1)) is True


def test_an_image_in_the_frame_of_a_vehicle_does_not_tell():
    assert are_scans(image(np.random.default_rng(2)) + np.array([1.0, 0.0, 1.7])) is None


def test_rows_without_points_tell_nothing_of_an_image():
    assert are_scans(np.zeros((4, 100, 3))) is True
