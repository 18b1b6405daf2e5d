"""What stands before or behind the points of files is told, and how long it is; points, however odd, are left alone."""

import hashlib
import struct

import numpy as np
import pytest
from sweeps import points_of, pose, sweep

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.readers.codecs import parse_columns
from automos.readers.record_layout import find_foreign

KITTI = "x,y,z,intensity"


def foreign(files, columns=KITTI):
    point = parse_columns(columns)
    n = min(map(len, files)) // point.itemsize
    return find_foreign(np.stack([np.frombuffer(raw, point, n) for raw in files]))


@pytest.fixture(scope="module")
def scans():
    """Return five sweeps (N, 4) of a sensor that drives on."""
    found = [sweep(pose(3.0 * i, 0.7 * i), seed=i) for i in range(5)]
    return [np.column_stack([points_of(one), one["intensity"]]).astype("<f4")[i:] for i, one in enumerate(found)]


HEADERS = {
    "a count": (16, lambda n, _: struct.pack("<IIII", n, 16, 0, 1)),
    "a count in floats": (16, lambda n, _: struct.pack("<ffff", 1.0, 1000.0 * n, 4.0, 0.1)),
    "a clock": (16, lambda n, i: struct.pack("<QII", 1_617_000_000_123_456_789 + 10**8 * i, n, 4)),
    "words, filled up": (128, lambda n, i: (b"# frame velodyne %d, points %d\n" % (i, n)).ljust(128, b"\0")),
    "a word and numbers": (32, lambda n, i: b"LIDARBIN" + struct.pack("<IId", 1, n, 1.6e9 + i) + bytes(8)),
    "a matrix that stands in all": (64, lambda n, _: np.eye(4, dtype="<f4").tobytes()),
    "noise": (48, lambda n, i: np.random.default_rng(i).bytes(48)),
    "a page": (4096, lambda n, _: (b"LIDARBIN" + struct.pack("<II", 1, n)).ljust(4096, b"\0")),
}


@pytest.mark.parametrize("name", HEADERS)
def test_a_header_is_told_with_its_size(tmp_path, scans, name):
    size, head = HEADERS[name]
    for i, scan in enumerate(scans):
        (tmp_path / f"{i}.bin").write_bytes(head(len(scan), i) + scan.tobytes())
    with pytest.raises(
        InputError, match=rf"0.bin begins with {size} bytes that are no points .*\(tail -c \+{size + 1}\)"
    ):
        open_sequence(tmp_path)
    assert len(open_sequence(tmp_path, KITTI)[0]) == len(scans[0]) + size // 16  # as the user says


FOOTERS = {
    "a sum": (16, lambda raw: hashlib.md5(raw).digest()),
    "words, filled up": (32, lambda raw: (b"END points=%d" % (len(raw) // 16)).ljust(32, b"\0")),
    "a count": (16, lambda raw: struct.pack("<QQ", len(raw), 7)),
}


@pytest.mark.parametrize("name", FOOTERS)
def test_what_stands_behind_the_points_is_told(tmp_path, scans, name):
    size, foot = FOOTERS[name]
    for i, scan in enumerate(scans):
        (tmp_path / f"{i}.bin").write_bytes(scan.tobytes() + foot(scan.tobytes()))
    with pytest.raises(InputError, match=rf"0.bin ends with {size} bytes that are no points .*\(head -c -{size}\)"):
        open_sequence(tmp_path)


@pytest.mark.parametrize("n_files", [1, 2, 5])
def test_points_of_one_file_or_several_are_no_header(scans, n_files):
    assert foreign([scan.tobytes() for scan in scans[:n_files]]) == 0
    head = struct.pack("<IIII", 900, 16, 0, 1) + bytes(32)
    assert foreign([head + scan.tobytes() for scan in scans[:n_files]]) == 48


def test_a_standing_sensor_without_noise_and_marks_of_missing_returns_are_no_header(scans):
    rng = np.random.default_rng(0)
    still = [scans[0].copy() for _ in range(4)]
    for scan in still:
        scan[rng.integers(10, len(scan), 50), :3] += 1.0  # what moves
    assert foreign([scan.tobytes() for scan in still]) == 0
    marked = [scan.copy() for scan in scans]
    for scan in marked:
        scan[rng.integers(0, len(scan), 300)] = 1e9
        scan[:3] = 1e9
    assert foreign([scan.tobytes() for scan in marked]) == 0
    for none in (0.0, np.nan, np.inf):
        missed = [np.concatenate([np.full((20, 4), none, "<f4"), scan]) for scan in scans]
        assert foreign([scan.tobytes() for scan in missed]) == 0


def test_a_header_before_wider_records_is_as_long_as_some_of_them(scans):
    rows = [np.column_stack([scan, np.arange(len(scan)) % 16]).astype("<f4") for scan in scans]
    raw = [struct.pack("<5I", len(row), 20, 0, 1, 7) + row.tobytes() for row in rows]
    assert foreign(raw, "x,y,z,intensity,ring") == 20
