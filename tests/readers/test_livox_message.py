"""Bags of Livox's own drivers, written by rosbags from the drivers' message definitions."""

import numpy as np
import pytest
from street_log import assert_same_points, street_log

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.readers.livox_message import read_columns

pytest.importorskip("rosbags")
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

POINT = "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n"
MESSAGE = (
    "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\nCustomPoint[] points\n"
)


def write_livox(path, package, log, frame="livox_frame"):
    """Write the log as a driver of `package` does; .bag is ROS 1, .mcap ROS 2."""
    is_ros1 = path.suffix == ".bag"
    types = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_JAZZY)
    name, point = f"{package}/msg/CustomMsg", f"{package}/msg/CustomPoint"
    types.register(get_types_from_msg(POINT, point) | get_types_from_msg(MESSAGE, name))
    writer = Writer1(path) if is_ros1 else Writer2(path.with_suffix(""), version=9, storage_plugin=StoragePlugin.MCAP)
    kinds = types.types
    with writer:
        connection = writer.add_connection("/livox/lidar", name, typestore=types)
        for nanoseconds, scan in zip(log.nanoseconds, log.scans, strict=True):
            stamp = round(scan.stamp * 1e9)
            time = kinds["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
            header = {"stamp": time, "frame_id": frame} | ({"seq": 0} if is_ros1 else {})
            offsets = np.round(scan.time.astype(float) * 1e9).astype(int)
            points = [
                kinds[point](int(t), *map(float, xyz), int(i), 0, int(ring))
                for t, xyz, i, ring in zip(offsets, scan.points, scan.intensity, scan.ring, strict=True)
            ]
            message = kinds[name](
                kinds["std_msgs/msg/Header"](**header), stamp, len(points), 1, np.zeros(3, np.uint8), points
            )
            serialize = types.serialize_ros1 if is_ros1 else types.serialize_cdr
            writer.write(connection, int(nanoseconds), serialize(message, name))
    if not is_ros1:
        next(path.with_suffix("").glob("*.mcap")).rename(path)
    return path


@pytest.mark.parametrize(
    ("file", "package", "frame"),
    [
        ("log.bag", "livox_ros_driver", "livox_frame"),
        ("log.bag", "livox_ros_driver2", "l"),
        *(("log.mcap", "livox_ros_driver2", frame) for frame in ("l", "livox_frame", "front/livox")),
    ],
)
def test_points_times_and_lines_are_the_drivers(tmp_path, file, package, frame):
    log = street_log()
    sequence = open_sequence(write_livox(tmp_path / file, package, log, frame))
    assert len(sequence) == len(log.scans)
    np.testing.assert_allclose(sequence.stamps, log.stamps, atol=1e-6)
    for got, true in zip(sequence, log.scans, strict=True):
        assert_same_points(got, true, atol=0)


def test_a_message_that_is_cut_short_is_told():
    with pytest.raises(InputError, match="here is cut short: 30 bytes for 1 points"):
        read_columns(bytes(30), False, "here")


@pytest.mark.parametrize("frame", ["l", "livox_frame"])
@pytest.mark.parametrize("file", ["log.bag", "log.mcap"])
def test_points_are_cut_out_of_a_message_and_counted_anew(tmp_path, file, frame):
    from rosbags.highlevel import AnyReader

    from automos.readers.bag_messages import with_rows

    write_livox(tmp_path / file, "livox_ros_driver2", street_log(), frame)
    is_ros2 = file.endswith("mcap")
    with AnyReader([tmp_path / file]) as reader:
        connection, _, raw = next(reader.messages())
        was = reader.deserialize(raw, connection.msgtype)
        for kept in (np.arange(was.point_num) % 3 > 0, np.zeros(was.point_num, bool)):
            now = reader.deserialize(with_rows(raw, connection.msgtype, is_ros2, kept), connection.msgtype)
            assert (now.header, now.timebase, now.lidar_id) == (was.header, was.timebase, was.lidar_id)
            assert now.point_num == len(now.points) == kept.sum()
            assert now.points == [point for point, is_kept in zip(was.points, kept, strict=True) if is_kept]
        with pytest.raises(InputError, match="labels"):
            with_rows(raw, connection.msgtype, is_ros2, kept[1:])
