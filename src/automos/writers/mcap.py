"""The recording with its labels as ROS 2 messages: one MCAP file that players and viewers open.

Clouds have the fields of `point_columns`. As in drivers, time is called `t`, in nanoseconds after the first point.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path, faults_reported
from automos.core.errors import InputError
from automos.readers.formats import import_extra
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.point_columns import packed_rows, point_columns

TOPIC, FRAME = "/automos/points", "lidar"
_DATATYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}


def write(run: RunFiles, out: Path) -> None:
    """Write all scans as sensor_msgs/PointCloud2 on topic /automos/points into the file `out`."""
    rosbag2, typesys = import_extra("rosbags.rosbag2", "ros"), import_extra("rosbags.typesys", "ros")
    types = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    _require_times(run)
    out.parent.mkdir(parents=True, exist_ok=True)
    with faults_reported(out), tempfile.TemporaryDirectory(dir=out.parent, prefix=".automos-") as scratch:
        bag = Path(scratch) / "bag"
        with rosbag2.Writer(bag, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
            connection = writer.add_connection(TOPIC, "sensor_msgs/msg/PointCloud2", typestore=types)
            for index in run.each("writing .mcap"):
                columns = point_columns(run, index)
                if "time" in columns:
                    columns["t"] = _nanoseconds(columns.pop("time"))
                nanoseconds = round(1e9 * run.stamps[index])
                message = _cloud(types.types, columns, nanoseconds)
                writer.write(connection, nanoseconds, types.serialize_cdr(message, message.__msgtype__))
        with atomic_path(out) as temporary:
            next(bag.glob("*.mcap")).replace(temporary)


def _nanoseconds(seconds: npt.NDArray[np.float32]) -> npt.NDArray[np.uint32]:
    """Return (N,) times of points from the first on, of a caller's own sequence, too: negative ones and NaN (0) are."""
    start = np.fmin.reduce(seconds, initial=0.0)
    return np.round(1e9 * np.nan_to_num(seconds - np.float64(start), posinf=0.0)).astype(np.uint32)


def _require_times(run: RunFiles) -> None:
    """Raise InputError where a scan's time is none that ROS has: it counts whole seconds from 0, in 31 bits."""
    are_held = (run.stamps >= 0.0) & (run.stamps < 2.0**31)
    if not are_held.all():
        k = int(np.argmin(are_held))
        raise InputError(
            f"{run.folder}: scan {run.names[k]} is at {run.stamps[k]:.6f} s, but ROS has times from 0 to 2^31 s only: "
            "give the recording others (times.txt) and label it again, or export to another format"
        )


def _cloud(types: dict[str, Any], columns: dict[str, npt.NDArray], nanoseconds: int) -> Any:
    rows = packed_rows(columns)
    time = types["builtin_interfaces/msg/Time"](nanoseconds // 10**9, nanoseconds % 10**9)
    make_field = types["sensor_msgs/msg/PointField"]
    fields = [
        make_field(name, rows.dtype.fields[name][1], _DATATYPES[column.dtype.str[1:]], 1)  # type: ignore[index]
        for name, column in columns.items()
    ]
    return types["sensor_msgs/msg/PointCloud2"](
        header=types["std_msgs/msg/Header"](time, FRAME),
        height=1,
        width=len(rows),
        fields=fields,
        is_bigendian=False,
        point_step=rows.dtype.itemsize,
        row_step=rows.nbytes,
        data=rows.view(np.uint8).reshape(-1),
        is_dense=bool(all(np.isfinite(columns[axis]).all() for axis in "xyz")),
    )


EXPORT = Export(
    writes="ROS 2 MCAP: PointCloud2 with fields label and instance",
    write=write,
    is_of_points=True,
    needs="ros",
    suffix=".mcap",
    sign=TOPIC.encode(),
)
