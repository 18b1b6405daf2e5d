import logging

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from automos.core.errors import InputError
from automos.core.geometry import inverse, make_transform, se3_exp
from automos.core.pose_files import read_calib, read_poses
from automos.core.pose_writers import write_kitti, write_tum

# KITTI's camera looks along its z: x right, y down, z forward; the sensor looks along x, 0.3 m behind, 0.1 m above it.
T_CAMERA_SENSOR = make_transform([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.0, -0.1, -0.3])


def drive(n: int = 6) -> np.ndarray:
    """Return (n, 4, 4) poses of a curving, climbing drive that starts at the identity."""
    T = np.tile(np.eye(4), (n, 1, 1))
    for i in range(1, n):
        T[i] = T[i - 1] @ se3_exp([1.0, 0.02, 0.05, 0.01, -0.02, 0.1])
    return T


def test_kitti_poses_come_back_as_they_were_written(tmp_path):
    poses = drive()
    write_kitti(tmp_path / "poses.txt", poses)
    np.testing.assert_allclose(read_poses(tmp_path / "poses.txt", 6), poses, atol=1e-11)


def test_tum_poses_come_back_as_they_were_written(tmp_path):
    poses, stamps = drive(), 1.6e9 + np.arange(6) * 0.1
    write_tum(tmp_path / "poses.tum", poses, stamps)
    np.testing.assert_allclose(read_poses(tmp_path / "poses.tum", 6, stamps), poses, atol=1e-6)
    np.testing.assert_allclose(read_poses(tmp_path / "poses.tum", 6), poses, atol=1e-10)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6))
def test_poses_are_relative_to_the_first_scan_wherever_the_file_starts(tmp_path_factory, twist):
    path = tmp_path_factory.mktemp("poses") / "poses.txt"
    write_kitti(path, se3_exp(twist) @ drive())
    np.testing.assert_allclose(read_poses(path, 6), drive(), atol=1e-9)


def test_a_calibration_turns_a_kitti_file_into_sensor_poses(tmp_path):
    # by hand: the camera moves 2 m along its z, so the sensor moves 2 m along its x.
    (tmp_path / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 5\n1 0 0 0 0 1 0 0 0 0 1 7\n")
    poses = read_poses(tmp_path / "poses.txt", 2, T_camera_sensor=T_CAMERA_SENSOR)
    np.testing.assert_allclose(poses, [np.eye(4), make_transform(t=[2.0, 0.0, 0.0])], atol=1e-12)


def test_poses_written_for_the_camera_are_read_back_with_the_same_calibration(tmp_path):
    write_kitti(tmp_path / "poses.txt", T_CAMERA_SENSOR @ drive() @ inverse(T_CAMERA_SENSOR))
    read = read_poses(tmp_path / "poses.txt", 6, T_camera_sensor=T_CAMERA_SENSOR)
    np.testing.assert_allclose(read, drive(), atol=1e-10)


def test_sixteen_numbers_a_line_are_whole_matrices(tmp_path):
    np.savetxt(tmp_path / "poses.txt", drive().reshape(-1, 16))
    np.testing.assert_allclose(read_poses(tmp_path / "poses.txt", 6), drive(), atol=1e-12)


def test_comments_blank_lines_and_commas_are_accepted(tmp_path):
    (tmp_path / "poses.txt").write_text("# time x y z qx qy qz qw\n\n0,0,0,0,0,0,0,1\n1,2,0,0,0,0,0,1\n")
    np.testing.assert_allclose(read_poses(tmp_path / "poses.txt", 2)[1, :3, 3], [2, 0, 0])


def test_tum_poses_are_interpolated_at_the_stamps_of_the_scans(tmp_path):
    # 100 Hz poses at 10 m/s that also turn at 1 rad/s about z; scans lie between two poses.
    times = np.arange(0.0, 1.0, 0.01)
    T = np.tile(np.eye(4), (100, 1, 1))
    T[:, 0, 3] = 10.0 * times
    T[:, :3, :3] = Rotation.from_euler("z", times[:, None]).as_matrix()
    write_tum(tmp_path / "poses.tum", T, times)
    stamps = np.array([0.0, 0.104, 0.207, 0.303])
    poses = read_poses(tmp_path / "poses.tum", 4, stamps)
    np.testing.assert_allclose(poses[:, 0, 3], 10.0 * stamps, atol=1e-9)
    np.testing.assert_allclose(Rotation.from_matrix(poses[:, :3, :3]).as_euler("xyz")[:, 2], stamps, atol=1e-9)


def test_one_pose_per_scan_on_another_clock_is_taken_in_order_and_said(tmp_path, caplog):
    write_tum(tmp_path / "poses.tum", drive(), np.arange(6) + 5000.0)
    with caplog.at_level(logging.WARNING):
        poses = read_poses(tmp_path / "poses.tum", 6, np.arange(6) * 0.1)
    np.testing.assert_allclose(poses, drive(), atol=1e-10)
    assert "another clock" in caplog.text


def test_numbers_as_names_pick_the_lines_of_a_part_of_a_drive(tmp_path):
    write_kitti(tmp_path / "poses.txt", drive())
    poses = read_poses(tmp_path / "poses.txt", 2, names=["000002", "000004"])
    np.testing.assert_allclose(poses[1], inverse(drive()[2]) @ drive()[4], atol=1e-10)


def test_rotations_rounded_to_three_digits_are_made_orthonormal(tmp_path):
    np.savetxt(tmp_path / "poses.txt", drive()[:, :3].reshape(-1, 12), fmt="%.3f")
    R = read_poses(tmp_path / "poses.txt", 6)[:, :3, :3]
    np.testing.assert_allclose(np.swapaxes(R, 1, 2) @ R, np.tile(np.eye(3), (6, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(R, drive()[:, :3, :3], atol=2e-3)


IDENTITY = "1 0 0 0 0 1 0 0 0 0 1 0\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no poses"),
        ("1 2 3\n", "3 numbers a line"),
        (IDENTITY + "1 0 0\n", "line 2: 3 numbers, but the lines before have 12"),
        (IDENTITY + "1 0 0 0 0 1 0 0 0 0 one 0\n", "line 2: could not convert string to float: 'one'"),
        (IDENTITY + "2 0 0 0 0 2 0 0 0 0 2 0\n", "line 2: not a rigid transform"),
        (IDENTITY + "1 0 0 0 0 1 0 0 0 0 -1 0\n", "line 2: not a rigid transform"),
        (IDENTITY + "1 0 0 nan 0 1 0 0 0 0 1 0\n", "line 2: not a rigid transform"),
        (IDENTITY + "nan 0 0 0 0 1 0 0 0 0 1 0\n", "line 2: not a rigid transform"),
        (IDENTITY + "1e200 0 0 0 0 1 0 0 0 0 1 0\n", "line 2: not a rigid transform"),
        (IDENTITY.strip() + " 0 0 0 2\n", "line 1: not a rigid transform"),
        (IDENTITY, "holds 1 poses for 2 scans"),
        (IDENTITY * 3, "holds 3 poses for 2 scans"),
        ("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 0\n", "line 2: not a rigid transform"),
        ("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "not after the one before"),
        ("0 0 0 0 0 0 0 1\n", "holds 1 poses for 2 scans"),
        ("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n", "holds 3 poses for 2 scans without time stamps"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_a_bad_pose_file_is_told_in_one_sentence(tmp_path, text, message):
    path = tmp_path / "poses.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as error:
        read_poses(path, 2)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_scan_without_a_pose_near_its_stamp_is_named(tmp_path):
    write_tum(tmp_path / "poses.tum", np.tile(np.eye(4), (5, 1, 1)), [0.0, 0.1, 0.2, 0.7, 0.8])
    with pytest.raises(InputError, match=r"no pose for scan 3 \(time 0\.300000\), the nearest is 0\.100 s away"):
        read_poses(tmp_path / "poses.tum", 4, [0.0, 0.1, 0.2, 0.3])


def test_a_missing_file_and_a_folder_are_told(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_poses(tmp_path / "poses.txt", 1)
    with pytest.raises(InputError, match="is a folder"):
        read_poses(tmp_path, 1)


@pytest.mark.parametrize("line", ["Tr: {}", "Tr_velo_cam {}", "Tr_velo_to_cam: {}"])
def test_the_calibration_is_the_line_tr(tmp_path, line):
    numbers = " ".join(f"{v:.6f}" for v in T_CAMERA_SENSOR[:3].ravel())
    (tmp_path / "calib.txt").write_text("P0: " + "1 " * 12 + "\n\n" + line.format(numbers) + "\n")
    np.testing.assert_allclose(read_calib(tmp_path / "calib.txt"), T_CAMERA_SENSOR, atol=1e-12)


@pytest.mark.parametrize(("text", "message"), [("P0: 1 0\n", "no line 'Tr:'"), ("Tr: 1 0 0\n", "line 1: Tr has 3")])
def test_a_bad_calibration_is_told(tmp_path, text, message):
    (tmp_path / "calib.txt").write_text(text)
    with pytest.raises(InputError, match=message):
        read_calib(tmp_path / "calib.txt")


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "poses.txt"
    path.write_text("old")

    def disk_full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", disk_full)
    with pytest.raises(InputError, match="No space left"):
        write_kitti(path, drive())
    assert [p.name for p in tmp_path.iterdir()] == ["poses.txt"]
    assert path.read_text() == "old"


@pytest.mark.recordings
def test_the_poses_of_a_real_drive_move_forward_and_come_back_for_the_camera(recordings, tmp_path):
    folder = recordings / "sequences" / "kitti_0027"
    T_camera_sensor = read_calib(folder / "calib.txt")
    poses = read_poses(folder / "poses.txt", 100, T_camera_sensor=T_camera_sensor)
    steps = (inverse(poses[:-1]) @ poses[1:])[:, :3, 3]
    # The sensor looks along +x; this drive goes 11 to 22 m/s at 10 Hz. In the camera frame the motion would be along z.
    assert (steps[:, 0] > 0.9).all()
    assert (steps[:, 0] < 2.5).all()
    assert (np.abs(steps[:, 1:]) < 0.3).all()
    write_kitti(tmp_path / "poses.txt", T_camera_sensor @ poses @ inverse(T_camera_sensor))
    written, original = np.loadtxt(tmp_path / "poses.txt"), np.loadtxt(folder / "poses.txt")
    np.testing.assert_allclose(written, original, atol=1e-6)
