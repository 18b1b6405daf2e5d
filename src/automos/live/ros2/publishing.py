"""What the node publishes of each labelled scan: clouds, odometry, boxes, and transforms where they are asked for."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.errors import MissingExtraError
from automos.core.geometry import inverse, quaternion_of
from automos.core.labels import Label
from automos.core.scan import Pose, Scan
from automos.labeler import LabelledScan
from automos.live.ros2.feed import Body, RosFeed, new_field, with_field, with_rows
from automos.readers.stamped_poses import from_quaternions

_DEPTH = 5
"""Messages of a topic that wait for who reads them: what is sent again after a loss is still there."""
RED = (0.9, 0.3, 0.3, 0.6)


class Publisher:
    """A sink that publishes every labelled scan with the stamp of its cloud.

    ROS parameters
    --------------
    lidar_odom_frame : frame of the odometry and the boxes: z up, the ground under the first scan at 0.
    base_frame : whose odometry it is; the cloud's own frame if empty. Another one needs tf2_ros.
    publish_odom_tf : whether the transform from lidar_odom_frame is sent to /tf.
    """

    def __init__(self, feed: RosFeed):
        """Declare the parameters and make the publishers; MissingExtraError where the messages of one are absent."""
        from nav_msgs.msg import Odometry
        from rclpy.qos import QoSProfile
        from sensor_msgs.msg import PointCloud2
        from visualization_msgs.msg import MarkerArray

        self._feed, self._node = feed, feed.node
        declare = self._node.declare_parameter
        self._odom_frame = str(declare("lidar_odom_frame", "odom_lidar").value)
        self._base_frame = str(declare("base_frame", "").value)
        sends_tf = bool(declare("publish_odom_tf", False).value)
        few = QoSProfile(depth=_DEPTH)
        self._labelled = self._node.create_publisher(PointCloud2, "~/points_labelled", few)
        self._static = self._node.create_publisher(PointCloud2, "~/points_static", few)
        self._odometry = self._node.create_publisher(Odometry, "~/odometry", few)
        self._boxes = self._node.create_publisher(MarkerArray, "~/boxes", few)
        self._detections = _detections_publisher(self._node, few)
        self._tf = self._node.create_publisher(_required("tf2_msgs.msg").TFMessage, "/tf", 10) if sends_tf else None
        self._mounts: Any = None
        if self._base_frame:
            tf2_ros = _required("tf2_ros")
            self._mounts = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._mounts, self._node)

    def __call__(self, scan: Scan, given: LabelledScan) -> None:
        """Publish one scan."""
        from std_msgs.msg import Header

        message = self._feed.message(scan.name)
        self._labelled.publish(_changed(message, with_field(message, given.labels), is_wider=True))
        self._static.publish(_changed(message, with_rows(message, given.labels == Label.STATIC)))
        frame, pose = message.header.frame_id, given.pose
        if self._mounts is not None and self._base_frame != frame:
            mount = self._mount(frame)
            if mount is None:
                return
            frame, pose = self._base_frame, of_base(given.pose, mount)
        header = Header(stamp=message.header.stamp, frame_id=self._odom_frame)
        self._odometry.publish(_odometry(header, frame, pose))
        if self._tf is not None:
            self._tf.publish(_transform(header, frame, pose))
        self._boxes.publish(_markers(header, given.objects))
        if self._detections is not None:
            self._detections.publish(_detections(header, given.objects))

    def _mount(self, frame: str) -> Pose | None:
        """Return (4, 4) where the LiDAR sits on the base, None while nobody says so."""
        from rclpy.time import Time

        if not self._mounts.can_transform(self._base_frame, frame, Time()):
            self._node.get_logger().warning(
                f"no transform from {frame} to {self._base_frame} yet: odometry and boxes wait for it",
                throttle_duration_sec=5.0,
            )
            return None
        found = self._mounts.lookup_transform(self._base_frame, frame, Time()).transform
        t, q = found.translation, found.rotation
        return from_quaternions([[t.x, t.y, t.z]], [[q.x, q.y, q.z, q.w]], Path("/tf"))[0]


def of_base(T_odom_lidar: Pose, T_base_lidar: Pose) -> Pose:
    """Return (4, 4) the base's pose in the odometry's frame, whose place and heading are then the base's at first."""
    return T_base_lidar @ T_odom_lidar @ inverse(T_base_lidar)


def _required(module: str) -> Any:
    from importlib import import_module

    try:
        return import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise MissingExtraError(f"{package} is not there: install ros-DISTRO-{package.replace('_', '-')}") from None


def _changed(message: Any, body: Body, is_wider: bool = False) -> Any:
    """Return a cloud like `message` with other points; `is_wider` with a field more."""
    from sensor_msgs.msg import PointCloud2, PointField

    return PointCloud2(
        header=message.header,
        fields=[*message.fields, *([new_field(message, PointField)] if is_wider else [])],
        is_bigendian=message.is_bigendian,
        is_dense=message.is_dense,
        **body._asdict(),
    )


def _fill(message: Any, names: str, values: npt.NDArray) -> None:
    """Put `values` into the fields of a message that have these `names`, of a letter each."""
    for name, value in zip(names, values.tolist(), strict=True):
        setattr(message, name, value)


def _odometry(header: Any, child: str, T: Pose) -> Any:
    from nav_msgs.msg import Odometry

    message = Odometry(header=header, child_frame_id=child)
    _fill(message.pose.pose.position, "xyz", T[:3, 3])
    _fill(message.pose.pose.orientation, "xyzw", quaternion_of(T))
    return message


def _transform(header: Any, child: str, T: Pose) -> Any:
    from geometry_msgs.msg import TransformStamped

    message = TransformStamped(header=header, child_frame_id=child)
    _fill(message.transform.translation, "xyz", T[:3, 3])
    _fill(message.transform.rotation, "xyzw", quaternion_of(T))
    return _required("tf2_msgs.msg").TFMessage(transforms=[message])


def _markers(header: Any, objects: npt.NDArray) -> Any:
    """Return a cube for each object, after what removes those of the scan before."""
    from visualization_msgs.msg import Marker, MarkerArray

    markers = [Marker(header=header, action=Marker.DELETEALL)]
    for thing in objects:
        track = int(thing["track"]) & 0x7FFFFFFF
        marker = Marker(header=header, ns="moving", id=track, type=Marker.CUBE, action=Marker.ADD)
        _fill_box(marker.pose, marker.scale, thing)
        marker.color.r, marker.color.g, marker.color.b, marker.color.a = RED
        markers.append(marker)
    return MarkerArray(markers=markers)


def _fill_box(pose: Any, size: Any, thing: Any) -> None:
    half = 0.5 * thing["yaw"]
    _fill(pose.position, "xyz", thing["center"])
    _fill(pose.orientation, "zw", np.array([np.sin(half), np.cos(half)]))
    _fill(size, "xyz", thing["size"])


def _detections_publisher(node: Any, quality: Any) -> Any:
    """Return the publisher of vision_msgs' boxes, None where there are no such messages."""
    try:
        from vision_msgs.msg import Detection3DArray
    except ImportError:
        return None
    return node.create_publisher(Detection3DArray, "~/detections", quality)


def _detections(header: Any, objects: npt.NDArray) -> Any:
    from vision_msgs.msg import Detection3D, Detection3DArray

    message = Detection3DArray(header=header)
    for thing in objects:
        found = Detection3D(header=header, id=str(thing["track"]))
        _fill_box(found.bbox.center, found.bbox.size, thing)
        message.detections.append(found)
    return message
