"""A simulated sequence on disk, in SemanticKITTI's layout, with its truth; and as a robot keeps it, a ROS 2 bag.

OUT/velodyne/000000.bin     float32 x, y, z, intensity
OUT/labels/000000.label     uint32: 9, 251 or 0 below, instance ids above; moving = moves at some time while observed
OUT/labels_now/000000.label the same, moving = moves during this sweep
OUT/boxes/000000.json       objects with points in this scan, in the level frame, and T_level_sensor
OUT/poses.txt, calib.txt (Tr is the identity: poses are the sensor's), times.txt (mid-sweep)
OUT/simulation.json         what was asked for; marks the folder as ours
OUT/bag                     MCAP with the sweeps, an IMU, and where both are mounted, if asked for:
    /points    sensor_msgs/PointCloud2 with x y z intensity t ring, stamped at the start of the sweep
    /imu       sensor_msgs/Imu there, without noise: angular velocity, and acceleration with what holds it up
    /tf_static from the LiDAR to the IMU, the identity
"""

import json
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.atomic import faults_reported, write_raw, write_text
from automos.core.claims import SIMULATION
from automos.core.extras import import_extra
from automos.core.geometry import Array, inverse, se3_log
from automos.core.own_folder import own_folder
from automos.core.parallel import map_in_order
from automos.core.pose_writers import write_kitti
from automos.core.run import Progress, silent
from automos.readers.point_cloud2 import cloud_message
from automos.simulation.sequence import FORMAT, SimulatedSequence

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
        columns = {**dict(zip("xyz", scan.points.T, strict=True)), "intensity": scan.intensity}
        columns |= {"time": scan.time, "ring": scan.ring}
        columns = {name: column[scan.is_valid] for name, column in columns.items() if column is not None}
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


MARKER = "simulation.json"
_FOLDERS = ("velodyne", "labels", "labels_now", "boxes")
_IDENTITY = "1 0 0 0 0 1 0 0 0 0 1 0"


def write(
    sequence: SimulatedSequence,
    out: str | Path,
    workers: int = 1,
    progress: Progress = silent,
    bag: bool = False,
) -> Path:
    """Write `sequence` with its truth to folder `out` and return the folder; an interrupted run goes on.

    With `bag`, `out / bag` is the same as a robot keeps it, with an IMU: see `bag`.

    Every file is whole or not there. `workers` processes share the scans (0: one per core); the bytes do not depend on
    their number. `progress` is called with ("simulate", done, total).

    Raises
    ------
    InputError
        `out` exists and is not a simulated sequence, or another one, or cannot be written.
    """
    if bag:
        import_extra("rosbags", "ros")
    out = Path(out)
    about = {"format": FORMAT, "scenario": sequence.scenario, "sensor": sequence.sensor.name, "scans": len(sequence)}
    about |= {"seed": sequence.seed, "compensated": sequence.is_compensated}
    with own_folder(out, SIMULATION, MARKER, about):
        for name in _FOLDERS:
            (out / name).mkdir(exist_ok=True)
        _write_all(sequence, out, workers, progress)
        if bag:
            write_bag(sequence, out / "bag")
    return out


def _write_all(sequence: SimulatedSequence, out: Path, workers: int, progress: Progress) -> None:
    write_text(out / "calib.txt", "".join(f"{name}: {_IDENTITY}\n" for name in ("P0", "P1", "P2", "P3", "Tr")))
    write_text(out / "times.txt", "".join(f"{stamp:.6f}\n" for stamp in sequence.stamps))
    write_kitti(out / "poses.txt", sequence.reference_poses)
    todo = [k for k, name in enumerate(sequence.names) if not (out / "boxes" / f"{name}.json").exists()]
    written = map_in_order(partial(_write_scan, sequence, out), todo, workers)
    for done, _ in enumerate(written, len(sequence) - len(todo) + 1):
        progress("simulate", done, len(sequence))


def _write_scan(sequence: SimulatedSequence, out: Path, index: int) -> None:
    name = sequence.names[index]
    scan = sequence[index]
    assert scan.intensity is not None
    write_raw(out / "velodyne" / f"{name}.bin", np.column_stack([scan.points, scan.intensity]))
    write_raw(out / "labels" / f"{name}.label", sequence.truth(index))
    write_raw(out / "labels_now" / f"{name}.label", sequence.truth_now(index))
    # Last, because a scan whose boxes are there counts as written.
    write_text(out / "boxes" / f"{name}.json", json.dumps(_boxes_as_json(sequence, index)) + "\n")


def _boxes_as_json(sequence: SimulatedSequence, index: int) -> dict[str, object]:
    found = sequence.boxes(index)
    center, size, yaw = np.round(found.boxes.center, 4), np.round(found.boxes.size, 4), np.round(found.boxes.yaw, 5)
    motion, kinds = (found.is_moving, found.is_moving_now), np.array(found.kinds)
    columns = (column.tolist() for column in (found.ids, kinds, center, size, yaw, *motion, found.n_points))
    keys = ("id", "kind", "center", "size", "yaw", "moving", "moving_now", "points")
    return {
        "stamp": round(float(sequence.stamps[index]), 6),
        "T_level_sensor": np.round(sequence.T_level_world @ sequence.reference_poses[index], 9).tolist(),
        "boxes": [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)],
    }
