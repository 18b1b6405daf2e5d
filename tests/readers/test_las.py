import numpy as np
import pytest
from street_log import street_log

from automos.core.errors import InputError, MissingExtraError
from automos.core.scan import Scan
from automos.readers import open_sequence

laspy = pytest.importorskip("laspy")
pytest.importorskip("lazrs")


def write_las(path, scan, offset=0.0):
    path.parent.mkdir(parents=True, exist_ok=True)
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = np.full(3, 1e-3), np.full(3, offset)
    header.add_extra_dim(laspy.ExtraBytesParams("ring", np.uint8))
    las = laspy.LasData(header)
    las.x, las.y, las.z = scan.points.astype(float).T + offset
    las.intensity = scan.intensity.astype(np.uint16)
    las.gps_time = scan.stamp + scan.time.astype(float)
    las.ring = scan.ring.astype(np.uint8)
    las.write(path)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_sweeps_are_read_with_all_their_points(tmp_path, suffix):
    log = street_log()
    for scan in log.scans:
        write_las(tmp_path / "log" / f"{scan.name}{suffix}", scan)
    sequence = open_sequence(tmp_path / "log")
    assert len(sequence) == 12
    for got, true in zip(sequence, log.scans, strict=True):
        assert len(got) == len(true)
        np.testing.assert_allclose(got.points, true.points, atol=6e-4)
        np.testing.assert_array_equal(got.intensity, true.intensity)
        np.testing.assert_array_equal(got.ring, true.ring)
        np.testing.assert_allclose(got.time, true.time, atol=1e-6)


def test_a_map_and_a_damaged_file_are_told(tmp_path, monkeypatch):
    scan = street_log().scans[0]
    write_las(tmp_path / "map" / "0.las", scan, offset=5e5)
    with pytest.raises(InputError, match=r"frame of a map .* about \(500000, 500000\)"):
        open_sequence(tmp_path / "map")[0]
    write_las(tmp_path / "cut" / "0.laz", scan)
    path = tmp_path / "cut" / "0.laz"
    for share in (0.01, 0.6):
        raw = path.read_bytes()
        (tmp_path / "cut" / "0.laz").write_bytes(raw[: int(share * len(raw))])
        with pytest.raises(InputError, match=r"0.laz"):
            open_sequence(tmp_path / "cut")[0]
        path.write_bytes(raw)
    monkeypatch.setitem(__import__("sys").modules, "laspy", None)
    with pytest.raises(MissingExtraError, match=r"pip install '.*\[las\]'"):
        open_sequence(tmp_path / "cut")[0]


def test_more_packed_bytes_than_there_are_are_told_before_memory_is_taken_for_them(tmp_path):
    path = tmp_path / "log" / "0.laz"
    write_las(path, street_log().scans[0])
    whole = path.read_bytes()
    start, width = int.from_bytes(whole[96:100], "little"), int.from_bytes(whole[105:107], "little")
    for layer in range(10):
        at = start + 8 + width + 4 + 4 * layer
        path.write_bytes(whole[:at] + b"\xff" * 4 + whole[at + 4 :])
        with pytest.raises(InputError, match="more packed bytes than it holds"):
            open_sequence(tmp_path / "log")[0]


def test_a_table_of_packed_points_that_cannot_be_is_told_before_memory_is_taken_for_it(tmp_path):
    path = tmp_path / "log" / "0.laz"
    write_las(path, street_log().scans[0])
    whole = path.read_bytes()
    start = int.from_bytes(whole[96:100], "little")
    table = int.from_bytes(whole[start : start + 8], "little")
    assert len(open_sequence(tmp_path / "log")[0]) > 0
    for at, number in ((table + 4, b"\xff" * 4), (start, b"\xff" * 7 + b"\x7f"), (start, bytes(8))):
        path.write_bytes(whole[:at] + number + whole[at + len(number) :])
        with pytest.raises(InputError, match="a table of its packed points that is not there"):
            open_sequence(tmp_path / "log")[0]


@pytest.mark.parametrize("n_points", [1, 60_000, 130_000])
def test_a_count_of_packed_points_that_is_not_that_of_their_chunks_is_told(tmp_path, n_points):
    path = tmp_path / "log" / "0.laz"
    points = np.random.default_rng(0).uniform(-20.0, 20.0, (n_points, 3)).astype(np.float32)
    column = np.zeros(n_points, np.float32)
    write_las(path, Scan(points, column, np.linspace(0.0, 0.1, n_points, dtype="f4"), column.astype("u2"), stamp=0.0))
    whole = path.read_bytes()
    assert len(open_sequence(tmp_path / "log")[0]) == n_points
    for wrong in (0, n_points // 3, n_points + 50_000):
        path.write_bytes(whole[:247] + wrong.to_bytes(8, "little") + whole[255:])
        with pytest.raises(InputError, match=f"its header announces {wrong} points"):
            open_sequence(tmp_path / "log")[0]


@pytest.mark.parametrize("n_points", [700, 60_000])
def test_a_count_of_points_in_one_stream_is_that_for_which_its_packed_bytes_are_needed(tmp_path, n_points):
    path = tmp_path / "log" / "0.laz"
    path.parent.mkdir()
    las = laspy.LasData(laspy.LasHeader(version="1.2", point_format=1))
    las.x, las.y, las.z = np.random.default_rng(0).uniform(-20.0, 20.0, (3, n_points))
    las.write(path)
    whole = path.read_bytes()
    assert len(open_sequence(tmp_path / "log")[0]) == n_points
    for wrong in (n_points - 9, n_points - n_points % 50_000 // 2, n_points + 1, n_points + 30):
        path.write_bytes(whole[:107] + wrong.to_bytes(4, "little") + whole[111:])
        with pytest.raises(
            InputError, match=rf"0\.laz (holds .* packed points than the {wrong} that|is not a complete LAS file)"
        ):
            open_sequence(tmp_path / "log")[0]


@pytest.mark.parametrize("n_records", [0, 2])
def test_bytes_that_came_in_or_were_lost_among_points_are_told_be_they_less_than_a_point(tmp_path, n_records):
    path = tmp_path / "log" / "0.las"
    write_las(path, street_log().scans[0])
    if n_records:
        las = laspy.read(path)
        las.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("me", k, "of mine", b"12345") for k in range(n_records)])
        las.write(path)
    whole = path.read_bytes()
    assert len(open_sequence(tmp_path / "log")[0]) == len(street_log().scans[0])
    for damaged in (whole[:5000] + b"x" + whole[5000:], whole[:5000] + whole[5001:]):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"0.las is cut short or damaged"):
            open_sequence(tmp_path / "log")[0]
