"""Points and labels as the recording has them: one file for each scan, named after it, or one of all scans.

Clouds in an MCAP file are ROS 2 messages, which players and viewers open; as in drivers, time is called `t`, in
nanoseconds after the first point. A Parquet table has a row group per scan; what a scan has not, and others may have,
is null.

For map cleaning (DynamicMap_Benchmark, dufomap), clouds are in the world's frame, that of the first scan. VIEWPOINT in
a file's header is the sensor's pose, which dufomap takes as the origin of the rays. Intensity says what moves: 1, else
0.
"""

import io
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from automos.core.atomic import atomic_path, faults_reported, write_bytes
from automos.core.claims import SIGN
from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.core.geometry import Array, inverse, transform
from automos.core.label_files import pack
from automos.core.labels import Label
from automos.readers.point_cloud2 import cloud_message
from automos.results.run_files import RunFiles
from automos.writers.formats import Export, make_folders, pcd_bytes, pcd_header, ply_bytes, point_columns, write_pcd

_COLUMNS = "x y z intensity time ring label instance"


def _per_scan(suffix: str, holds: str, content: Callable[[RunFiles, int], bytes], is_of_points: bool = False) -> Export:
    """Return the declaration of files of a `suffix`, with the `content` of each scan of a run by its number."""

    def write(run: RunFiles, out: Path) -> None:
        for index in run.each(f"writing {suffix}"):
            write_bytes(out / f"{run.names[index]}{suffix}", content(run, index))

    return Export(f"folder of {suffix}: {holds}", write, is_of_points=is_of_points, per_scan=(f"*{suffix}",))


def _panoptic(run: RunFiles, index: int) -> bytes:
    n_points = len(run.scan(index))
    return pack(run.labels(index, n_points), run.instances(index, n_points)).tobytes()


def _instances(run: RunFiles, index: int) -> bytes:
    content = io.BytesIO()
    np.save(content, run.instances(index, len(run.scan(index))).astype(np.uint32))
    return content.getvalue()


TOPIC, FRAME = "/automos/points", "lidar"


def _write_mcap(run: RunFiles, out: Path) -> None:
    """Write all scans as sensor_msgs/PointCloud2 on topic /automos/points into the file `out`."""
    rosbag2, typesys = import_extra("rosbags.rosbag2", "ros"), import_extra("rosbags.typesys", "ros")
    types = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    _require_times(run)
    with faults_reported(out), tempfile.TemporaryDirectory(dir=out.parent, prefix=".automos-") as scratch:
        bag = Path(scratch) / "bag"
        with rosbag2.Writer(bag, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
            connection = writer.add_connection(TOPIC, "sensor_msgs/msg/PointCloud2", typestore=types)
            for index in run.each("writing .mcap"):
                nanoseconds = round(1e9 * run.stamps[index])
                time = types.types["builtin_interfaces/msg/Time"](*divmod(nanoseconds, 10**9))
                header = types.types["std_msgs/msg/Header"](time, FRAME)
                message = cloud_message(types.types, point_columns(run, index), header)
                writer.write(connection, nanoseconds, types.serialize_cdr(message, message.__msgtype__))
        with atomic_path(out) as temporary:
            next(bag.glob("*.mcap")).replace(temporary)


def _require_times(run: RunFiles) -> None:
    """Raise InputError where a scan's time is none that ROS has: it counts whole seconds from 0, in 31 bits."""
    are_held = (run.stamps >= 0.0) & (run.stamps < 2.0**31)
    if not are_held.all():
        k = int(np.argmin(are_held))
        raise InputError(
            f"{run.folder}: scan {run.names[k]} is at {run.stamps[k]:.6f} s, but ROS has times from 0 to 2^31 s only: "
            "give the recording others (times.txt) and label it again, or export to another format"
        )


_TYPES = {
    "scan": "int32", "x": "float32", "y": "float32", "z": "float32", "intensity": "float32", "time": "float32",
    "ring": "uint16", "label": "uint16", "instance": "uint32",
}  # fmt: skip


def _write_parquet(run: RunFiles, out: Path) -> None:
    """Write all scans as one file `out`: scan (int32) and the columns of `point_columns`, in the scans' order."""
    arrow, parquet = import_extra("pyarrow", "arrow"), import_extra("pyarrow.parquet", "arrow")
    with atomic_path(out) as temporary:
        schema = arrow.schema([(name, getattr(arrow, kind)()) for name, kind in _TYPES.items()], {"comment": SIGN})
        with parquet.ParquetWriter(temporary, schema, compression="zstd") as writer:
            for index in run.each("writing .parquet"):
                columns = point_columns(run, index)
                n_points = len(columns["x"])
                columns["scan"] = np.full(n_points, index, np.int32)
                filled = [
                    np.ascontiguousarray(columns[field.name])
                    if field.name in columns
                    else arrow.nulls(n_points, field.type)
                    for field in schema
                ]
                writer.write_table(arrow.table(filled, schema), row_group_size=max(n_points, 1))


def _write_dynamicmap(run: RunFiles, out: Path) -> None:
    """Write `out / pcd / 000000.pcd`, ..., and `out / gt_cloud.pcd`, all of them one after the other."""
    make_folders(out, "pcd")
    T_first_sensor = inverse(run.T_world_sensor[0]) @ run.T_world_sensor
    n_points = 0
    with tempfile.TemporaryFile(dir=out) as together:
        for index in run.each("writing .pcd"):
            columns = _in_world(run, index, T_first_sensor[index])
            write_pcd(out / "pcd" / f"{index:06d}.pcd", columns, T_first_sensor[index])
            together.write(np.column_stack(list(columns.values())).astype("<f4").tobytes())
            n_points += len(columns["x"])
        together.seek(0)
        with atomic_path(out / "gt_cloud.pcd") as temporary, temporary.open("wb") as file:
            file.write(pcd_header({name: np.dtype("<f4") for name in columns}, n_points))
            while part := together.read(1 << 24):
                file.write(part)


def _in_world(run: RunFiles, index: int, T_first_sensor: Array) -> dict[str, np.ndarray]:
    scan = run.scan(index)
    points = transform(T_first_sensor, run.points_at_pose(scan, index)[scan.is_valid]).astype(np.float32)
    is_moving = run.labels(index, len(scan))[scan.is_valid] == Label.MOVING
    return {"x": points[:, 0], "y": points[:, 1], "z": points[:, 2], "intensity": is_moving.astype(np.float32)}


EXPORTS = {
    "panoptic": _per_scan(".label", "class below, track id in the upper 16 bits", _panoptic),
    "instances": _per_scan(".npy", "track id of every point, 0 for none", _instances),
    "pcd": _per_scan(".pcd", _COLUMNS, lambda run, index: pcd_bytes(point_columns(run, index)), is_of_points=True),
    "ply": _per_scan(".ply", _COLUMNS, lambda run, index: ply_bytes(point_columns(run, index)), is_of_points=True),
    "parquet": Export(
        "one .parquet of all points, a row group per scan",
        _write_parquet,
        needs="arrow",
        suffix=".parquet",
        is_of_points=True,
    ),
    "mcap": Export(
        "ROS 2 MCAP: PointCloud2 with fields label and instance",
        _write_mcap,
        needs="ros",
        suffix=".mcap",
        sign=TOPIC.encode(),
        is_of_points=True,
    ),
    "dynamicmap": Export(
        "pcd/*.pcd in the world's frame with VIEWPOINT, gt_cloud.pcd: DynamicMap_Benchmark, dufomap",
        _write_dynamicmap,
    ),
}
