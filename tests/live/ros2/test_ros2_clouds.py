"""Clouds with a field more or with fewer points: the bytes of all other fields stay, whatever their layout."""

from types import SimpleNamespace

import numpy as np
import pytest
from bags import cloud, columns_of
from street_log import street_log

from automos.core.geometry import make_transform
from automos.live.ros2.feed import new_field, scan_of, with_field, with_rows
from automos.live.ros2.publishing import of_base
from automos.readers.point_cloud2 import read_columns


def message(**options):
    parts = cloud({key: column[:40] for key, column in columns_of(street_log().scans[0]).items()}, **options)
    parts.fields = [SimpleNamespace(name=n, offset=o, datatype=c, count=1) for n, o, c in parts.fields]
    parts.header = SimpleNamespace(stamp=SimpleNamespace(sec=12, nanosec=500_000_000), frame_id="lidar")
    parts.data = parts.data.tobytes()
    return parts


def changed(before, body, fields):
    return SimpleNamespace(
        **{**vars(before), **body._asdict(), "fields": fields, "data": np.array(body.data, np.uint8)}
    )


@pytest.mark.parametrize("options", [{}, {"height": 4, "row_padding": 3}, {"big_endian": True}, {"gap": 0}])
def test_all_fields_stay_and_one_says_what_moves(options):
    before = message(**options)
    labels = np.array([0, 9, 251, 9] * 10, np.uint8)
    after = changed(before, with_field(before, labels), [*before.fields, new_field(before, SimpleNamespace)])
    was, now = read_columns(before, "it"), read_columns(after, "it")
    assert now.pop("moving").tolist() == [2, 0, 1, 0] * 10
    assert list(now) == list(was)
    assert all(np.array_equal(now[name], was[name]) for name in was)
    assert (after.height, after.width) == (before.height, before.width)


@pytest.mark.parametrize("options", [{}, {"height": 4, "row_padding": 3}])
def test_rows_are_cut_to_those_that_are_kept(options):
    before = message(**options)
    kept = np.arange(40) % 3 == 0
    after = changed(before, with_rows(before, kept), before.fields)
    was, now = read_columns(before, "it"), read_columns(after, "it")
    assert all(np.array_equal(now[name], was[name][kept]) for name in was)
    assert (after.height, after.width) == (1, 14)
    assert with_rows(before, np.zeros(40, bool)).row_step == 0


def test_a_cloud_is_a_scan_with_its_headers_time():
    scan = scan_of(message(), "000007")
    assert (scan.name, scan.stamp, len(scan)) == ("000007", 12.5, 40)
    np.testing.assert_array_equal(scan.points, street_log().scans[0].points[:40])
    assert scan.time is not None
    assert scan.ring is not None


def test_the_bases_path_begins_at_the_bases_own_place():
    T_base_lidar = make_transform(t=[1.0, 0.0, 2.0])
    ahead = make_transform(t=[3.0, 0.0, 0.0])
    np.testing.assert_allclose(of_base(np.eye(4), T_base_lidar), np.eye(4))
    np.testing.assert_allclose(of_base(ahead, T_base_lidar), ahead)
    turned = make_transform([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(of_base(turned, T_base_lidar)[:3, 3], [1.0, -1.0, 0.0])  # a turn about the lidar


def test_without_ros_the_command_says_how_to_get_it(monkeypatch):
    import sys

    from automos.core.errors import MissingExtraError
    from automos.live.ros2.feed import RosFeed

    monkeypatch.setitem(sys.modules, "rclpy", None)
    with pytest.raises(MissingExtraError, match="source ROS 2"):
        RosFeed([])
