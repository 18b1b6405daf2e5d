"""Bags of Velodyne's driver, which records packets: the points are those of a capture of the same packets."""

import numpy as np
import pytest
from bags import cloud
from velodyne_packets import data_packets, firings, hdl64e_packets, to_points, udp, write_pcap

from automos.core.errors import InputError, MissingExtraError
from automos.readers import open_sequence
from automos.readers.velodyne_message import read_packets

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
        read_packets(bytes(40), True, "here")
    raw = bytes(12) + (1).to_bytes(4, "little") + b"v" + (2).to_bytes(4, "little") + bytes(1214)
    with pytest.raises(InputError, match="here is cut short: 1235 bytes for 2 packets"):
        read_packets(raw, False, "here")
    assert len(read_packets(raw + bytes(1214), False, "here")) == 2


def test_without_the_extra_the_command_to_install_it_is_named(tmp_path, monkeypatch):
    path = write_scans(tmp_path / "log.mcap", data_packets(*room(76)), 76)
    monkeypatch.setitem(__import__("sys").modules, "velodyne_decoder", None)
    with pytest.raises(MissingExtraError, match=r"pip install '.*\[velodyne\]'"):
        open_sequence(path)
