"""The node of `automos ros2` beside a robot that plays a recording at its own rate: what arrives, when, at what cost.

    ENV/bin/python benchmarks/ros2.py RECORDING [--points 30000] [--scans 300] [--best-effort]

ENV has rclpy (`pip install -e ".[dev-ros2]"`, or a ROS 2). Each scan is thinned to so many points, which have their
times if the recording has, as those of most drivers: without them the node searches the timing, beside labelling. A
shorter recording is played once, not to and fro: nothing turns its sweeps back. Prints how many clouds were sent,
labelled and left out, how long after a cloud its labels arrive, and the processor time of the node.
"""

import argparse
import array
import os
import signal
import struct
import subprocess
import sys
import threading
import time

import numpy as np
import psutil
import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2, PointField

import automos

FIELDS = ("x", "y", "z", "intensity", "time")


def cloud_of(scan: automos.Scan, n_points: int) -> PointCloud2:
    """Return a scan as a driver sends it, thinned to `n_points`."""
    rows = np.linspace(0, len(scan) - 1, min(n_points, len(scan))).astype(int)
    intensity = np.zeros(len(scan), np.float32) if scan.intensity is None else scan.intensity
    times = [] if scan.time is None else [scan.time]
    table = np.column_stack([scan.points, intensity, *times])[rows].astype("<f4")
    n, size = len(table), 4 * table.shape[1]
    message = PointCloud2(height=1, width=n, point_step=size, row_step=size * n, is_dense=True)
    named = FIELDS[: table.shape[1]]
    message.fields = [PointField(name=name, offset=4 * k, datatype=7, count=1) for k, name in enumerate(named)]
    message.data = array.array("B", table.tobytes())
    message.header.frame_id = "lidar"
    return message


def main() -> None:
    """Play, count, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording")
    parser.add_argument("--points", type=int, default=30_000)
    parser.add_argument("--scans", type=int, default=300)
    parser.add_argument("--best-effort", action="store_true")
    given = parser.parse_args()
    os.environ |= {"ROS_DOMAIN_ID": str(100 + os.getpid() % 100), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    sequence = automos.open_sequence(given.recording)
    stamps = 0.1 * np.arange(len(sequence)) if sequence.stamps is None else np.asarray(sequence.stamps)
    there = []
    for k in range(min(len(sequence), given.scans)):
        message, passed = cloud_of(sequence[k], given.points), stamps[k] - stamps[0]
        stamp = message.header.stamp
        stamp.sec, stamp.nanosec = 1000 + int(passed), int(1e9 * (passed % 1.0))
        there.append(((stamp.sec, stamp.nanosec), serialize_message(message)))
    command = [sys.executable, "-m", "automos", "ros2", "--ros-args", "-r", "points:=/robot/points"]
    node_process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    rclpy.init()
    robot = rclpy.create_node("robot")
    policy = ReliabilityPolicy.BEST_EFFORT if given.best_effort else ReliabilityPolicy.RELIABLE
    publisher = robot.create_publisher(PointCloud2, "/robot/points", QoSProfile(depth=5, reliability=policy))
    sent: dict[tuple[int, int], float] = {}
    waited: list[float] = []

    def arrived(message: bytes) -> None:  # as it came: what the robot does with it is not the node's cost
        sec, nanosec = struct.unpack_from("<iI", message, 4)
        waited.append(time.monotonic() - sent[sec, nanosec])

    robot.create_subscription(PointCloud2, "/automos/points_labelled", arrived, 10, raw=True)
    spinning = threading.Thread(target=rclpy.spin, args=(robot,), daemon=True)
    spinning.start()
    while publisher.get_subscription_count() == 0:
        if node_process.poll() is not None:
            sys.exit(f"the node has ended: {node_process.communicate()[0]}")
        time.sleep(0.1)
    time.sleep(2.0)
    process = psutil.Process(node_process.pid)
    before, begin = sum(process.cpu_times()[:2]), time.monotonic()
    for (stamp, message), passed in zip(there, stamps - stamps[0], strict=False):
        time.sleep(max(begin + passed - time.monotonic(), 0.0))
        sent[stamp] = time.monotonic()
        publisher.publish(message)
    time.sleep(3.0)
    spent = sum(process.cpu_times()[:2]) - before
    node_process.send_signal(signal.SIGINT)
    printed, _ = node_process.communicate(timeout=60)
    median, late = 1e3 * np.percentile(waited, [50, 95]) if waited else (np.nan, np.nan)
    print(
        f"{len(there)} clouds of {given.points:,} points sent, {len(waited)} came back labelled after {median:.0f} ms "
        f"(95 %: {late:.0f}), {1e3 * spent / max(len(waited), 1):.0f} ms of processor time each, the machine's load "
        f"{os.getloadavg()[0]:.1f}\n{printed.strip().splitlines()[-2]}"
    )
    rclpy.shutdown()
    spinning.join(timeout=10.0)


if __name__ == "__main__":
    main()
