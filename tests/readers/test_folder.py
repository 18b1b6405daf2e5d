"""Recordings in folders, plain and in KITTI's layout, and the files beside the scans."""

import pickle

import numpy as np
import pytest
from forks import peak_memory

from automos.core.errors import InputError
from automos.core.geometry import make_transform
from automos.core.pose_writers import write_kitti, write_tum
from automos.readers import open_recordings, open_sequence
from automos.readers.folder import FolderSequence

T_CAMERA_SENSOR = make_transform([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.0, -0.1, -0.3])


@pytest.fixture
def kitti(tmp_path):
    """Return a drive of four scans in KITTI's layout; the third holds no points."""
    root = tmp_path / "sequences" / "03"
    (root / "velodyne").mkdir(parents=True)
    (root / "labels").mkdir()
    for i, n_points in enumerate([5, 6, 0, 7]):
        (np.arange(4 * n_points, dtype=np.float32) + 100 * i).tofile(root / "velodyne" / f"{i:06d}.bin")
        np.full(n_points, 251 + (i << 16), np.uint32).tofile(root / "labels" / f"{i:06d}.label")
    poses = np.stack([make_transform(t=[i, 0.5 * i, 0]) for i in range(4)])
    write_kitti(root / "poses.txt", T_CAMERA_SENSOR @ poses @ np.linalg.inv(T_CAMERA_SENSOR))
    numbers = " ".join(f"{v:.9e}" for v in T_CAMERA_SENSOR[:3].ravel())
    (root / "calib.txt").write_text(f"P0: {numbers}\nTr: {numbers}\n")
    (root / "times.txt").write_text("0.0\n0.1\n0.21\n0.3\n")
    return root


def test_a_kitti_drive_has_scans_stamps_poses_and_labels(kitti):
    sequence = open_sequence(kitti)
    assert (sequence.name, len(sequence), sequence.source) == ("03", 4, kitti)
    assert sequence.names == ["000000", "000001", "000002", "000003"]
    assert [len(scan) for scan in sequence] == [5, 6, 0, 7]
    np.testing.assert_array_equal(sequence[1].points[1], [104, 105, 106])
    np.testing.assert_array_equal(sequence[1].intensity[:2], [103, 107])
    np.testing.assert_array_equal(sequence.stamps, [0.0, 0.1, 0.21, 0.3])
    assert (sequence[1].stamp, sequence[1].name) == (0.1, "000001")
    np.testing.assert_allclose(sequence.reference_poses[:, :3, 3], [[i, 0.5 * i, 0] for i in range(4)], atol=1e-9)
    np.testing.assert_allclose(sequence.T_camera_sensor, T_CAMERA_SENSOR, atol=1e-9)
    np.testing.assert_array_equal(sequence.truth(3), np.full(7, 251 + (3 << 16)))
    assert sequence.truth(2).shape == (0,)
    assert sequence.is_compensated is None


def test_the_last_scan_is_the_minus_first_and_there_is_none_after_it(kitti):
    sequence = open_sequence(kitti)
    assert sequence[-1].name == "000003"
    with pytest.raises(IndexError):
        sequence[4]


def test_poses_without_calibration_are_those_of_the_sensor(kitti):
    (kitti / "calib.txt").unlink()
    poses = np.stack([make_transform(t=[i, 0.5 * i, 0]) for i in range(4)])
    write_kitti(kitti / "poses.txt", poses)
    sequence = open_sequence(kitti)
    assert sequence.T_camera_sensor is None
    np.testing.assert_allclose(sequence.reference_poses, poses, atol=1e-9)


def test_poses_of_the_odometry_benchmark_lie_in_the_root(kitti):
    (kitti.parents[1] / "poses").mkdir()
    (kitti / "poses.txt").rename(kitti.parents[1] / "poses" / "03.txt")
    np.testing.assert_allclose(open_sequence(kitti).reference_poses[3, :3, 3], [3, 1.5, 0], atol=1e-9)


def test_a_drive_of_scans_alone_has_nothing_else(kitti):
    for name in ("poses.txt", "calib.txt", "times.txt"):
        (kitti / name).unlink()
    for path in (kitti / "labels").iterdir():
        path.unlink()
    sequence = open_sequence(kitti)
    assert sequence.stamps is None
    assert sequence.reference_poses is None
    assert sequence.truth(0) is None
    assert sequence[0].stamp is None


def test_a_part_of_a_drive_keeps_its_own_times_and_poses(kitti):
    (kitti / "velodyne" / "000000.bin").unlink()
    (kitti / "velodyne" / "000002.bin").unlink()
    sequence = open_sequence(kitti)
    np.testing.assert_array_equal(sequence.stamps, [0.1, 0.3])
    np.testing.assert_allclose(sequence.reference_poses[:, :3, 3], [[0, 0, 0], [2, 1, 0]], atol=1e-9)
    assert len(sequence.truth(1)) == 7


def test_times_may_lie_in_timestamps_txt(kitti):
    (kitti / "times.txt").rename(kitti / "timestamps.txt")
    np.testing.assert_array_equal(open_sequence(kitti).stamps, [0.0, 0.1, 0.21, 0.3])
    assert open_sequence(kitti).about["times"] == "timestamps.txt"
    (kitti / "times.txt").write_text("0\n1\n2\n3\n")
    np.testing.assert_array_equal(open_sequence(kitti).stamps, [0, 1, 2, 3])


def test_a_plain_folder_may_have_times_tum_poses_and_labels_too(tmp_path, write_points, columns):
    for name in ("a1.pcd", "a2.pcd", "a10.pcd"):
        write_points(tmp_path / name, columns)
    (tmp_path / "times.txt").write_text("5\n6\n7\n")
    write_tum(tmp_path / "poses.txt", np.stack([make_transform(t=[i, 0, 0]) for i in range(3)]), [5, 6, 7])
    (tmp_path / "labels").mkdir()
    for name in ("a1", "a2", "a10"):
        np.full(500, 9, np.uint32).tofile(tmp_path / "labels" / f"{name}.label")
    sequence = open_sequence(tmp_path)
    assert sequence.names == ["a1", "a2", "a10"]
    np.testing.assert_allclose(sequence.reference_poses[:, 0, 3], [0, 1, 2])
    assert len(sequence.truth(2)) == 500
    assert sequence[2].stamp == 7.0


def test_stamps_come_from_the_names_where_there_is_no_times_file(tmp_path, write_points, columns):
    for stamp in (1561000444390857630, 1561000444490857630):
        write_points(tmp_path / f"{stamp}.ply", columns)
    np.testing.assert_allclose(open_sequence(tmp_path).stamps, [1561000444.390857630, 1561000444.490857630], atol=1e-6)


def test_one_unit_of_time_holds_for_the_whole_recording(tmp_path, write_points, columns):
    # Nanoseconds: the full scan tells; in the scan of three points, 60 us apart, they could be microseconds.
    write_points(tmp_path / "0.pcd", {**columns, "t": np.linspace(0, 1e8, 500).astype(np.uint32)})
    few = {name: column[:3] for name, column in columns.items()}
    write_points(tmp_path / "1.pcd", {**few, "t": np.array([0, 30_000, 60_000], np.uint32)})
    sequence = open_sequence(tmp_path)
    np.testing.assert_allclose(sequence[1].time, [0.0, 3e-5, 6e-5], rtol=1e-6)
    np.testing.assert_allclose(sequence[0].time[-1], 0.1, rtol=1e-6)


def test_a_sequence_holds_no_points_and_can_be_sent_to_another_process(kitti):
    sequence = open_sequence(kitti)
    pickled = pickle.dumps(sequence)
    assert len(pickled) < 4000
    copy = pickle.loads(pickled)
    np.testing.assert_array_equal(copy[3].points, sequence[3].points)
    assert copy.fingerprint() == sequence.fingerprint()


def test_the_fingerprint_changes_with_the_files_and_with_nothing_else(kitti, tmp_path):
    first = open_sequence(kitti).fingerprint()
    assert open_sequence(kitti).fingerprint() == first
    (kitti / "labels" / "000000.label").unlink()
    assert open_sequence(kitti).fingerprint() == first
    with open(kitti / "velodyne" / "000001.bin", "ab") as file:
        file.write(bytes(16))
    assert open_sequence(kitti).fingerprint() != first


# ------------------------------------------------------------------------------------- columns of .bin recordings
def test_a_bin_file_cut_short_is_told_by_name_and_size(kitti):
    path = kitti / "velodyne" / "000001.bin"
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(InputError, match=r"000001\.bin has 88 bytes, no multiple of a point"):
        open_sequence(kitti)


def test_points_without_return_are_of_four_columns_whatever_their_intensities(tmp_path):
    rows = np.zeros((40, 4), np.float32)
    rows[:, 3] = np.arange(40)
    (tmp_path / "log").mkdir()
    rows.tofile(tmp_path / "log" / "0.bin")
    assert len(open_sequence(tmp_path / "log")[0]) == 40
    (tmp_path / "zeros").mkdir()
    np.zeros((8000, 4), np.float32).tofile(tmp_path / "zeros" / "0.bin")
    assert len(open_sequence(tmp_path / "zeros")[0]) == 8000


def test_a_bin_file_that_does_not_fit_the_named_codec_is_told(kitti):
    sequence = open_sequence(kitti, "bin5")
    assert len(sequence[0]) == 4  # 80 bytes
    with pytest.raises(InputError, match=r"000001\.bin has 96 bytes, no multiple of a point \(20 bytes\)"):
        sequence[1]


# --------------------------------------------------------------------------------------------------- bad input
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0\n0.1\n0.2\n", "holds 3 times for 4 scans"),
        ("0\n0.1\nnan\n0.2\n", "line 3: the time is not a number"),
        ("0\n0.1\nnoon\n0.2\n", "must hold one time in seconds a line"),
        ("0 0\n0.1\n0.2 2\n0.3 3\n", "must hold one time in seconds a line"),
    ],
)
def test_a_bad_times_file_is_told(kitti, text, message):
    (kitti / "times.txt").write_text(text)
    with pytest.raises(InputError, match=message):
        open_sequence(kitti)


def test_bad_poses_are_told_when_they_are_asked_for_and_not_before(kitti):
    (kitti / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n")
    sequence = open_sequence(kitti)
    with pytest.raises(InputError, match="holds 1 poses for 4 scans"):
        _ = sequence.reference_poses


def test_labels_of_another_length_are_told(kitti):
    np.zeros(3, np.uint32).tofile(kitti / "labels" / "000001.label")
    with pytest.raises(InputError, match=r"000001\.label holds 3 labels, but its scan has 6 points"):
        open_sequence(kitti).truth(1)
    (kitti / "labels" / "000001.label").write_bytes(bytes(23))
    with pytest.raises(InputError, match="23 bytes, no multiple of a label"):
        open_sequence(kitti).truth(1)


def test_labels_are_paired_by_name_so_a_missing_one_does_not_shift_the_others(kitti):
    (kitti / "labels" / "000001.label").unlink()
    sequence = open_sequence(kitti)
    np.testing.assert_array_equal(sequence.truth(3) >> 16, np.full(7, 3))
    with pytest.raises(InputError, match=r"000001\.label is missing"):
        sequence.truth(1)


def test_a_scan_cut_short_in_the_middle_is_told_when_it_is_read(tmp_path, write_points, columns):
    for i in range(3):
        write_points(tmp_path / f"{i}.pcd", columns)
    path = tmp_path / "1.pcd"
    path.write_bytes(path.read_bytes()[:-100])
    sequence = FolderSequence(tmp_path)
    assert len(sequence[0]) == len(sequence[2]) == 500
    with pytest.raises(InputError, match=r"1\.pcd is cut short"):
        sequence[1]


def test_bytes_behind_the_points_are_counted_in_a_warning(tmp_path, write_points, columns):
    for i, encoding in enumerate(("binary", "binary", "binary")):
        write_points(tmp_path / f"{i}.pcd", columns, encoding=encoding)
    for i in (1, 2):
        (tmp_path / f"{i}.pcd").write_bytes((tmp_path / f"{i}.pcd").read_bytes() + bytes(range(77)))
    sequence = open_sequence(tmp_path)
    assert "2 files hold bytes behind their points, which are not read (first: 1.pcd, 77 bytes)." in sequence.warnings
    np.testing.assert_array_equal(sequence[1].points, sequence[0].points)


# ------------------------------------------------------------------------------------------------- real recordings
@pytest.mark.recordings
def test_real_drives_are_read_whole(recordings):
    drives = open_recordings(recordings)
    lengths = {drive.name: len(drive) for drive in drives}
    assert lengths["kitti_0005"] == 154
    assert lengths["kitti_0027"] == 100
    drive = next(drive for drive in drives if drive.name == "kitti_0005")
    assert [len(drive.truth(i)) for i in (0, 153)] == [len(drive[0]), len(drive[153])]
    ranges = np.linalg.norm(drive[0].points, axis=1)
    assert 60 < ranges.max() < 130
    assert 0 <= drive[0].intensity.min() < drive[0].intensity.max() <= 1
    assert np.diff(drive.stamps).min() > 0.05


@pytest.mark.recordings
def test_reading_a_real_scan_makes_few_copies_of_it(recordings):
    drive = open_sequence(recordings / "sequences" / "kitti_0005")
    drive[0]  # what is read once for the whole drive
    peak = peak_memory(lambda: drive[1])
    n_points = len(drive[1])
    assert n_points > 100_000
    assert peak < 3 * 16 * n_points  # x, y, z and intensity in 4 bytes each


# ------------------------------------------------------------------------------------------- order and time of scans
def renumbered(folder, write_points, columns, unit=1.0, origin=1.6e9):
    """Write twelve scans, 10 Hz, numbered by the alphabetical order of their names; each point says whose it is."""
    alphabetical = sorted(range(12), key=str)  # 0, 1, 10, 11, 2, ...
    for new, old in enumerate(alphabetical):
        times = (origin + 0.1 * old + np.linspace(0.0, 0.099, 500)) / unit
        x = np.full(500, old, np.float32)
        write_points(folder / f"{new}.pcd", {**columns, "x": x, "t": times.astype("f8")})
    return alphabetical


@pytest.mark.parametrize(("unit", "origin"), [(1.0, 1.6e9), (1e-6, 1.6e9), (1e-3, 4000.0)])
def test_scans_are_in_the_order_of_their_points_times(tmp_path, write_points, columns, unit, origin):
    alphabetical = renumbered(tmp_path, write_points, columns, unit, origin)
    sequence = open_sequence(tmp_path)
    assert [int(scan.points[0, 0]) for scan in sequence] == list(range(12))
    np.testing.assert_allclose(np.diff(sequence.stamps), 0.1, atol=2e-3)
    assert sequence.names == [str(alphabetical.index(i)) for i in range(12)]
    (warning,) = sequence.warnings
    assert "scan 4 is 0.90 s before the one that comes ahead of it, 3" in warning
    assert "10 were put in their place" in warning


def test_poses_and_labels_go_with_the_scans_they_were_written_for(tmp_path, write_points, columns):
    alphabetical = renumbered(tmp_path, write_points, columns)
    write_kitti(tmp_path / "poses.txt", np.stack([make_transform(t=[old, 0, 0]) for old in alphabetical]))
    (tmp_path / "labels").mkdir()
    for new, old in enumerate(alphabetical):
        np.full(500, old, np.uint32).tofile(tmp_path / "labels" / f"{new}.label")
    sequence = open_sequence(tmp_path)
    np.testing.assert_allclose(sequence.reference_poses[:, 0, 3], range(12), atol=1e-6)
    assert [int(sequence.truth(i)[0]) for i in range(12)] == list(range(12))


def test_times_after_the_first_point_give_no_stamps(tmp_path, write_points, columns):
    for i in range(3):
        write_points(tmp_path / f"{i}.pcd", {**columns, "t": np.linspace(0, 0.1, 500).astype("f4")})
    assert open_sequence(tmp_path).stamps is None
    assert open_sequence(tmp_path).warnings == []


def test_times_that_repeat_or_are_out_of_order_are_told(kitti):
    (kitti / "times.txt").write_text("0\n0.1\n0.1\n0.2\n")
    sequence = open_sequence(kitti)
    assert (np.diff(sequence.stamps) > 0).all()
    assert "scans have the time of the one before them (first: 000002)" in sequence.warnings[0]
    (kitti / "times.txt").write_text("0\n0.2\n0.1\n0.3\n")
    sequence = open_sequence(kitti)
    assert sequence.names == ["000000", "000002", "000001", "000003"]
    np.testing.assert_allclose(sequence.reference_poses[:, 0, 3], [0, 2, 1, 3], atol=1e-9)


def test_files_that_are_there_twice_are_recognised(kitti):
    (kitti / "velodyne" / "000001.bin").write_bytes((kitti / "velodyne" / "000000.bin").read_bytes())
    np.testing.assert_array_equal(open_sequence(kitti).repeats, [False, True, False, False])
    assert open_sequence(kitti).warnings == []  # told with what odometry makes of it


def test_a_copy_of_an_earlier_scan_is_told(kitti):
    (kitti / "velodyne" / "000003.bin").write_bytes((kitti / "velodyne" / "000000.bin").read_bytes())
    sequence = open_sequence(kitti)
    assert not sequence.repeats.any()
    assert sequence.warnings == [
        "1 scans are earlier ones once more (first: 000003 is 000000): remove the copies.",
    ]


def test_scans_in_a_folder_among_scans_are_told_to_be_left_out(kitti):
    folder = kitti / "velodyne"
    for name in ("more", "notes"):
        (folder / name).mkdir()
    (folder / "notes" / "a.txt").write_text("rain")
    assert open_sequence(folder).warnings == []
    (folder / "more" / "000000.bin").write_bytes(bytes(16))
    assert open_sequence(folder).warnings == [
        f"Folders in {folder} hold scans, too (more): they are left out, give their own paths.",
    ]


def test_scans_and_recordings_beside_the_folder_of_scans_are_told_to_be_left_out(kitti):
    for place in ("inner/velodyne", "sequences/00/velodyne", "thinned", "photos"):
        (kitti / place).mkdir(parents=True)
    (kitti / "photos" / "0.png").write_bytes(b"x")
    assert open_sequence(kitti).warnings == []
    for place in ("inner/velodyne", "sequences/00/velodyne", "thinned"):
        (kitti / place / "000000.bin").write_bytes(bytes(16))
    assert open_sequence(kitti).warnings == [
        f"Folders in {kitti} hold scans, too (inner, sequences, thinned): they are left out, give their own paths.",
    ]


@pytest.mark.parametrize(
    ("times", "why"),
    [
        (np.zeros(500), "all the same or NaN"),
        (np.full(500, np.nan), "all the same or NaN"),
        (np.linspace(0.1, 0.0, 500), "run backwards within a beam"),
    ],
)
def test_times_of_points_that_cannot_be_are_not_used_and_that_is_said_once(tmp_path, write_points, columns, times, why):
    for i in range(3):
        write_points(tmp_path / f"{i}.pcd", {**columns, "t": times.astype("f4")})
    sequence = open_sequence(tmp_path)
    assert sequence[1].time is None
    (warning,) = sequence.warnings
    assert why in warning


@pytest.mark.parametrize("turn", [0.2, 2e-4])
def test_times_of_points_that_do_not_fit_the_gap_to_the_next_scan_are_not_used(tmp_path, write_points, columns, turn):
    for i in range(4):
        write_points(tmp_path / f"{i}.pcd", {**columns, "t": np.linspace(0.0, turn, 500).astype("f4")})
    (tmp_path / "times.txt").write_text("0.0\n0.1\n0.2\n0.3\n")
    sequence = open_sequence(tmp_path)
    assert sequence[1].time is None
    (warning,) = sequence.warnings
    assert "but a scan comes every 0.1 s; they are not used" in warning


@pytest.mark.parametrize("time", ["1e23", "nan", "-inf"])
def test_a_time_that_no_clock_shows_is_told_with_its_line(tmp_path, time):
    for i in range(3):
        np.ones((5, 4), np.float32).tofile(tmp_path / f"{i}.bin")
    (tmp_path / "times.txt").write_text(f"0.0\n{time}\n0.2\n")
    with pytest.raises(InputError, match=r"times\.txt, line 2: the time is not a number of seconds"):
        open_sequence(tmp_path)


@pytest.mark.parametrize("n_points", [0, 1])
@pytest.mark.parametrize("without", [(5,), (0, 11)], ids=["middle", "ends"])
def test_scans_of_no_or_one_point_do_not_take_the_clock_from_all(tmp_path, write_points, columns, n_points, without):
    for i in range(12):
        n = n_points if i in without else 500
        times = 1.6e9 + 0.1 * i + np.linspace(0.0, 0.099, 500)
        write_points(tmp_path / f"{i}.pcd", {**{k: v[:n] for k, v in columns.items()}, "t": times[:n].astype("f8")})
    sequence = open_sequence(tmp_path)
    np.testing.assert_allclose(sequence.stamps, 1.6e9 + 0.1 * np.arange(12), atol=1e-3)
    assert sequence.warnings == []


def test_poses_with_times_go_with_their_scans_though_the_names_are_in_no_order(tmp_path):
    for i in range(6):
        np.full((5, 4), i, np.float32).tofile(tmp_path / f"{i}.bin")
    times = 0.1 * np.arange(6)[::-1]  # the last scan has the first name
    (tmp_path / "times.txt").write_text("".join(f"{t:.3f}\n" for t in times))
    write_tum(
        tmp_path / "poses.txt", np.stack([make_transform(t=[10.0 * t, 0.0, 0.0]) for t in times[::-1]]), times[::-1]
    )
    sequence = open_sequence(tmp_path)
    assert sequence.names == list("543210")
    np.testing.assert_allclose(sequence.reference_poses[:, 0, 3], range(6), atol=1e-6)


def test_times_and_poses_may_begin_with_the_mark_of_windows_editors(kitti):
    expected = open_sequence(kitti)
    for name in ("times.txt", "poses.txt", "calib.txt"):
        (kitti / name).write_bytes(b"\xef\xbb\xbf" + (kitti / name).read_bytes().replace(b"\n", b"\r\n"))
    sequence = open_sequence(kitti)
    np.testing.assert_array_equal(sequence.stamps, expected.stamps)
    np.testing.assert_array_equal(sequence.reference_poses, expected.reference_poses)


@pytest.mark.parametrize("suffix", ["pcd", "ply", "npy"])
def test_scans_without_points_are_no_copies_of_each_other(tmp_path, write_points, columns, suffix):
    for i, n in enumerate((500, 0, 0, 400, 0)):
        write_points(tmp_path / f"{i}.{suffix}", {name: column[:n] for name, column in columns.items()})
    sequence = open_sequence(tmp_path)
    assert not sequence.repeats.any()
    assert sequence.warnings == []


def test_a_scan_that_went_away_since_is_one_sentence(kitti):
    sequence = open_sequence(kitti)
    (kitti / "velodyne" / "000001.bin").unlink()
    for ask in (sequence.fingerprint, lambda: sequence.warnings, lambda: sequence[1]):
        with pytest.raises(InputError, match=r"velodyne/000001\.bin cannot be read: No such file or directory"):
            ask()


def test_times_txt_is_used_where_most_scans_have_no_points_with_times(tmp_path, write_points, columns):
    for i in range(8):
        n = 500 if i in (0, 7) else 1
        times = 1.6e9 + 0.1 * i + np.linspace(0.0, 0.099, 500)
        write_points(tmp_path / f"{i}.pcd", {**{k: v[:n] for k, v in columns.items()}, "t": times[:n].astype("f8")})
    (tmp_path / "times.txt").write_text("".join(f"{0.1 * i:.3f}\n" for i in range(8)))
    np.testing.assert_allclose(open_sequence(tmp_path).stamps, 0.1 * np.arange(8))
