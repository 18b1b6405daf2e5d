"""Recordings published in KITTI's layout with something of their own: HeLiMOS, SemanticPOSS; and Apollo SouthBay."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from street_log import street_log

from automos.core.errors import InputError
from automos.core.pose_writers import write_kitti
from automos.readers import open_recordings, open_sequence
from automos.results.recording_warnings import recording_warnings


def write_sequence(folder, log, labels=None):
    """Write KITTI's layout; `labels` are those of each scan, None for scans without."""
    for name in ("velodyne", "labels"):
        (folder / name).mkdir(parents=True)
    for i, scan in enumerate(log.scans):
        np.column_stack([scan.points, scan.intensity]).tofile(folder / "velodyne" / f"{i:06d}.bin")
        if labels is not None and labels[i] is not None:
            labels[i].astype(np.uint32).tofile(folder / "labels" / f"{i:06d}.label")
    write_kitti(folder / "poses.txt", log.poses)
    return folder


def test_helimos_has_four_recordings_and_truth_for_the_listed_scans_only(tmp_path):
    log = street_log()
    listed = [truth if i in (2, 5) else None for i, truth in enumerate(log.truth)]
    root = tmp_path / "HeLiMOS" / "Deskewed_LiDAR"
    for sensor in ("Ouster", "Avia"):
        write_sequence(root / sensor, log, listed)
    (root / "val.txt").write_text("000002\n000005\n")
    assert [s.name for s in open_recordings(tmp_path / "HeLiMOS")] == ["Avia", "Ouster"]
    sequence = open_sequence(root / "Ouster")
    assert (type(sequence).__name__, sequence.is_compensated) == ("HelimosSequence", True)
    assert [i for i in range(12) if sequence.truth(i) is not None] == [2, 5]
    np.testing.assert_array_equal(sequence.truth(5), log.truth[5])
    np.testing.assert_array_equal(sequence[5].points, log.scans[5].points)
    np.testing.assert_allclose(sequence.reference_poses, log.poses, atol=1e-9)


def test_semanticposs_tells_what_stands_and_leaves_out_what_might_move(tmp_path):
    log = street_log()
    classes = np.array([0, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 21, 22])
    labels = [(np.arange(len(scan)) % 7 << 16) | classes[np.arange(len(scan)) % len(classes)] for scan in log.scans]
    folder = write_sequence(tmp_path / "sequences" / "00", log, labels)
    assert (open_sequence(folder).truth(0) & 0xFFFF)[0] == 0  # without tags it is KITTI's layout and numbers
    (folder / "tag").mkdir()
    truth = open_sequence(tmp_path).truth(3)
    n = len(log.scans[3])
    stands = np.isin(classes, [8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 22])[np.arange(n) % len(classes)]
    np.testing.assert_array_equal(truth & 0xFFFF, np.where(stands, 9, 0))
    np.testing.assert_array_equal(truth >> 16, np.arange(n) % 7)


def write_apollo(folder, log, write_points, first=1):
    """Write a run: clouds numbered from 1, poses with number and time."""
    lines = []
    for i, (scan, T) in enumerate(zip(log.scans, log.T_ground_sensor, strict=True)):
        columns = {axis: scan.points[:, k] for k, axis in enumerate("xyz")} | {"intensity": scan.intensity}
        write_points(folder / "pcds" / f"{first + i}.pcd", columns)
        q = Rotation.from_matrix(T[:3, :3]).as_quat()
        lines.append(" ".join([str(first + i), *(f"{v:.12f}" for v in (scan.stamp, *T[:3, 3], *q))]))
    (folder / "poses").mkdir()
    (folder / "poses" / "gt_poses.txt").write_text("\n".join(lines) + "\n")
    return folder


def test_apollo_scans_are_matched_to_poses_by_their_number(tmp_path, write_points):
    log = street_log()
    folder = write_apollo(tmp_path / "2018-09-26", log, write_points)
    sequence = open_sequence(tmp_path)
    assert sequence.names == [str(i) for i in range(1, 13)]
    np.testing.assert_allclose(sequence.stamps, log.stamps, atol=1e-6)
    np.testing.assert_allclose(sequence.reference_poses, log.poses, atol=1e-9)
    for got, true in zip(sequence, log.scans, strict=True):
        np.testing.assert_array_equal(got.points, true.points)
    (folder / "pcds" / "1.pcd").unlink()
    np.testing.assert_allclose(open_sequence(folder).stamps, log.stamps[1:], atol=1e-6)
    path = folder / "poses" / "gt_poses.txt"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:1], *lines[2:]]) + "\n")
    sequence = open_sequence(folder)  # labels need no poses
    with pytest.raises(InputError, match=r"gt_poses.txt has no pose for scan 2.pcd"):
        _ = sequence.reference_poses
    assert any("gt_poses.txt has no pose for scan 2.pcd" in said for said in recording_warnings(sequence))
