import numpy as np
import pytest

from automos.core.array_sequence import ArraySequence
from automos.core.scan import Scan
from automos.odometry.elevation import Raised, raised


def test_beams_turn_by_the_angle_and_keep_azimuth_and_range():
    points = np.random.default_rng(0).normal(0.0, 10.0, (500, 3)).astype(np.float32)
    found = raised(points, np.radians(0.5))
    elevation = [np.degrees(np.arctan2(p[:, 2], np.hypot(p[:, 0], p[:, 1]))) for p in (points, found)]
    np.testing.assert_allclose(elevation[1] - elevation[0], 0.5, atol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), np.linalg.norm(points, axis=1), rtol=1e-5)
    np.testing.assert_allclose(np.arctan2(*found[:, :2].T), np.arctan2(*points[:, :2].T), atol=1e-5)


def test_a_level_beam_rises_by_the_sine_of_the_angle():
    np.testing.assert_allclose(raised(np.float32([[30, 40, 0]]), np.radians(0.2))[0, 2], 50 * np.sin(np.radians(0.2)))


def test_no_angle_changes_nothing_and_no_return_stays_one():
    points = np.float32([[np.nan, 1, 2], [0, 0, 0], [np.inf, 0, 0], [1, 2, 3]])
    assert raised(points, 0.0) is points
    found = raised(points, 0.01)
    assert np.isnan(found[0]).any()
    np.testing.assert_array_equal(found[1], 0.0)
    assert not np.isfinite(found[2]).all()


def test_a_raised_recording_keeps_everything_else():
    scans = [Scan(np.float32([[5, 0, 0]]), intensity=np.ones(1), stamp=0.1 * i) for i in range(3)]
    given = ArraySequence(scans, is_compensated=True)
    found = Raised(given, 0.1)
    assert (len(found), found.names, found.is_compensated) == (3, given.names, True)
    np.testing.assert_array_equal(found.stamps, given.stamps)
    assert found[1].points[0, 2] == pytest.approx(5 * np.sin(0.1))
    assert found[1].intensity is not None
