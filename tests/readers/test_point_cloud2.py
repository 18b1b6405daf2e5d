"""Clouds whose headers count fewer points than their data hold, or give the length of a row wrong."""

from types import SimpleNamespace

import numpy as np
import pytest
from bags import cloud, write_bag

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.readers.point_cloud2 import read_columns
from automos.readers.wire import Wire


def message(height, width, row_step, data, step=12, big=False):
    fields = [SimpleNamespace(name=axis, offset=4 * k, datatype=7, count=1) for k, axis in enumerate("xyz")]
    return SimpleNamespace(
        height=height, width=width, point_step=step, row_step=row_step, is_bigendian=big, fields=fields,
        data=np.frombuffer(data, np.uint8),
    )  # fmt: skip


def rows(*x, order="<", pad=0):
    """Return the bytes of points (x, 1, 2), each with `pad` more."""
    return b"".join(np.array([value, 1.0, 2.0], f"{order}f4").tobytes() + bytes(pad) for value in x)


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("pad", [0, 4, 20])
@pytest.mark.parametrize(
    ("height", "width", "row_step"),
    [(1, 3, 36), (1, 3, 72), (1, 3, 0), (1, 6, 72), (3, 2, 24), (0, 6, 0), (0, 0, 0), (1, 0, 0), (6, 0, 0), (2, 1, 0)],
)
def test_all_points_come_in_order_whatever_the_header_counts(height, width, row_step, pad, big):
    order, step = ">" if big else "<", 12 + pad
    given = message(height, width, row_step // 12 * step, rows(5, 6, 7, 8, 9, 10, order=order, pad=pad), step, big)
    assert read_columns(given, "here")["x"].tolist() == [5, 6, 7, 8, 9, 10]


@pytest.mark.parametrize("height", [2, 3])
def test_rows_of_more_points_than_their_width_are_read_whole(height):
    data = rows(*range(1, 4 * height + 1))
    assert read_columns(message(height, 2, 48, data), "here")["x"].tolist() == list(range(1, 4 * height + 1))


def test_what_pads_rows_and_buffers_are_no_points():
    padded = rows(1, 2) + bytes(24) + rows(3, 4) + bytes(24)  # rows of two points in the room of four
    assert read_columns(message(2, 2, 48, padded), "here")["x"].tolist() == [1, 2, 3, 4]
    for behind in (bytes(36), bytes(5), b"\1\2\3"):
        assert read_columns(message(1, 2, 24, rows(1, 2) + behind), "here")["x"].tolist() == [1, 2]
    odd = rows(1, 2) + b"abcde" + rows(3, 4) + b"fghij"  # no whole points
    assert read_columns(message(2, 2, 29, odd), "here")["x"].tolist() == [1, 2, 3, 4]


def test_a_wrong_length_of_rows_does_not_matter_where_the_points_fit_exactly():
    for row_step in (0, 1, 12, 10**6):
        assert read_columns(message(2, 2, row_step, rows(1, 2, 3, 4)), "here")["x"].tolist() == [1, 2, 3, 4]


def test_points_without_return_keep_their_places():
    scan = read_columns(message(2, 3, 36, rows(np.nan, 1, 0, np.nan, np.inf, 2)), "here")["x"]
    np.testing.assert_array_equal(scan, [np.nan, 1, 0, np.nan, np.inf, 2])


def test_fewer_bytes_than_points_are_told():
    with pytest.raises(InputError, match="here is cut short: 24 bytes for 1 x 3 points of 12 bytes"):
        read_columns(message(1, 3, 36, rows(1, 2)), "here")
    with pytest.raises(InputError, match="here is cut short"):
        read_columns(message(2, 2, 30, rows(1, 2, 3)), "here")


def test_a_recording_of_too_small_widths_has_all_its_points(tmp_path):
    columns = {axis: np.arange(1, 9, dtype="f4") for axis in "xyz"}
    parts = cloud(columns, gap=2)
    parts.width = 4
    path = write_bag(tmp_path / "log.mcap", {"/p": [(k, 1.0 + k, parts) for k in range(3)]})
    sequence = open_sequence(path)
    assert [scan.points[:, 0].tolist() for scan in sequence] == [list(range(1, 9))] * 3
    assert sequence.warnings == [f"{path / 'p'}: headers count 4 of 8 points in the data; all are read."]


@pytest.mark.parametrize(("is_ros2", "big"), [(False, False), (True, False), (True, True)])
@pytest.mark.parametrize("frame", ["", "l", "velodyne", "/os_sensor"])
def test_headers_are_read_as_they_lie(is_ros2, big, frame):
    order, name = "big" if big else "little", frame.encode() + (b"\0" if is_ros2 else b"")
    start = bytes([0, 0 if big else 1, 0, 0]) if is_ros2 else bytes(4)
    raw = start + b"".join(value.to_bytes(4, order) for value in (1700000000, 250_000_000, len(name))) + name
    assert Wire(raw, is_ros2).header() == (1700000000.25, frame.strip("/"))
    here = Wire.behind_header(raw + bytes(3) + bytes(4), is_ros2)
    here.align(4)
    assert here.at == len(raw) + (-len(raw) % 4 if is_ros2 else 0)
    assert here.packed(258) == (258).to_bytes(4, order)
