"""Bags of Velodyne's driver, which records packets: the points are those of a capture of the same packets."""

import numpy as np
import pytest
from bags import cloud
from sensor_packets import difop32
from test_packet_decode import drive, robosense_drive
from velodyne_packets import data_packets, firings, hdl64e_packets, to_points, udp, write_pcap

from automos.core.errors import InputError, MissingExtraError
from automos.readers import open_sequence
from automos.readers.packets.messages import read_packets

pytest.importorskip("velodyne_decoder")
pytest.importorskip("rosbags")
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

SCAN, PACKET = "velodyne_msgs/msg/VelodyneScan", "velodyne_msgs/msg/VelodynePacket"
HOUR = 3600 * 444_444


def room(n_packets, first_azimuth=0.0):
    azimuth, _ = firings(24 * n_packets, first_azimuth)
    rays = to_points(np.ones_like(azimuth), azimuth)
    with np.errstate(divide="ignore"):
        distance = (np.array([8.0, 30.0, 3.0]) / np.abs(rays)).min(axis=-1)
    return 0.002 * np.round(distance / 0.002), np.arange(azimuth.size).reshape(azimuth.shape) % 200, azimuth


def write_scans(path, packets, n, frame="velodyne", topic="/velodyne_packets", beside=()):
    """Write packets (seconds, bytes), `n` a message, as the driver does; .bag is ROS 1, else ROS 2."""
    is_ros1 = path.suffix == ".bag"
    types = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    types.register(
        get_types_from_msg("builtin_interfaces/Time stamp\nuint8[1206] data\n", PACKET)
        | get_types_from_msg("std_msgs/Header header\nvelodyne_msgs/VelodynePacket[] packets\n", SCAN)
    )
    kind = types.types
    plugin = StoragePlugin.SQLITE3 if path.suffix == ".db3" else StoragePlugin.MCAP
    writer = Writer1(path) if is_ros1 else Writer2(path.with_suffix(""), version=8, storage_plugin=plugin)

    def time(seconds):
        whole = int(seconds)
        return kind["builtin_interfaces/msg/Time"](HOUR + whole, round(1e9 * (seconds - whole)))

    with writer:
        link = writer.add_connection(topic, SCAN, typestore=types)
        serialize = types.serialize_ros1 if is_ros1 else types.serialize_cdr
        for first in range(0, len(packets), n):
            some = packets[first : first + n]
            head = {"stamp": time(some[0][0]), "frame_id": frame, **({"seq": 0} if is_ros1 else {})}
            each = [kind[PACKET](time(seconds), np.frombuffer(raw, np.uint8)) for seconds, raw in some]
            message = kind[SCAN](kind["std_msgs/msg/Header"](**head), each)
            writer.write(link, 10**9 * HOUR + round(1e9 * some[0][0]), serialize(message, SCAN))
        for name, parts in beside:
            from bags import _message

            link = writer.add_connection(name, "sensor_msgs/msg/PointCloud2", typestore=types)
            message = _message(types, HOUR + 1.0, parts, is_ros1)
            writer.write(link, 10**9 * (HOUR + 1), serialize(message, message.__msgtype__))
    if not is_ros1:
        next(path.with_suffix("").glob(f"*{path.suffix}")).rename(path)
    return path


@pytest.mark.parametrize("name", ["log.bag", "log.db3", "log.mcap"])
@pytest.mark.parametrize("frame", ["velodyne", "v", "front/velodyne"])
def test_the_packets_of_a_message_are_a_scan_in_its_time(tmp_path, name, frame):
    distance, reflectivity, azimuth = room(76 * 4)
    packets = data_packets(distance, reflectivity, azimuth)
    sequence = open_sequence(write_scans(tmp_path / name, packets, 76, frame))
    assert len(sequence) == 4
    assert sequence.frame_id == frame
    np.testing.assert_allclose(sequence.stamps, [HOUR + packets[k][0] for k in range(0, 304, 76)], atol=1e-6)
    for k, scan in enumerate(sequence):
        rows = slice(76 * 24 * k, 76 * 24 * (k + 1))
        wanted = to_points(distance, azimuth)[rows].reshape(-1, 3)
        np.testing.assert_allclose(scan.points, wanted, atol=0.03)
        np.testing.assert_array_equal(scan.intensity, reflectivity[rows].ravel())
        np.testing.assert_allclose(scan.time[[0, -1]], [0.0, 76 * 24 * 55.296e-6], atol=1e-4)
        assert set(scan.ring) == set(range(16))


def test_a_sensor_that_tells_its_calibration_packet_by_packet_is_decoded_as_in_a_capture(tmp_path):
    n = 6 * 4200
    azimuth = 0.2 * np.arange(n)
    packets = hdl64e_packets(np.full((n, 64), 10.0), azimuth)
    sequence = open_sequence(write_scans(tmp_path / "log.bag", packets, 300))
    capture = write_pcap(tmp_path / "drive.pcap", [(HOUR + seconds, udp(raw)) for seconds, raw in packets])
    (scan, *_), (true, *_) = sequence, open_sequence(capture)
    assert len(scan) == len(true)
    np.testing.assert_allclose(scan.points, true.points, atol=1e-6)


def test_clouds_of_the_same_sensor_come_before_its_packets(tmp_path):
    points = cloud({axis: np.ones(5, "f4") for axis in "xyz"})
    packets = data_packets(*room(76))
    path = write_scans(tmp_path / "log.mcap", packets, 76, beside=[("/velodyne_points", points)])
    assert len(open_sequence(path)[0]) == 5
    assert len(open_sequence(path / "velodyne_packets")[0]) == 76 * 24 * 16


def test_a_message_of_fewer_packets_than_it_says_is_told(tmp_path):
    with pytest.raises(InputError, match="here is cut short: 40 bytes for 0 packets"):
        read_packets(bytes(40), SCAN, True, "here")
    raw = bytes(12) + (1).to_bytes(4, "little") + b"v" + (2).to_bytes(4, "little") + bytes(1214)
    with pytest.raises(InputError, match="here is cut short: 1235 bytes for 2 packets"):
        read_packets(raw, SCAN, False, "here")
    assert len(read_packets(raw + bytes(1214), SCAN, False, "here")) == 2


def test_without_the_extra_the_command_to_install_it_is_named(tmp_path, monkeypatch):
    path = write_scans(tmp_path / "log.mcap", data_packets(*room(76)), 76)
    monkeypatch.setitem(__import__("sys").modules, "velodyne_decoder", None)
    with pytest.raises(MissingExtraError, match=r"pip install '.*\[velodyne\]'"):
        open_sequence(path)


PACKED = {
    "pandar_msgs/msg/PandarScan": ("Pandar", "builtin_interfaces/Time stamp\nuint8[1500] data\nuint32 size\n"),
    "hesai_ros_driver/msg/UdpFrame": ("Udp", "builtin_interfaces/Time stamp\nuint8[] data\nuint32 size\n"),
    "nebula_msgs/msg/NebulaPackets": ("Nebula", "builtin_interfaces/Time stamp\nuint8[] data\n"),
    "rslidar_msgs/msg/rslidarScan": ("rslidar", "builtin_interfaces/Time stamp\nuint8[1248] data\n"),
}


def write_messages(path, kind, groups):
    """Write a message for each group of packets (seconds, bytes), as `kind`'s driver defines it."""
    is_ros1 = path.suffix == ".bag"
    types = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    name, definition = PACKED[kind]
    package = kind.partition("/")[0]
    inner = f"{package}/msg/{name}Packet"
    types.register(
        get_types_from_msg(definition, inner)
        | get_types_from_msg(f"std_msgs/Header header\n{package}/{name}Packet[] packets\n", kind)
    )
    made = types.types
    writer = Writer1(path) if is_ros1 else Writer2(path.with_suffix(""), version=8, storage_plugin=StoragePlugin.MCAP)
    with writer:
        link = writer.add_connection("/packets", kind, typestore=types)
        for group in groups:
            packets = []
            for seconds, raw in group:
                room = {"uint8[1500]": 1500}.get(definition.split("\n")[1].split()[0], len(raw))
                data = np.frombuffer(raw.ljust(room, b"\0"), np.uint8)
                stamp = made["builtin_interfaces/msg/Time"](HOUR + int(seconds), round(1e9 * (seconds % 1)))
                packets.append(made[inner](stamp, data, *([len(raw)] if "size" in definition else [])))
            head = {"stamp": packets[0].stamp, "frame_id": "lidar", **({"seq": 0} if is_ros1 else {})}
            message = made[kind](made["std_msgs/msg/Header"](**head), packets)
            serialize = types.serialize_ros1 if is_ros1 else types.serialize_cdr
            writer.write(link, 10**9 * HOUR + round(1e9 * group[0][0]), serialize(message, kind))
    if not is_ros1:
        next(path.with_suffix("").glob("*.mcap")).rename(path)
    return path


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
@pytest.mark.parametrize("kind", PACKED)
def test_packets_of_other_makers_in_messages_are_those_of_a_capture(tmp_path, kind, suffix):
    if kind.startswith("rslidar"):
        packets = robosense_drive(1, 225)[0]
    else:
        packets = drive("PandarXT-32", 3, first=0)[0]
    third = len(packets) // 3
    groups = [packets[k : k + third] for k in range(0, 3 * third, third)]
    sequence = open_sequence(write_messages(tmp_path / f"log{suffix}", kind, groups))
    assert len(sequence) == 3
    capture = write_pcap(tmp_path / "drive.pcap", [(HOUR + seconds, udp(raw)) for seconds, raw in packets])
    scan, true = sequence[0], open_sequence(capture)[0]
    n = min(len(scan), len(true))  # a message may have a packet less than a turn
    assert n > 0.98 * len(true)
    np.testing.assert_array_equal(scan.points[:n], true.points[:n])
    np.testing.assert_array_equal(scan.ring[:n], true.ring[:n])
    np.testing.assert_allclose(scan.time[:n], true.time[:n], atol=2e-6)


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_messages_of_single_packets_are_put_together_to_scans(tmp_path, suffix):
    packets, *_ = robosense_drive(2, 300)
    elevation, azimuth = np.linspace(-25, 15, 32).round(3), np.linspace(-5, 5, 32).round(3)
    kind, is_ros1 = "rslidar_msg/msg/RslidarPacket", suffix == ".bag"
    path = tmp_path / f"log{suffix}"
    types = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    fields = "std_msgs/Header header\nuint8 is_difop\nuint8 is_frame_begin\nuint8[] data\n"
    types.register(get_types_from_msg(fields, kind))
    made = types.types
    serialize = types.serialize_ros1 if is_ros1 else types.serialize_cdr
    writer = Writer1(path) if is_ros1 else Writer2(path.with_suffix(""), version=8, storage_plugin=StoragePlugin.MCAP)
    with writer:
        link = writer.add_connection("/rslidar_packets", kind, typestore=types)
        sent = [(t, 0, k % 150 == 20, raw) for k, (t, raw) in enumerate(packets)]
        for t, is_difop, is_first, raw in [(0.0, 1, False, difop32(elevation, azimuth)), *sent]:
            stamp = made["builtin_interfaces/msg/Time"](HOUR + int(t), round(1e9 * (t % 1)))
            head = {"stamp": stamp, "frame_id": "rslidar", **({"seq": 0} if is_ros1 else {})}
            data = np.frombuffer(raw, np.uint8)
            message = made[kind](made["std_msgs/msg/Header"](**head), is_difop, int(is_first), data)
            writer.write(link, 10**9 * HOUR + round(1e9 * t), serialize(message, kind))
    if not is_ros1:
        next(path.with_suffix("").glob("*.mcap")).rename(path)
    sequence = open_sequence(path)
    assert sequence.warnings == []
    np.testing.assert_allclose(sequence.stamps - HOUR, [packets[20][0], packets[170][0]], atol=1e-6)
    frames = [(HOUR + t, udp(raw, port=6699)) for t, raw in packets[20:]]
    frames.append((HOUR + 0.01, udp(difop32(elevation, azimuth), port=7788)))
    true = open_sequence(write_pcap(tmp_path / "drive.pcap", sorted(frames)))[0]
    np.testing.assert_array_equal(sequence[0].points, true.points)
