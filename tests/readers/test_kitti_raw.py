import numpy as np
import pytest
from kitti_packets import PROJECTION, R_RECTIFIED, T_CAMERA_SENSOR, T_SENSOR_IMU, line, packets, sees
from street_log import OBJECTS, assert_points_lie_in_their_boxes, assert_same_truth, street_log

from automos.core.errors import InputError
from automos.core.geometry import inverse
from automos.readers import open_sequence

DRIVE = "2011_09_26_drive_0005_sync"


def calibration(T):
    return f"calib_time: 15-Mar-2012 11:37:16\nR: {line(T[:3, :3])}\nT: {line(T[:3, 3])}\ndelta_f: 0.0 0.0\n"


def write_drive(root, log, missing=()):
    """Write a drive as KITTI publishes it; scans in `missing` are not there, their times, poses and boxes are."""
    day = root / "2011_09_26"
    drive = day / DRIVE
    (drive / "velodyne_points" / "data").mkdir(parents=True)
    (drive / "oxts" / "data").mkdir(parents=True)
    times = []
    for i, (scan, packet) in enumerate(zip(log.scans, packets(log.T_ground_sensor), strict=True)):
        times.append(f"2011-09-26 13:02:{44.5 + 0.1 * i:012.9f}")
        (drive / "oxts" / "data" / f"{i:010d}.txt").write_text(line(packet) + "\n")
        if i not in missing:
            rows = np.column_stack([scan.points, scan.intensity / 255])
            rows.astype(np.float32).tofile(drive / "velodyne_points" / "data" / f"{i:010d}.bin")
    (drive / "velodyne_points" / "timestamps.txt").write_text("\n".join(times) + "\n")
    (drive / "tracklet_labels.xml").write_text(tracklets(log))
    (day / "calib_imu_to_velo.txt").write_text(calibration(T_SENSOR_IMU))
    (day / "calib_velo_to_cam.txt").write_text(calibration(T_CAMERA_SENSOR))
    (day / "calib_cam_to_cam.txt").write_text(
        f"calib_time: 09-Jan-2012 13:57:47\ncorner_dist: 9.95e-02\nR_rect_00: {line(R_RECTIFIED)}\n"
        f"S_rect_02: 1.242e+03 3.75e+02\nP_rect_02: {line(PROJECTION)}\n"
    )
    return drive


def tracklets(log):
    """Return the file of tracklets: of every object, where the middle of its underside is in each scan's frame."""
    items = []
    for k in range(len(OBJECTS)):
        poses = []
        for i, T in enumerate(inverse(log.T_ground_sensor)):
            box = log.boxes(i).transformed(T)
            x, y, z = box.center[k] - [0, 0, box.size[k, 2] / 2]
            poses.append(f"<item><tx>{x}</tx><ty>{y}</ty><tz>{z}</tz><rx>0</rx><ry>0</ry><rz>{box.yaw[k]}</rz></item>")
        length, width, height = box.size[k]
        items.append(
            f"<item><objectType>Car</objectType><h>{height}</h><w>{width}</w><l>{length}</l>"
            f"<first_frame>0</first_frame><poses><count>{len(poses)}</count><item_version>1</item_version>"
            f"{''.join(poses)}</poses><finished>1</finished></item>"
        )
    return (
        '<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>\n<!DOCTYPE boost_serialization>\n'
        '<boost_serialization signature="serialization::archive" version="9"><tracklets><count>1</count>'
        f"{''.join(items)}</tracklets></boost_serialization>\n"
    )


@pytest.fixture
def drive(tmp_path):
    return write_drive(tmp_path / "raw", street_log())


def test_a_second_packet_in_a_scans_file_is_told_for_all_poses_behind_it_would_move(drive):
    path = drive / "oxts" / "data" / "0000000002.txt"
    path.write_text(2 * path.read_text())
    with pytest.raises(InputError, match=r"0000000002\.txt holds more than one packet"):
        _ = open_sequence(drive).reference_poses


def test_a_drive_is_found_from_its_day_or_above_with_its_times_and_poses(drive):
    log = street_log()
    for path in (drive, drive.parent, drive.parent.parent):
        sequence = open_sequence(path)
        assert (sequence.name, len(sequence), sequence.is_compensated) == (DRIVE, 12, False)
    for got, true in zip(sequence, log.scans, strict=True):
        np.testing.assert_array_equal(got.points, true.points)
    np.testing.assert_allclose(sequence.stamps - sequence.stamps[0], 0.1 * np.arange(12), atol=1e-6)
    assert sequence.stamps[0] == pytest.approx(1317042164.5)  # 2011-09-26 13:02:44.5 UTC
    np.testing.assert_allclose(sequence.reference_poses, log.poses, atol=1e-5)


def test_tracklets_are_truth_where_the_camera_sees(drive):
    sequence, log = open_sequence(drive), street_log()
    for i in range(12):
        truth = sequence.truth(i)
        seen = sees(log.scans[i].points)
        assert 0.05 < seen.mean() < 0.5
        assert (truth[~seen] == 0).all()
        assert_same_truth(truth[seen], log.truth[i][seen])
        assert_points_lie_in_their_boxes(sequence, i)


def test_scans_that_are_missing_shift_nothing(tmp_path):
    log = street_log()
    sequence = open_sequence(write_drive(tmp_path, log, missing=(3, 4)))
    assert len(sequence) == 10
    kept = [0, 1, 2, *range(5, 12)]
    np.testing.assert_allclose(sequence.stamps - sequence.stamps[0], 0.1 * np.array(kept), atol=1e-6)
    np.testing.assert_allclose(sequence.reference_poses, log.poses[kept], atol=1e-5)
    for k, i in enumerate(kept):
        seen = sees(log.scans[i].points)
        assert_same_truth(sequence.truth(k)[seen], log.truth[i][seen])


def test_what_is_missing_or_damaged_is_told_with_its_file(drive):
    day = drive.parent
    (day / "calib_cam_to_cam.txt").unlink()
    with pytest.raises(InputError, match=r"calib_cam_to_cam.txt is missing; download the calibration"):
        open_sequence(drive).truth(0)
    (day / "calib_imu_to_velo.txt").write_text("R: 1 2 3\n")
    with pytest.raises(InputError, match=r"calib_imu_to_velo.txt has no line 'R' of 9 numbers"):
        open_sequence(drive).reference_poses  # noqa: B018
    path = drive / "tracklet_labels.xml"
    path.write_text(path.read_text()[:500])
    with pytest.raises(InputError, match=r"tracklet_labels.xml is not a complete file of tracklets"):
        open_sequence(drive).truth(0)
    path.unlink()
    assert open_sequence(drive).truth(0) is None
    times = drive / "velodyne_points" / "timestamps.txt"
    lines = times.read_text().splitlines()
    times.write_text("\n".join([*lines[:5], lines[2], *lines[6:]]) + "\n")
    with pytest.raises(InputError, match=r"timestamps.txt: scan 0000000005 at .* is not after"):
        open_sequence(drive)
    times.write_text("yesterday\n" * 12)
    with pytest.raises(InputError, match=r"timestamps.txt must hold one time in seconds a line, or a date"):
        open_sequence(drive)


def test_a_scan_that_is_not_named_by_its_number_is_told(drive):
    scan = next(drive.rglob("velodyne_points/data/*3.bin"))
    scan.rename(scan.with_name("0000000003x.bin"))
    with pytest.raises(InputError, match=r"has a scan named '0000000003x'"):
        open_sequence(drive)


def test_a_drive_without_gps_has_no_poses_and_its_boxes_no_verdict(drive):
    for file in (drive / "oxts" / "data").iterdir():
        file.unlink()
    (drive / "oxts" / "data").rmdir()
    sequence = open_sequence(drive)
    assert sequence.reference_poses is None
    with pytest.raises(InputError, match="without poses it is not known which boxes move"):
        sequence.truth(0)
