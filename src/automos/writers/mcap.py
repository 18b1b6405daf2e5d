"""The recording with its labels as ROS 2 messages: one MCAP file that players and viewers open.

Clouds have the fields of `point_columns`. As in drivers, time is called `t`, in nanoseconds after the first point.
"""

import tempfile
from pathlib import Path

import numpy as np

from automos.core.atomic import atomic_path, faults_reported
from automos.core.errors import InputError
from automos.readers.formats import import_extra
from automos.readers.point_cloud2 import cloud_message
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.point_columns import point_columns

TOPIC, FRAME = "/automos/points", "lidar"


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


EXPORT = Export(
    writes="ROS 2 MCAP: PointCloud2 with fields label and instance",
    write=write,
    is_of_points=True,
    needs="ros",
    modules=("rosbags",),
    suffix=".mcap",
    sign=TOPIC.encode(),
)
