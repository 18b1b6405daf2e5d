import numpy as np
import pytest
from kitti_packets import PROJECTION, R_RECTIFIED, T_CAMERA_SENSOR, T_SENSOR_IMU, line, packets, sees
from street_log import OBJECTS, assert_points_lie_in_their_boxes, assert_same_truth, street_log

from automos.core.errors import InputError
from automos.core.geometry import inverse
from automos.readers import open_recordings, open_sequence


def labels(log):
    """Return the benchmark's label lines: boxes in the rectified camera's frame, the middle of their underside."""
    T_rect = np.eye(4)
    T_rect[:3, :3] = R_RECTIFIED
    T_rectified_sensor = T_rect @ T_CAMERA_SENSOR
    lines = ["0 -1 DontCare -1 -1 -10 1 2 3 4 -1000 -1000 -1000 -10 -1 -1 -1"]
    for i, T_ground_sensor in enumerate(log.T_ground_sensor):
        T = T_rectified_sensor @ inverse(T_ground_sensor)
        found = log.boxes(i)
        for k in range(len(OBJECTS)):
            length, width, height = found.size[k]
            x, y, z = T[:3, :3] @ found.center[k] + T[:3, 3] + [0, height / 2, 0]
            heading = T[:3, :3] @ [np.cos(found.yaw[k]), np.sin(found.yaw[k]), 0]
            turn = np.arctan2(-heading[2], heading[0])
            lines.append(f"{i} {k} Car 0 0 -10 0 0 0 0 {height} {width} {length} {x} {y} {z} {turn}")
    return "\n".join(lines) + "\n"


def write_split(root, log, split="training", sequence="0000", with_labels=True):
    folder = root / split
    for name in (f"velodyne/{sequence}", "calib", "oxts", "label_02"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for i, scan in enumerate(log.scans):
        rows = np.column_stack([scan.points, scan.intensity]).astype(np.float32)
        rows.tofile(folder / "velodyne" / sequence / f"{i:06d}.bin")
    (folder / "calib" / f"{sequence}.txt").write_text(
        f"P2: {line(PROJECTION)}\nR_rect {line(R_RECTIFIED)}\nTr_velo_cam {line(T_CAMERA_SENSOR[:3])}\n"
        f"Tr_imu_velo {line(T_SENSOR_IMU[:3])}\n"
    )
    (folder / "oxts" / f"{sequence}.txt").write_text("".join(line(row) + "\n" for row in packets(log.T_ground_sensor)))
    if with_labels:
        (folder / "label_02" / f"{sequence}.txt").write_text(labels(log))
    return folder / "velodyne" / sequence


@pytest.fixture
def folder(tmp_path):
    return write_split(tmp_path / "tracking", street_log())


def test_a_sequence_is_found_from_its_root_split_or_folder(folder, tmp_path):
    log = street_log()
    root = tmp_path / "tracking"
    for path in (root, root / "training", folder):
        sequence = open_sequence(path)
        assert (sequence.name, len(sequence), sequence.is_compensated) == ("0000", 12, False)
    write_split(root, log, sequence="0019")
    assert [s.name for s in open_recordings(root)] == ["0000", "0019"]
    for got, true in zip(sequence, log.scans, strict=True):
        np.testing.assert_array_equal(got.points, true.points)
    np.testing.assert_allclose(sequence.stamps, 0.1 * np.arange(12))
    np.testing.assert_allclose(sequence.reference_poses, log.poses, atol=1e-5)


def test_boxes_are_truth_where_the_camera_sees(folder):
    sequence, log = open_sequence(folder), street_log()
    for i in range(12):
        seen = sees(log.scans[i].points)
        assert (sequence.truth(i)[~seen] == 0).all()
        assert_same_truth(sequence.truth(i)[seen], log.truth[i][seen])
        assert_points_lie_in_their_boxes(sequence, i)


@pytest.mark.parametrize("number", ["1e30", "-200", "nan"])
def test_a_packet_of_no_place_on_earth_is_told(folder, number):
    path = folder.parent.parent / "oxts" / "0000.txt"
    lines = path.read_text().splitlines()
    lines[2] = " ".join([number, *lines[2].split()[1:]])
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"0000.txt.* (no place on Earth|a number that is none)"):
        _ = open_sequence(folder).reference_poses


@pytest.mark.parametrize(
    ("column", "word"), [(0, "1.5"), (1, "nan"), (1, "9" * 30), (10, "-1"), (12, "nan"), (13, "1e30"), (16, "inf")]
)
def test_a_box_that_is_nowhere_is_told(folder, column, word):
    path = folder.parent.parent / "label_02" / "0000.txt"
    lines = path.read_text().splitlines()
    words = lines[1].split()
    words[column] = word
    path.write_text("\n".join([lines[0], " ".join(words), *lines[2:]]))
    with pytest.raises(InputError, match=r"label_02/0000.txt (has a box that is nowhere|is not a file of KITTI)"):
        open_sequence(folder).truth(0)


def test_scans_that_are_missing_shift_nothing_and_the_test_split_has_no_truth(folder, tmp_path):
    log = street_log()
    (folder / "000003.bin").unlink()
    sequence = open_sequence(folder)
    np.testing.assert_allclose(sequence.reference_poses[3:], log.poses[4:], atol=1e-5)
    seen = sees(log.scans[4].points)
    assert_same_truth(sequence.truth(3)[seen], log.truth[4][seen])
    write_split(tmp_path / "other", log, "testing", with_labels=False)
    assert open_sequence(tmp_path / "other" / "testing").truth(0) is None


def test_what_is_missing_or_damaged_is_told_with_its_file(folder):
    split = folder.parent.parent
    path = split / "label_02" / "0000.txt"
    path.write_text("0 1 Car 0 0\n")
    with pytest.raises(InputError, match=r"label_02/0000.txt is not a file of KITTI's tracking labels"):
        open_sequence(folder).truth(0)
    path.write_text(labels(street_log()).replace("\n", " "))
    with pytest.raises(InputError, match=r"label_02/0000.txt is not a file .*a line of another number of words"):
        open_sequence(folder).truth(0)
    path = split / "oxts" / "0000.txt"
    path.write_text("\n".join(path.read_text().splitlines()[:5]))
    with pytest.raises(InputError, match=r"0000.txt holds 5 poses, but there is a scan 000011"):
        open_sequence(folder).reference_poses  # noqa: B018
    path = split / "calib" / "0000.txt"
    path.write_text("P2: 1 2 3\n")
    with pytest.raises(InputError, match=r"calib/0000.txt has no line 'R_rect' of 9 numbers"):
        open_sequence(folder)._T_rectified_sensor  # noqa: B018


def test_scans_are_in_the_order_of_their_numbers_whatever_they_saw(folder, monkeypatch):
    expected = open_sequence(folder)
    monkeypatch.setattr("automos.readers.folder.put_in_seen_order", lambda *_: 1 / 0)
    sequence = open_sequence(folder)
    assert sequence.names == expected.names
    np.testing.assert_array_equal(sequence.stamps, 0.1 * np.arange(len(sequence)))
