"""Bags written by rosbags, for tests only."""

from contextlib import contextmanager
from functools import partial
from operator import itemgetter
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rosbags")
pytest.importorskip("mcap")
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

CODES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}


def columns_of(scan, time="t"):
    """Return a driver's columns of a scan: x, y, z, intensity, nanoseconds, ring."""
    return {
        **{axis: scan.points[:, k] for k, axis in enumerate("xyz")},
        "intensity": scan.intensity,
        time: np.round(scan.time.astype(float) * 1e9).astype(np.uint32),
        "ring": scan.ring,
    }


def cloud(columns, height=1, big_endian=False, gap=3, row_padding=0):
    """Return the parts of a PointCloud2 of columns (N,), `gap` bytes before each field, rows padded."""
    order = ">" if big_endian else "<"
    names, formats, offsets, at = [], [], [], 0
    for name, column in columns.items():
        at += gap
        names.append(name)
        formats.append(column.dtype.newbyteorder(order))
        offsets.append(at)
        at += column.dtype.itemsize
    dtype = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": at + gap})
    n = len(next(iter(columns.values())))
    points = np.zeros(n, dtype)
    for name, column in columns.items():
        points[name] = column
    rows = points.view(np.uint8).reshape(height, -1) if n else np.zeros((height, 0), np.uint8)
    rows = np.pad(rows, ((0, 0), (0, row_padding)))
    return SimpleNamespace(
        height=height,
        width=n // height,
        fields=[(name, offset, CODES[f.str[1:]]) for name, offset, f in zip(names, offsets, formats, strict=True)],
        is_bigendian=big_endian,
        point_step=dtype.itemsize,
        row_step=rows.shape[1],
        data=rows.reshape(-1),
    )


def write_bag(path, topics, compress=False, frames=None, joints=()):
    """Write `topics` (name to a list of (recorded ns, header s, cloud)) as what the path's suffix says.

    `frames` names the frame of a topic's clouds; `joints` are parent, child, translation, quaternion of /tf_static.
    .bag is ROS 1, .mcap and .db3 are one file, without a suffix it is ROS 2's folder. `compress` as recorders offer it.
    """
    with _opened(path, compress) as (writer, types, serialize):
        for topic, messages in topics.items():
            connection = writer.add_connection(topic, "sensor_msgs/msg/PointCloud2", typestore=types)
            for recorded, stamp, parts in messages:
                frame = (frames or {}).get(topic, "lidar")
                message = _message(types, stamp, parts, path.suffix == ".bag", frame)
                writer.write(connection, recorded, serialize(message, message.__msgtype__))
        if joints:
            message = _transforms(types, 0, joints)
            connection = writer.add_connection("/tf_static", message.__msgtype__, typestore=types)
            writer.write(connection, 0, types.serialize_cdr(message, message.__msgtype__))
    return path


@contextmanager
def _opened(path, compress=False):
    """Give a writer, its types, and what serializes them; a single file is moved to its place at the end."""
    types = get_typestore(Stores.ROS1_NOETIC if path.suffix == ".bag" else Stores.ROS2_JAZZY)
    if "tf2_msgs/msg/TFMessage" not in types.types:
        types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    folder = path.with_suffix("") if path.suffix in (".mcap", ".db3") else path
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".bag":
        writer = Writer1(path)
        if compress:
            writer.set_compression(Writer1.CompressionFormat.LZ4)
    else:
        plugin = StoragePlugin.SQLITE3 if path.suffix == ".db3" else StoragePlugin.MCAP
        writer = Writer2(folder, version=9, storage_plugin=plugin)
        if compress:
            mode = CompressionMode.STORAGE if plugin is StoragePlugin.MCAP else CompressionMode.MESSAGE
            writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        yield writer, types, types.serialize_ros1 if path.suffix == ".bag" else types.serialize_cdr
    if folder != path:
        next(folder.glob(f"*{path.suffix}")).rename(path)
        (folder / "metadata.yaml").unlink()
        folder.rmdir()


def write_robots_bag(path, scans):
    """Write what a robot records, in the order of time, as what the path's suffix says.

    `scans` are of /points, each its time in nanoseconds and its columns; every tenth point of it is on /rear/points.
    Beside them are an IMU, /tf and /tf_static, whose numbers are drawn.
    """
    rng, is_ros1 = np.random.default_rng(0), path.suffix == ".bag"
    begin, end = scans[0][0], scans[-1][0]
    with _opened(path) as (writer, types, serialize):

        def points(at, columns, step, frame):
            parts = cloud({name: column[::step] for name, column in columns.items()})
            return _message(types, at / 1e9, parts, is_ros1, frame)

        def joints(at, *names):
            return _transforms(types, at, [(*names, rng.normal(size=3).tolist(), [0.0, 0.0, 0.0, 1.0])])

        made = [(begin, "/tf_static", partial(joints, begin, "base", "lidar"))]
        for at, columns in scans:
            made.append((at, "/points", partial(points, at, columns, 1, "lidar")))
            made.append((at + 1, "/rear/points", partial(points, at, columns, 10, "rear")))
        for at in range(begin, end, 10**7):
            made.append((at, "/imu", partial(_imu, types, at, rng)))
            made.append((at, "/tf", partial(joints, at, "odom", "base")))
        connections = {}
        for at, topic, make in sorted(made, key=itemgetter(0)):
            message = make()
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=types)
            writer.write(connections[topic], at, serialize(message, kind))
    return path


def _imu(types, nanoseconds, rng):
    kind = types.types
    vectors = [kind["geometry_msgs/msg/Vector3"](*rng.normal(size=3).tolist()) for _ in range(2)]
    turned, unknown = kind["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0), np.zeros(9)
    header = _header(types, nanoseconds, "imu")
    return kind["sensor_msgs/msg/Imu"](header, turned, unknown, vectors[0], unknown, vectors[1], unknown)


def write_mcap(path, messages, schema, encoding, profile="", topic="/points", beside=(), **options):
    """Write messages of one topic, and `beside` it (topic, schema, encoding, messages) others."""
    with path.open("wb") as file:
        writer = McapWriter(file, **options)
        writer.start(profile, "test")
        for name, of, packed, every in [*beside, (topic, schema, encoding, messages)]:
            channel = writer.register_channel(name, packed, writer.register_schema(*of))
            for at, raw in every:
                writer.add_message(channel, at, raw, at)
        writer.finish()
    return path


def _header(types, nanoseconds, frame):
    kind = types.types
    old = {"seq": 0} if "seq" in kind["std_msgs/msg/Header"].__dataclass_fields__ else {}
    time = kind["builtin_interfaces/msg/Time"](*divmod(nanoseconds, 10**9))
    return kind["std_msgs/msg/Header"](stamp=time, frame_id=frame, **old)


def _transforms(types, nanoseconds, joints):
    """Return a TFMessage."""
    kind = types.types
    stamped = []
    for parent, child, translation, xyzw in joints:
        place = kind["geometry_msgs/msg/Transform"](
            kind["geometry_msgs/msg/Vector3"](*translation), kind["geometry_msgs/msg/Quaternion"](*xyzw)
        )
        header = _header(types, nanoseconds, parent)
        stamped.append(kind["geometry_msgs/msg/TransformStamped"](header, child, place))
    return kind["tf2_msgs/msg/TFMessage"](stamped)


def _message(types, stamp, parts, is_ros1, frame="lidar"):
    field = types.types["sensor_msgs/msg/PointField"]
    return types.types["sensor_msgs/msg/PointCloud2"](
        header=_header(types, round(stamp * 1e9), frame),
        height=parts.height,
        width=parts.width,
        fields=[field(name, offset, code, 1) for name, offset, code in parts.fields],
        is_bigendian=parts.is_bigendian,
        point_step=parts.point_step,
        row_step=parts.row_step,
        data=parts.data,
        is_dense=True,
    )
