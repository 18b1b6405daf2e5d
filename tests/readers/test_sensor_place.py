"""Clouds in the frame of a map are told by their points, and taken back where poses came with them."""

import numpy as np
import pytest
from point_writers import write_pcd
from scipy.spatial.transform import Rotation
from scipy.stats import rankdata
from sweeps import moved, points_of, pose, sweep

from automos.core.errors import InputError
from automos.core.pose_writers import write_kitti, write_tum
from automos.readers import open_sequence
from automos.readers.sensor_place import Spacing, find_frame, ranks

N = 6
DRIVE = [pose(4.0 * i, 2.5 * i, 0.2 * i) for i in range(N)]
"""Poses of a sensor that drives 12 m, in the frame where it began."""
FRAMES = {
    "far": pose(100.0, -140.2, 220.7, -3.1),
    "near": pose(-56.0, -15.65, 17.98, -0.93),
    "start": np.eye(4),
    "in a country's grid": pose(33.0, 352_871.4, 5_621_004.9, 71.3),
}


@pytest.fixture(scope="module")
def scans():
    return [sweep(T, seed=i) for i, T in enumerate(DRIVE)]


def viewpoint(T, w_last=False):
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
    return " ".join(f"{v:.17g}" for v in (*T[:3, 3], *((x, y, z, w) if w_last else (w, x, y, z))))


def write(folder, clouds, viewpoints=None, kind=np.float64, w_last=False):
    for i, columns in enumerate(clouds):
        numbers = {name: column.astype(kind if name in "xyz" else np.float32) for name, column in columns.items()}
        del numbers["time"], numbers["ring"]
        T = np.eye(4) if viewpoints is None else viewpoints[i]
        write_pcd(folder / f"{i}.pcd", numbers, viewpoint=viewpoint(T, w_last))
    return folder


def assert_taken_back(sequence, scans, T_map_sensor):
    for scan, columns in zip(sequence, scans, strict=True):
        np.testing.assert_allclose(scan.points, points_of(columns), atol=2e-3)
    relative = np.linalg.inv(T_map_sensor[0]) @ T_map_sensor
    np.testing.assert_allclose(sequence.reference_poses, relative, atol=1e-4)
    assert any("taken" in words or "took them back" in words for words in sequence.warnings)


@pytest.mark.parametrize("where", FRAMES)
def test_viewpoints_take_clouds_of_a_map_back_to_the_sensor(tmp_path, scans, where):
    T = FRAMES[where] @ np.array(DRIVE)
    sequence = open_sequence(write(tmp_path, [moved(*both) for both in zip(scans, T, strict=True)], T))
    assert_taken_back(sequence, scans, T)
    assert sequence.about["frame"].startswith("a map's")


@pytest.mark.parametrize("where", FRAMES)
@pytest.mark.parametrize("tilt", [0.0, 0.03])
def test_quaternions_whose_w_is_last_are_read_so_and_it_is_said(tmp_path, scans, where, tilt):
    tilted = np.eye(4)
    tilted[:3, :3] = Rotation.from_euler("xy", [tilt, -0.5 * tilt]).as_matrix()
    T = FRAMES[where] @ np.array(DRIVE) @ tilted
    if where == "start":
        T[0] = np.eye(4)
    clouds = [moved(*both) for both in zip(scans, T, strict=True)]
    sequence = open_sequence(write(tmp_path, clouds, T, w_last=True))
    assert_taken_back(sequence, scans, T)
    assert any("VIEWPOINT has its quaternions as x y z w" in words for words in sequence.warnings)


def test_the_identity_whose_w_is_last_turns_no_point_by_half_a_turn(tmp_path, scans):
    sequence = open_sequence(write(tmp_path, scans, w_last=True))
    np.testing.assert_allclose(sequence[3].points, points_of(scans[3]), atol=1e-6)
    assert sequence.reference_poses is None
    assert [words for words in sequence.warnings if "VIEWPOINT" in words]


def test_a_sensor_that_heads_back_is_not_taken_for_one_whose_w_is_last(tmp_path, scans):
    T = pose(180.0) @ np.array(DRIVE)
    T[:, :3, 3] += [3.0, 2.0, 0.0]
    sequence = open_sequence(write(tmp_path, [moved(*both) for both in zip(scans, T, strict=True)], T))
    assert_taken_back(sequence, scans, T)
    assert not [words for words in sequence.warnings if "VIEWPOINT" in words]


@pytest.mark.parametrize("where", ["far", "near", "in a country's grid"])
def test_viewpoints_beside_clouds_of_the_sensor_are_its_poses_and_move_no_point(tmp_path, scans, where):
    T = FRAMES[where] @ np.array(DRIVE)
    sequence = open_sequence(write(tmp_path, scans, T))
    np.testing.assert_allclose(sequence[3].points, points_of(scans[3]), atol=1e-6)
    np.testing.assert_allclose(sequence.reference_poses, np.linalg.inv(T[0]) @ T, atol=1e-5)


@pytest.mark.parametrize("is_tum", [False, True])
@pytest.mark.parametrize("where", ["far", "near", "start"])
def test_a_file_of_poses_takes_clouds_of_a_map_back_to_the_sensor(tmp_path, scans, where, is_tum):
    T = FRAMES[where] @ np.array(DRIVE)
    write(tmp_path, [moved(*both) for both in zip(scans, T, strict=True)])
    if is_tum:
        write_tum(tmp_path / "poses.txt", T, np.arange(N) * 0.1)
    else:
        write_kitti(tmp_path / "poses.txt", T)
    assert_taken_back(open_sequence(tmp_path), scans, T)


def test_poses_beside_clouds_of_the_sensor_move_no_point(tmp_path, scans):
    write_kitti(write(tmp_path, scans) / "poses.txt", FRAMES["near"] @ np.array(DRIVE))
    sequence = open_sequence(tmp_path)
    np.testing.assert_allclose(sequence[3].points, points_of(scans[3]), atol=1e-6)
    assert sequence.about["frame"] == "the sensor's own"


def test_a_map_that_begins_where_a_short_drive_does_is_told(tmp_path):
    short = [pose(2.0 * i, 1.5 * i) for i in range(N)]
    with pytest.raises(InputError, match="in the frame of a map"):
        open_sequence(write(tmp_path, [moved(sweep(T, seed=i), T) for i, T in enumerate(short)]))


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize("where", ["far", "near", "start"])
def test_clouds_of_a_map_without_poses_are_refused_with_where_the_sensor_seems_to_be(tmp_path, scans, where, kind):
    T = FRAMES[where] @ np.array([pose(4.0 * i, 5.0 * i, 0.2 * i) for i in range(N)])
    clouds = [sweep(pose(4.0 * i, 5.0 * i, 0.2 * i), seed=i) for i in range(N)]
    write(tmp_path, [moved(*both) for both in zip(clouds, T, strict=True)], kind=kind)
    with pytest.raises(
        InputError, match=r"frame of a map \(world frame\).*about \((-?\d+), (-?\d+)\).*poses\.txt"
    ) as told:
        open_sequence(tmp_path)
    x, y = (float(word) for word in str(told.value).split("about (")[1].split(")")[0].split(","))
    assert np.linalg.norm(T[:, :2, 3] - [x, y], axis=1).min() < 5.0


@pytest.mark.parametrize("n_before", [2, N])
@pytest.mark.parametrize("where", ["far", "start"])
def test_clouds_that_hold_those_before_them_are_no_scans(tmp_path, scans, where, n_before):
    T = FRAMES[where] @ np.array(DRIVE)
    in_map = [moved(*both) for both in zip(scans, T, strict=True)]
    together = [
        {name: np.concatenate([one[name] for one in in_map[max(i - n_before, 0) : i + 1]]) for name in in_map[0]}
        for i in range(N)
    ]
    write_kitti(write(tmp_path, together) / "poses.txt", T)  # which take back no such cloud
    with pytest.raises(
        InputError, match=r"points of those before them, a map that grows .*give its scans as they were"
    ):
        open_sequence(tmp_path)


def test_poses_that_cannot_be_used_are_named_where_clouds_are_refused(tmp_path, scans):
    T = FRAMES["far"] @ np.array(DRIVE)
    write_kitti(write(tmp_path, [moved(*both) for both in zip(scans, T, strict=True)]) / "poses.txt", T[:-1])
    with pytest.raises(InputError, match=r"frame of a map .*\(.*poses.txt holds 5 poses for 6 scans"):
        open_sequence(tmp_path)


def test_the_place_found_is_that_of_the_sensor(scans):
    T = FRAMES["near"]
    spacing = Spacing(points_of(moved(scans[0], T)))
    assert np.linalg.norm(spacing.find()[:2] - T[:2, 3]) < 2.0
    assert spacing.fit(T[:3, 3]) > 0.7 > spacing.fit(np.zeros(3)) + 0.25


def test_points_on_a_grid_and_few_points_show_nothing(tmp_path, scans):
    clouds = [np.unique(np.floor(points_of(one) / 0.5), axis=0) * 0.5 for one in scans]
    assert find_frame(lambda i: clouds[i].astype(float), N, [], False, tmp_path) is None
    assert find_frame(lambda i: points_of(scans[i])[:300] + 50.0, N, [], False, tmp_path) is None
    assert find_frame(lambda i: np.full((5000, 3), np.nan), N, [], False, tmp_path) is None


@pytest.mark.parametrize("is_mount", [True, False])
def test_of_a_viewpoint_near_the_origin_beams_say_whether_it_moved_the_points(tmp_path, scans, is_mount):
    T = np.array([pose(10.0, 0.5, 0.1, 1.7)] * N)
    write(tmp_path, scans if is_mount else [moved(*both) for both in zip(scans, T, strict=True)], T)
    np.testing.assert_allclose(open_sequence(tmp_path)[3].points, points_of(scans[3]), atol=1e-5)


def test_a_viewpoint_that_is_no_number_is_none(tmp_path, scans):
    for i, columns in enumerate(scans):
        write_pcd(tmp_path / f"{i}.pcd", columns, viewpoint="nan nan nan 1 0 0 0")
    np.testing.assert_array_equal(open_sequence(tmp_path)[0].points, points_of(scans[0]))


@pytest.mark.recordings
@pytest.mark.parametrize("name", ["kitti_0005", "kitti_0027", "lyft_5hz", "room_vlp16", "yard_avia", "handheld_xt32"])
def test_real_sweeps_are_in_the_frame_of_their_sensor_and_those_that_were_moved_are_not(recording_of, name):
    sequence = open_sequence(recording_of(name))
    assert sequence.about["frame"] == "the sensor's own"
    # of one that looks forward alone nothing shows how far behind its points it was
    for T in (FRAMES["far"], pose(20.0, 30.0, -25.0))[: 1 if name == "yard_avia" else 2]:
        with pytest.raises(InputError, match="frame of a map"):
            find_frame(
                lambda i, T=T: sequence[i].points[sequence[i].is_valid].astype(float) @ T[:3, :3].T + T[:3, 3],
                len(sequence),
                [],
                False,
                recording_of(name),
            )


def test_ranks_are_those_of_scipy():
    values = np.random.default_rng(0).integers(0, 20, 60).astype(float)
    np.testing.assert_array_equal(ranks(values), rankdata(values))
    assert len(ranks(np.zeros(0))) == 0
