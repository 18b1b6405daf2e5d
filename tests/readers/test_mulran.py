import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from street_log import street_log

from automos.core.errors import InputError
from automos.core.geometry import inverse, make_transform
from automos.readers import open_sequence

T_BASE_SENSOR = make_transform(
    Rotation.from_euler("xyz", [0.0001, 0.0003, 179.6654], degrees=True).as_matrix(), [1.7042, -0.021, 1.8047]
)


def write_drive(folder, log, n_points=64 * 1024):
    """Write a drive: clouds of 64 x 1024 points, zeros where nothing came back; poses between the scans as well."""
    (folder / "Ouster").mkdir(parents=True)
    for scan, t in zip(log.scans, log.nanoseconds, strict=True):
        cloud = np.zeros((n_points, 4), np.float32)
        cloud[: len(scan), :3], cloud[: len(scan), 3] = scan.points, scan.intensity
        cloud.tofile(folder / "Ouster" / f"{t}.bin")
    T = (log.T_ground_sensor @ inverse(T_BASE_SENSOR))[:, :3].reshape(-1, 12)
    rows = [f"{t}," + ",".join(f"{v:.9f}" for v in row) for t, row in zip(log.nanoseconds, T, strict=True)]
    (folder / "global_pose.csv").write_text("\n".join(rows) + "\n")
    return folder


@pytest.fixture
def folder(tmp_path):
    return write_drive(tmp_path / "DCC01", street_log())


def test_a_drive_keeps_all_points_and_tells_beam_and_time_by_their_place(folder):
    sequence, log = open_sequence(folder.parent), street_log()
    assert (sequence.name, len(sequence)) == ("DCC01", 12)
    for got, true in zip(sequence, log.scans, strict=True):
        assert len(got) == 64 * 1024
        np.testing.assert_array_equal(got.points[: len(true)], true.points)
        np.testing.assert_array_equal(got.intensity[: len(true)], true.intensity)
        assert got.is_valid.sum() == len(true)
    # point 130 is the third of the third column: beam 2, 2 of 1024 columns after the first
    assert got.ring[130] == 2
    assert got.time[130] == pytest.approx(2 / 1024 * 0.1)
    np.testing.assert_allclose(sequence.stamps, log.stamps, atol=1e-6)
    np.testing.assert_allclose(sequence.reference_poses, log.poses, atol=1e-6)


def test_an_incomplete_cloud_has_neither_beam_nor_time(folder):
    first = min((folder / "Ouster").iterdir())
    np.ones((100, 4), np.float32).tofile(first)
    scan = open_sequence(folder)[0]
    assert (len(scan), scan.ring, scan.time) == (100, None, None)


def test_a_drive_whose_poses_are_a_link_to_nothing_is_no_plain_folder(folder):
    (folder / "global_pose.csv").unlink()
    (folder / "global_pose.csv").symlink_to("elsewhere.csv")
    sequence = open_sequence(folder)
    assert (sequence.name, sequence[0].time is not None) == ("DCC01", True)
    with pytest.raises(InputError, match=r"global_pose\.csv is missing"):
        _ = sequence.reference_poses


def test_what_is_cut_short_or_missing_is_told(folder):
    first = min((folder / "Ouster").iterdir())
    first.write_bytes(first.read_bytes()[:-3])
    with pytest.raises(InputError, match=rf"{first.name} has \d+ bytes, no multiple of a point"):
        open_sequence(folder)[0]
    (folder / "global_pose.csv").write_text("1,2,3\n")
    with pytest.raises(InputError, match=r"global_pose.csv holds \(1, 3\) numbers; poses are 13 a line"):
        open_sequence(folder).reference_poses  # noqa: B018
    (folder / "Ouster" / "notes.bin").touch()
    with pytest.raises(InputError, match=r"notes.bin is not named by its time"):
        open_sequence(folder)


def test_poses_of_another_drive_are_told(folder):
    rows = (folder / "global_pose.csv").read_text().splitlines()
    (folder / "global_pose.csv").write_text("\n".join(rows[:3]) + "\n")
    with pytest.raises(InputError, match=r"global_pose.csv has no pose for scan 3 .* or is not whole"):
        open_sequence(folder).reference_poses  # noqa: B018
