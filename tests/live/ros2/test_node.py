"""The node on genuine ROS 2: another process is labelled by it, and this one plays the robot that checks every byte.

Needs rclpy and messages, of a ROS 2 or of the wheels `ros-kilted-*`: `pip install -e ".[dev-ros2]"`, an environment of
its own, because these start Python anew with other search paths.
"""

import array
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from bags import cloud, columns_of
from street_log import street_log

from automos.readers.point_cloud2 import read_columns

rclpy = pytest.importorskip("rclpy", reason="pip install -e '.[dev-ros2]' in an environment of its own")
# ruff: noqa: E402
from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2, PointField
from visualization_msgs.msg import Marker, MarkerArray

N_SCANS = 12


def message_of(index, **options):
    """Return scan `index` of a street as a driver sends it."""
    parts = cloud(columns_of(street_log().scans[index]), **options)
    message = PointCloud2(
        height=parts.height,
        width=parts.width,
        fields=[PointField(name=n, offset=o, datatype=c, count=1) for n, o, c in parts.fields],
        is_bigendian=parts.is_bigendian,
        point_step=parts.point_step,
        row_step=parts.row_step,
        data=array.array("B", parts.data.tobytes()),
    )
    message.header.frame_id = "roof"
    message.header.stamp.sec, message.header.stamp.nanosec = 1000 + index // 10, 100_000_000 * (index % 10)
    return message


class Robot:
    """A process of its own beside the node's: sends clouds, and keeps all that comes back, by topic."""

    def __init__(self, reliability):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("robot", context=self.context)
        self.executor = rclpy.executors.SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.clouds = self.node.create_publisher(
            PointCloud2, "/roof/points", QoSProfile(depth=5, reliability=reliability)
        )
        self.got = {}
        for topic, kind in (
            ("points_labelled", PointCloud2),
            ("points_static", PointCloud2),
            ("odometry", Odometry),
            ("boxes", MarkerArray),
        ):
            self.got[topic] = []
            self.node.create_subscription(kind, f"/automos/{topic}", self.got[topic].append, 50)

    def spin(self, seconds, until=lambda: False):
        """Let messages come until there are enough; return whether there are."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and not until():
            self.executor.spin_once(timeout_sec=0.05)
        return until()

    def close(self):
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture(autouse=True)
def domain(monkeypatch):
    """Talk to nobody else."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(100 + os.getpid() % 100))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


@pytest.fixture
def node():
    """Return the command, running."""
    command = [sys.executable, "-m", "automos", "ros2", "--ros-args", "-r", "points:=/roof/points"]
    command += ["-p", "lidar_odom_frame:=map"]
    started = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    yield started
    if started.poll() is None:
        started.kill()
    started.wait()


@pytest.mark.parametrize("reliability", [ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT])
def test_every_cloud_comes_back_with_its_bytes_its_stamp_and_what_moves(node, reliability):
    robot = Robot(reliability)
    try:
        assert robot.spin(120.0, lambda: robot.clouds.get_subscription_count() > 0), "the node does not subscribe"
        robot.spin(1.0)
        sent = {}
        for index in range(N_SCANS):
            message = message_of(index)
            sent[message.header.stamp.sec, message.header.stamp.nanosec] = message
            robot.clouds.publish(message)
            robot.spin(20.0, lambda index=index: min(map(len, robot.got.values())) > index)
        assert {topic: len(found) for topic, found in robot.got.items()} == dict.fromkeys(robot.got, N_SCANS)
        n_moving = 0
        for labelled, static, path, boxes in zip(*robot.got.values(), strict=True):
            was = sent[labelled.header.stamp.sec, labelled.header.stamp.nanosec]
            assert labelled.header == was.header == static.header
            assert (labelled.height, labelled.width) == (was.height, was.width)
            assert labelled.fields[:-1] == was.fields
            rows = np.array(was.data, np.uint8).reshape(-1, was.point_step)
            wider = np.array(labelled.data, np.uint8).reshape(-1, labelled.point_step)
            np.testing.assert_array_equal(wider[:, :-1], rows)
            moving = read_columns(labelled, "it")["moving"]
            np.testing.assert_array_equal(
                np.array(static.data, np.uint8).reshape(-1, static.point_step), rows[moving == 0]
            )
            assert (path.header.stamp, path.header.frame_id, path.child_frame_id) == (was.header.stamp, "map", "roof")
            assert boxes.markers[0].action == Marker.DELETEALL
            assert all(marker.header.frame_id == "map" for marker in boxes.markers)
            n_moving += int((moving == 1).sum())
        assert n_moving > 0
        assert any(len(boxes.markers) > 1 for boxes in robot.got["boxes"])
        first, last = (robot.got["odometry"][k].pose.pose.position for k in (0, -1))
        driven = np.linalg.norm([last.x - first.x, last.y - first.y, last.z - first.z])
        np.testing.assert_allclose(driven, np.linalg.norm(street_log().poses[N_SCANS - 1][:3, 3]), atol=0.2)
    finally:
        robot.close()
    node.send_signal(signal.SIGINT)
    printed, _ = node.communicate(timeout=60)
    assert node.returncode == 0, printed
    assert f"{N_SCANS} scans labelled, 0 left out" in printed


def test_clouds_that_are_none_are_left_out_and_the_node_goes_on(node):
    robot = Robot(ReliabilityPolicy.RELIABLE)
    try:
        assert robot.spin(120.0, lambda: robot.clouds.get_subscription_count() > 0)
        robot.spin(1.0)
        damaged = message_of(0)
        damaged.width += 1
        robot.clouds.publish(damaged)
        robot.spin(1.0)
        robot.clouds.publish(message_of(1))
        assert robot.spin(20.0, lambda: len(robot.got["boxes"]) == 1)
    finally:
        robot.close()
    node.send_signal(signal.SIGINT)
    printed, _ = node.communicate(timeout=60)
    assert node.returncode == 0, printed
    assert "is left out" in printed
    assert "2 clouds arrived" in printed
