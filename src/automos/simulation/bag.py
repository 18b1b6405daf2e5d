"""A simulated recording as a robot keeps it: a ROS 2 bag (MCAP) with the sweeps, an IMU, and where both are mounted.

/points    sensor_msgs/PointCloud2 with x y z intensity t ring, stamped at the start of the sweep
/imu       sensor_msgs/Imu at the same place, without noise: angular velocity, and acceleration with what holds it up
/tf_static from the LiDAR to the IMU, the identity
"""

import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.atomic import faults_reported
from automos.core.geometry import Array, inverse, se3_log
from automos.readers.formats import import_extra
from automos.readers.point_cloud2 import cloud_message
from automos.simulation.sequence import SimulatedSequence

RATE = 200
"""Measurements of the IMU a second."""
GRAVITY = 9.81
START = 1_700_000_000
"""Seconds, the bag's time of the simulation's beginning: odometry takes a time near 0 for none."""
_STEP = 1e-3
"""Seconds between the poses that velocities are taken from."""
_TYPES = ("sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/Imu", "tf2_msgs/msg/TFMessage")


def inertial(sequence: SimulatedSequence, times: Array) -> tuple[Array, Array]:
    """Return (N, 3) angular velocity, rad/s, and (N, 3) specific force, m/s^2, in the sensor's frame at `times`, s."""
    before, now, after = (sequence.poses_at(times + step) for step in (-_STEP, 0.0, _STEP))
    turns = np.array([se3_log(T)[3:] for T in inverse(before) @ after]) / (2.0 * _STEP)
    acceleration = (after - 2.0 * now + before)[:, :3, 3] / _STEP**2
    acceleration += GRAVITY * sequence.T_level_world[2, :3]
    return turns, np.einsum("nji,nj->ni", now[:, :3, :3], acceleration)


def write_bag(sequence: SimulatedSequence, out: Path) -> None:
    """Write `sequence` as the bag `out`, a folder; one that is there is complete, and kept."""
    rosbag2, typesys = import_extra("rosbags.rosbag2", "ros"), import_extra("rosbags.typesys", "ros")
    if out.exists():
        return
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    with faults_reported(out), tempfile.TemporaryDirectory(dir=out.parent, prefix=".automos-") as scratch:
        bag = Path(scratch) / out.name
        with rosbag2.Writer(bag, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
            topics = zip(("/points", "/imu", "/tf_static"), _TYPES, strict=True)
            topic_of = {kind: writer.add_connection(topic, kind, typestore=store) for topic, kind in topics}
            for nanoseconds, message in sorted(_messages(sequence, store.types), key=lambda timed: timed[0]):
                message = message() if callable(message) else message
                kind = message.__msgtype__
                writer.write(topic_of[kind], START * 10**9 + nanoseconds, store.serialize_cdr(message, kind))
        bag.replace(out)


def _messages(sequence: SimulatedSequence, types: Any) -> Iterator[tuple[int, Any]]:
    """Yield times, nanoseconds, and messages or what makes them: clouds are large."""

    def header(nanoseconds: int, frame: str) -> Any:
        time = types["builtin_interfaces/msg/Time"](START + nanoseconds // 10**9, nanoseconds % 10**9)
        return types["std_msgs/msg/Header"](time, frame)

    def cloud(index: int, nanoseconds: int) -> Any:
        scan = sequence[index]
        kept = scan.is_valid
        named = {"intensity": scan.intensity, "time": scan.time, "ring": scan.ring}
        columns = {axis: scan.points[kept, k] for k, axis in enumerate("xyz")}
        columns |= {name: column[kept] for name, column in named.items() if column is not None}
        return cloud_message(types, columns, header(nanoseconds, "lidar"))

    vector, quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    mount = types["geometry_msgs/msg/Transform"](vector(0.0, 0.0, 0.0), quaternion)
    stamped = types["geometry_msgs/msg/TransformStamped"](header(0, "lidar"), "imu", mount)
    yield 0, types["tf2_msgs/msg/TFMessage"]([stamped])
    period = sequence.sensor.period
    for index in range(len(sequence)):
        nanoseconds = round(1e9 * index * period)
        yield nanoseconds + round(1e9 * period), partial(cloud, index, nanoseconds)
    times = np.arange(1, round(len(sequence) * period * RATE)) / RATE
    unknown = np.zeros(9)
    for time, turn, force in zip(times, *inertial(sequence, times), strict=True):
        nanoseconds = round(1e9 * float(time))
        named = header(nanoseconds, "imu"), quaternion, unknown, vector(*turn), unknown, vector(*force), unknown
        yield nanoseconds, types["sensor_msgs/msg/Imu"](*named)
