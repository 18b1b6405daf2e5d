"""Bags written by rosbags, for tests only."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rosbags")
pytest.importorskip("mcap")
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

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
    types = get_typestore(Stores.ROS1_NOETIC if path.suffix == ".bag" else Stores.ROS2_JAZZY)
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
        for topic, messages in topics.items():
            connection = writer.add_connection(topic, "sensor_msgs/msg/PointCloud2", typestore=types)
            for recorded, stamp, parts in messages:
                frame = (frames or {}).get(topic, "lidar")
                message = _message(types, stamp, parts, path.suffix == ".bag", frame)
                serialize = types.serialize_ros1 if path.suffix == ".bag" else types.serialize_cdr
                writer.write(connection, recorded, serialize(message, message.__msgtype__))
        if joints:
            message = _static_transforms(types, joints)
            connection = writer.add_connection("/tf_static", message.__msgtype__, typestore=types)
            writer.write(connection, 0, types.serialize_cdr(message, message.__msgtype__))
    if folder != path:
        next(folder.glob(f"*{path.suffix}")).rename(path)
        (folder / "metadata.yaml").unlink()
        folder.rmdir()
    return path


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


def _static_transforms(types, joints):
    """Return a TFMessage."""
    kind = types.types
    stamped = []
    for parent, child, translation, xyzw in joints:
        old = {"seq": 0} if "seq" in kind["std_msgs/msg/Header"].__dataclass_fields__ else {}
        header = kind["std_msgs/msg/Header"](stamp=kind["builtin_interfaces/msg/Time"](0, 0), frame_id=parent, **old)
        place = kind["geometry_msgs/msg/Transform"](
            kind["geometry_msgs/msg/Vector3"](*translation), kind["geometry_msgs/msg/Quaternion"](*xyzw)
        )
        stamped.append(kind["geometry_msgs/msg/TransformStamped"](header, child, place))
    return kind["tf2_msgs/msg/TFMessage"](stamped)


def _message(types, stamp, parts, is_ros1, frame="lidar"):
    nanoseconds = round(stamp * 1e9)
    time = types.types["builtin_interfaces/msg/Time"](nanoseconds // 10**9, nanoseconds % 10**9)
    header = {"stamp": time, "frame_id": frame} | ({"seq": 0} if is_ros1 else {})
    field = types.types["sensor_msgs/msg/PointField"]
    return types.types["sensor_msgs/msg/PointCloud2"](
        header=types.types["std_msgs/msg/Header"](**header),
        height=parts.height,
        width=parts.width,
        fields=[field(name, offset, code, 1) for name, offset, code in parts.fields],
        is_bigendian=parts.is_bigendian,
        point_step=parts.point_step,
        row_step=parts.row_step,
        data=parts.data,
        is_dense=True,
    )
