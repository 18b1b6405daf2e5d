"""MCAP files as converters, data platforms and other programs than ROS write them, by MCAP's own library."""

import base64
import json
import struct
import tracemalloc

import numpy as np
import pytest
from bags import _message, cloud, columns_of, write_mcap
from street_log import assert_same_points, street_log

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.readers.foxglove_cloud import read_columns

pytest.importorskip("rosbags")
pytest.importorskip("mcap")
from mcap.writer import CompressionType, IndexType
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
KIND = "sensor_msgs/msg/PointCloud2"
FOXGLOVE_TYPES = {"u1": 1, "i1": 2, "u2": 3, "i2": 4, "u4": 5, "i4": 6, "f4": 7, "f8": 8}


def ros_messages(log, is_ros1, **options):
    for nanoseconds, scan in zip(log.nanoseconds, log.scans, strict=True):
        message = _message(ROS1 if is_ros1 else ROS2, float(scan.stamp), cloud(columns_of(scan), **options), is_ros1)
        raw = ROS1.serialize_ros1(message, KIND) if is_ros1 else ROS2.serialize_cdr(message, KIND)
        yield int(nanoseconds), bytes(raw)


def assert_is_the_log(sequence, log, atol=0):
    assert len(sequence) == len(log.scans)
    np.testing.assert_allclose(sequence.stamps, log.stamps, atol=1e-6)
    for got, true in zip(sequence, log.scans, strict=True):
        assert_same_points(got, true, atol=atol)
    assert sequence.warnings == []


@pytest.mark.parametrize("profile", ["", "ros1", "ros2", "x-mine"])
@pytest.mark.parametrize("definition", ["", "sensor_msgs/PointCloud2", "right", "garbage \0 :"])
@pytest.mark.parametrize("is_ros1", [False, True])
def test_clouds_of_ros_are_read_by_their_well_known_definition(tmp_path, profile, definition, is_ros1):
    log = street_log()
    right = (ROS1 if is_ros1 else ROS2).generate_msgdef(KIND, ros_version=1 if is_ros1 else 2)[0]
    text = (right if definition == "right" else definition).encode()
    schema = ("sensor_msgs/PointCloud2", "ros1msg", text) if is_ros1 else (KIND, "ros2msg", text)
    path = write_mcap(
        tmp_path / "log.mcap", ros_messages(log, is_ros1), schema, "ros1" if is_ros1 else "cdr", profile, "/a/b"
    )
    assert_is_the_log(open_sequence(path), log)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunk", [{}, {"chunk_size": 1}, {"chunk_size": 1 << 26}, {"use_chunking": False}])
def test_chunks_may_be_of_any_size_compressed_or_none(tmp_path, compression, chunk):
    log = street_log()
    options = {"compression": compression, **chunk}
    path = write_mcap(tmp_path / "log.mcap", ros_messages(log, False), (KIND, "ros2msg", b""), "cdr", "ros2", **options)
    assert_is_the_log(open_sequence(path), log)


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD])
def test_a_file_without_any_index_is_read(tmp_path, compression):

    log = street_log()
    options = {
        "compression": compression,
        "index_types": IndexType.NONE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
        "use_summary_offsets": False,
    }
    path = write_mcap(tmp_path / "log.mcap", ros_messages(log, False), (KIND, "ros2msg", b""), "cdr", "ros2", **options)
    assert_is_the_log(open_sequence(path), log)


def test_topics_that_only_their_first_chunk_names_are_found(tmp_path):
    log = street_log()
    options = {"repeat_channels": False, "repeat_schemas": False, "chunk_size": 1}
    path = write_mcap(tmp_path / "log.mcap", ros_messages(log, False), (KIND, "ros2msg", b""), "cdr", "ros2", **options)
    assert_is_the_log(open_sequence(path), log)


# ------------------------------------------------------------------------------------------------------- Foxglove
def packed(number, kind, value):
    """Return a field of a message of Protocol Buffers."""
    key = varint(number << 3 | kind)
    return key + (varint(len(value)) + value if kind == 2 else value)


def varint(value):
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def as_protobuf(scan, parts, nanoseconds, order):
    """Return a foxglove.PointCloud, with a pose, by the numbers in its published definition."""
    seconds, rest = divmod(nanoseconds, 10**9)
    fields = b"".join(
        packed(5, 2, packed(1, 2, name.encode()) + packed(2, 5, struct.pack("<I", at)) + packed(3, 0, varint(kind)))
        for name, at, kind in parts.fields
    )
    told = {
        "time": packed(1, 2, packed(1, 0, varint(seconds)) + packed(2, 0, varint(rest))),
        "frame": packed(2, 2, b"lidar"),
        "pose": packed(3, 2, packed(1, 2, packed(1, 1, struct.pack("<d", 1.5)))),
        "step": packed(4, 5, struct.pack("<I", parts.point_step)),
        "fields": fields,
        "data": packed(6, 2, parts.data.tobytes()),
        "later": packed(9, 0, varint(7)),  # of a version to come
    }
    return b"".join(told[name] for name in order)


def as_json(scan, parts, nanoseconds, order):
    seconds, rest = divmod(nanoseconds, 10**9)
    told = {
        "timestamp": {"sec": seconds, "nsec": rest},
        "frame_id": "lidar",
        "pose": {"position": {"x": 1.5, "y": 0, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}},
        "point_stride": parts.point_step,
        "fields": [{"name": name, "offset": at, "type": kind} for name, at, kind in parts.fields],
        "data": base64.b64encode(parts.data.tobytes()).decode(),
    }
    return json.dumps(told).encode()


def as_ros(scan, parts, nanoseconds, order):

    types = get_typestore(Stores.ROS2_HUMBLE)
    field = "string name\nuint32 offset\nuint8 type\n"
    text = (
        "builtin_interfaces/Time timestamp\nstring frame_id\ngeometry_msgs/Pose pose\nuint32 point_stride\n"
        "foxglove_msgs/PackedElementField[] fields\nuint8[] data\n"
    )
    name, of = "foxglove_msgs/msg/PointCloud", "foxglove_msgs/msg/PackedElementField"
    types.register(get_types_from_msg(field, of) | get_types_from_msg(text, name))
    kinds = types.types
    pose = kinds["geometry_msgs/msg/Pose"](
        kinds["geometry_msgs/msg/Point"](1.5, 0.0, 0.0), kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    )
    message = kinds[name](
        kinds["builtin_interfaces/msg/Time"](*divmod(nanoseconds, 10**9)), "lidar", pose, parts.point_step,
        [kinds[of](*each) for each in parts.fields], parts.data,
    )  # fmt: skip
    return bytes(types.serialize_cdr(message, name))


USUAL = ("time", "frame", "pose", "step", "fields", "data")
CASES = {
    "protobuf": (as_protobuf, ("foxglove.PointCloud", "protobuf", b""), "protobuf", USUAL),
    "protobuf in another order": (
        as_protobuf, ("foxglove.PointCloud", "protobuf", b""), "protobuf",
        ("later", "time", "frame", "fields", "data", "step"),
    ),
    "json": (as_json, ("foxglove.PointCloud", "jsonschema", b"{}"), "json", USUAL),
    "ros": (as_ros, ("foxglove_msgs/msg/PointCloud", "ros2msg", b""), "cdr", USUAL),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("gap", [0, 3])
def test_foxgloves_clouds_are_read_without_their_definition(tmp_path, case, gap):
    make, schema, encoding, order = CASES[case]
    log, messages = street_log(), []
    for nanoseconds, scan in zip(log.nanoseconds.tolist(), log.scans, strict=True):
        parts = cloud(columns_of(scan), gap=gap)
        codes = {1: 2, 2: 1, 3: 4, 4: 3, 5: 6, 6: 5, 7: 7, 8: 8}  # of PointCloud2 in Foxglove's counting
        parts.fields = [(name, at, codes[code]) for name, at, code in parts.fields]
        messages.append((nanoseconds, make(scan, parts, nanoseconds, order)))
    sequence = open_sequence(write_mcap(tmp_path / "log.mcap", messages, schema, encoding))
    assert sequence.frame_id == "lidar"
    assert_is_the_log(sequence, log)


def test_foxgloves_stamps_may_be_dates(tmp_path):
    scan = street_log().scans[0]
    parts = cloud({axis: scan.points[:, k] for k, axis in enumerate("xyz")}, gap=0)
    parts.fields = [(name, at, 7) for name, at, _ in parts.fields]
    told = json.loads(as_json(scan, parts, 0, USUAL)) | {"timestamp": "2024-05-01T12:00:00.250Z"}
    path = write_mcap(
        tmp_path / "log.mcap", [(0, json.dumps(told).encode())], ("foxglove.PointCloud", "jsonschema", b""), "json"
    )
    assert open_sequence(path).stamps.tolist() == [1_714_564_800.25]


def test_foxgloves_types_may_be_names_and_unknown_ones_are_told(tmp_path):
    scan = street_log().scans[0]
    parts = cloud({axis: scan.points[:, k] for k, axis in enumerate("xyz")}, gap=0)
    for kind, is_known in (("FLOAT32", True), (7, True), ("FLOAT128", False), (12, False)):
        parts.fields = [(name, at, kind) for name, at, _ in parts.fields]
        raw = as_json(scan, parts, 10**18, USUAL)
        path = write_mcap(tmp_path / "log.mcap", [(0, raw)], ("foxglove.PointCloud", "jsonschema", b""), "json")
        if is_known:
            np.testing.assert_array_equal(open_sequence(path)[0].points, scan.points)
        else:
            with pytest.raises(InputError, match="field 'x' of unknown type 0"):
                open_sequence(path)


def test_the_old_message_of_ros_with_named_channels_is_read(tmp_path):
    kind, name = ROS1.types, "sensor_msgs/msg/PointCloud"
    time = kind["builtin_interfaces/msg/Time"](1_700_000_000, 500_000_000)
    points = [kind["geometry_msgs/msg/Point32"](x, 2.0, 3.0) for x in (1.0, 4.0)]
    channels = [
        kind["sensor_msgs/msg/ChannelFloat32"](channel, np.array(values, np.float32))
        for channel, values in (("intensity", [7, 8]), ("ring", [0, 1]))
    ]
    message = kind[name](kind["std_msgs/msg/Header"](0, time, "laser"), points, channels)
    raw = bytes(ROS1.serialize_ros1(message, name))
    sequence = open_sequence(
        write_mcap(tmp_path / "log.mcap", [(0, raw)], ("sensor_msgs/PointCloud", "ros1msg", b""), "ros1")
    )
    assert (sequence.stamps.tolist(), sequence.frame_id) == ([1_700_000_000.5], "laser")
    assert sequence[0].points.tolist() == [[1, 2, 3], [4, 2, 3]]
    assert (sequence[0].intensity.tolist(), sequence[0].ring.tolist()) == ([7, 8], [0, 1])


# ------------------------------------------------------------------------------------------------- what is hostile
def test_a_chunk_that_grows_beyond_all_clouds_is_told_before_it_is_unpacked(tmp_path):
    import zstandard

    name = KIND.encode()
    size = 3_800_000_000
    schema = struct.pack("<H", 1) + text(name) + text(b"ros2msg") + text(b"")
    channel = struct.pack("<HH", 0, 1) + text(b"/points") + text(b"cdr") + struct.pack("<I", 0)
    start = record(3, schema) + record(4, channel) + struct.pack("<BQ", 5, size) + struct.pack("<HIQQ", 0, 0, 5, 5)
    compressor = zstandard.ZstdCompressor().compressobj()
    data = compressor.compress(start)
    for _ in range(64):  # the rest is zeros; a few of them show what it would be
        data += compressor.compress(bytes(1 << 20))
    data += compressor.flush()
    body = struct.pack("<QQQI", 5, 5, len(start) + size, 0) + text(b"zstd") + struct.pack("<Q", len(data)) + data
    path = tmp_path / "bomb.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + record(1, text(b"ros2") + text(b"")) + record(6, body))
    assert path.stat().st_size < 300_000
    with pytest.raises(InputError, match=r"bomb.mcap holds a chunk that \d+ bytes at byte \d+ unpack to 3800000123 b"):
        open_sequence(path)


def test_a_chunk_that_is_listed_twice_is_there_once(tmp_path):
    log = street_log()
    path = write_mcap(tmp_path / "log.mcap", ros_messages(log, False), (KIND, "ros2msg", b""), "cdr", "ros2")
    raw = path.read_bytes()
    summary = struct.unpack("<Q", raw[-28:-20])[0]
    at = summary
    while raw[at] != 8:  # the index of a chunk
        at += 9 + struct.unpack_from("<Q", raw, at + 1)[0]
    entry = raw[at : at + 9 + struct.unpack_from("<Q", raw, at + 1)[0]]
    path.write_bytes(raw[:at] + entry + raw[at:])
    assert_is_the_log(open_sequence(path), log)


@pytest.mark.parametrize("height_width", [(2**31, 2**31), (1, 2**32 - 1), (2**32 - 1, 1)])
def test_clouds_of_hostile_sizes_are_told(tmp_path, height_width):
    parts = cloud({axis: np.ones(4, "f4") for axis in "xyz"}, gap=0)
    parts.height, parts.width = height_width
    raw = ROS2.serialize_cdr(_message(ROS2, 1.0, parts, False), KIND)
    path = write_mcap(tmp_path / "log.mcap", [(0, bytes(raw))], (KIND, "ros2msg", b""), "cdr")
    with pytest.raises(InputError, match=r"scan 0 is cut short: 48 bytes for"):
        open_sequence(path)


PACKETS = (
    "ouster_ros/msg/PacketMsg",
    "ouster_sensor_msgs/msg/PacketMsg",
    "point_cloud_interfaces/msg/CompressedPointCloud2",
)


def test_other_encodings_and_packets_of_other_makers_are_named(tmp_path):
    path = write_mcap(tmp_path / "a.mcap", [(0, b"123")], ("foxglove.PointCloud", "flatbuffer", b""), "flatbuffer")
    with pytest.raises(InputError, match=r"topics are: /points \(foxglove.PointCloud, flatbuffer\)"):
        open_sequence(path)
    for kind in PACKETS:
        path = write_mcap(tmp_path / "a.mcap", [(0, b"1234")], (kind, "ros2msg", b""), "cdr", topic="/packets")
        with pytest.raises(InputError, match=r"compressed clouds \(/packets .*driver and record"):
            open_sequence(path)


def text(raw):
    return struct.pack("<I", len(raw)) + raw


def record(op, body):
    return struct.pack("<BQ", op, len(body)) + body


@pytest.mark.parametrize("place", ["topic", "encoding", "metadata"])
def test_a_channel_that_ends_within_a_text_is_damage_and_not_the_end_of_the_file(tmp_path, place):
    log = street_log()
    path = write_mcap(tmp_path / "a.mcap", ros_messages(log, False), (KIND, "ros2msg", b""), "cdr", use_chunking=False)
    raw = bytearray(path.read_bytes())
    channel = raw.index(text(b"/points") + text(b"cdr"))
    at = channel + {"topic": 0, "encoding": 11, "metadata": 18}[place]
    raw[at] += 100  # it counts more bytes than the record has
    path.write_bytes(raw)
    with pytest.raises(InputError, match=r"a.mcap is damaged.* \(a record of a topic ends within a text\)"):
        open_sequence(path)


def test_a_message_of_millions_of_fields_takes_no_memory():
    tracemalloc.start()
    read_columns(b"\x78\x00" * 200_000, "protobuf", "a.mcap")
    assert tracemalloc.get_traced_memory()[1] < 1e6
    tracemalloc.stop()
