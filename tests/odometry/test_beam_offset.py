import numpy as np
import pytest
from raw_worlds import TOWN, curve, true_poses
from scipy.spatial.transform import Rotation
from worlds import record

from automos.core.array_sequence import ArraySequence
from automos.odometry.beam_offset import SCANS, find_elevation, longest_path
from automos.odometry.elevation import raised, raised_scan
from automos.odometry.estimate import estimate_trajectory
from automos.odometry.surfels import surfels_of
from automos.odometry.trajectory import Trajectory, make_frame
from automos.odometry.window import Window
from automos.settings import OdometrySettings

# a few streets: estimates are good to 0.05 degrees

N = 40


@pytest.fixture(scope="module")
def drive():
    pose = curve(9.0, 0.1)
    return record(TOWN, np.array([pose(0.1 * i) for i in range(N)]), n_beams=64).sequence, true_poses(pose, N)


def window_of(drive, offset_deg, poses=None):
    sequence, truth = drive
    surfels = [surfels_of(raised(scan.points, -np.radians(offset_deg)), None) for scan in sequence]
    return Window(surfels, np.zeros((N, 6)), truth if poses is None else poses, np.ones(N - 1), 0.1, 0.0)


@pytest.mark.parametrize("offset_deg", [-0.4, 0.3])
def test_an_offset_of_all_beams_is_found(drive, offset_deg):
    assert np.degrees(find_elevation(window_of(drive, offset_deg))) == pytest.approx(offset_deg, abs=0.08)


def test_a_sensor_without_an_offset_is_left_alone(drive):
    assert find_elevation(window_of(drive, 0.0)) == 0.0


def test_a_path_that_is_bent_is_not_taken_for_an_offset(drive):
    pitch = Rotation.from_euler("y", np.radians(0.02) * np.arange(N)[:, None])  # as of a path that an offset has bent
    poses = drive[1].copy()
    poses[:, :3, :3] = drive[1][:, :3, :3] @ pitch.as_matrix()
    assert abs(np.degrees(find_elevation(window_of(drive, 0.0, poses)))) < 0.08


def test_a_sensor_that_stands_says_nothing(drive):
    sequence, _ = drive
    surfels = [surfels_of(raised(sequence[0].points, -0.005), None)] * N
    still = Window(surfels, np.zeros((N, 6)), np.tile(np.eye(4), (N, 1, 1)), np.ones(N - 1), 0.1, 0.0)
    assert find_elevation(still) == 0.0


def test_the_scans_of_the_longest_path_are_compared():
    x = np.cumsum(np.where(np.arange(400) < 250, 0.0, 1.0))
    part = longest_path(np.stack([x, 0.0 * x, 0.0 * x], axis=1))
    assert part.stop - part.start == SCANS
    assert part.start >= 249
    assert longest_path(np.zeros((3, 3))) == slice(0, 3)


def test_poses_frames_and_figures_take_the_beams_as_they_are(drive):
    sequence, truth = drive
    given = ArraySequence([raised_scan(scan, -np.radians(0.3)) for scan in sequence], stamps=0.1 * np.arange(N))
    found = estimate_trajectory(given, OdometrySettings(time="none"), poses=truth)
    assert found.diagnostics["beams_raised_deg"] == pytest.approx(0.3, abs=0.06)
    assert found.elevation == pytest.approx(np.radians(0.3), abs=1e-3)
    again = Trajectory.from_arrays(found.to_arrays())
    assert again.elevation == found.elevation
    frame = make_frame(given[3], again, 3)
    np.testing.assert_allclose(frame.points, sequence[3].points[frame.kept], atol=0.06)
