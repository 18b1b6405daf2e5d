"""Clouds in the frame of a map: taken back to the sensor where poses are there, refused where none are."""

import pickle

import numpy as np
import pytest
from bags import _message, _transforms, cloud, columns_of
from street_log import street_log

from automos.core.errors import InputError
from automos.core.geometry import transform
from automos.readers import open_sequence
from automos.readers.bag_topics import is_named_world

pytest.importorskip("rosbags")
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation


def pose(degrees, *xyz):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_euler("z", degrees, degrees=True).as_matrix(), xyz
    return T


PLACES = {"far": pose(100.0, -140.0, 220.0, -3.0), "near": pose(-56.0, -15.0, 18.0, -1.0), "start": np.eye(4)}


class Bag:
    """Writes topics of clouds, odometry and transforms as they come."""

    def __init__(self, path, log):
        self.path, self.log, self.is_ros1 = path, log, path.suffix == ".bag"
        self.types = get_typestore(Stores.ROS1_NOETIC if self.is_ros1 else Stores.ROS2_HUMBLE)
        if self.is_ros1:  # its own definitions come with each bag
            tree = get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
            self.types.register(tree)
        folder = path.with_suffix("")
        self.writer = Writer1(path) if self.is_ros1 else Writer2(folder, version=8, storage_plugin=StoragePlugin.MCAP)

    def __enter__(self):
        self.writer.open()
        return self

    def __exit__(self, *_):
        self.writer.close()
        if not self.is_ros1:
            next(self.path.with_suffix("").glob("*.mcap")).rename(self.path)

    def write(self, topic, messages):
        link = None
        for seconds, message in messages:
            kind = message.__msgtype__
            link = link or self.writer.add_connection(topic, kind, typestore=self.types)
            serialize = self.types.serialize_ros1 if self.is_ros1 else self.types.serialize_cdr
            self.writer.write(link, round(1e9 * seconds), serialize(message, kind))

    def clouds(self, topic, frame, poses=None):
        def every():
            for i, scan in enumerate(self.log.scans):
                columns = columns_of(scan)
                if poses is not None:
                    moved = transform(poses[i], scan.points)
                    columns |= {axis: moved[:, k].astype("f4") for k, axis in enumerate("xyz")}
                message = _message(self.types, float(scan.stamp), cloud(columns), self.is_ros1, frame)
                yield float(scan.stamp), message

        self.write(topic, every())

    def poses(self, topic, frame, poses, kind="nav_msgs/msg/Odometry", stamps=None):
        make = self.types.types
        stamps = self.log.stamps if stamps is None else stamps

        def every():
            for seconds, T in zip(stamps.tolist(), poses, strict=True):
                p = make["geometry_msgs/msg/Point"](*T[:3, 3].tolist())
                q = make["geometry_msgs/msg/Quaternion"](*Rotation.from_matrix(T[:3, :3]).as_quat().tolist())
                held = make["geometry_msgs/msg/Pose"](p, q)
                head = self._header(seconds, frame)
                if kind.endswith("PoseStamped"):
                    yield seconds, make[kind](head, held)
                    continue
                zero = make["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
                twist = make["geometry_msgs/msg/Twist"](zero, zero)
                covariance = np.zeros(36)
                with_covariance = make["geometry_msgs/msg/PoseWithCovariance"](held, covariance)
                if kind.endswith("WithCovarianceStamped"):
                    yield seconds, make[kind](head, with_covariance)
                    continue
                with_twist = make["geometry_msgs/msg/TwistWithCovariance"](twist, covariance)
                yield seconds, make[kind](head, "body", with_covariance, with_twist)

        self.write(topic, every())

    def path_of(self, topic, frame, poses):
        """Write the path so far at every scan."""
        make, held = self.types.types, []
        for seconds, T in zip(self.log.stamps.tolist(), poses, strict=True):
            p = make["geometry_msgs/msg/Point"](*T[:3, 3].tolist())
            q = make["geometry_msgs/msg/Quaternion"](*Rotation.from_matrix(T[:3, :3]).as_quat().tolist())
            pose = make["geometry_msgs/msg/Pose"](p, q)
            held.append((seconds, make["geometry_msgs/msg/PoseStamped"](self._header(seconds, frame), pose)))
        paths = [make["nav_msgs/msg/Path"](self._header(at, frame), [one for _, one in held[: i + 1]])
                 for i, (at, _) in enumerate(held)]  # fmt: skip
        self.write(topic, zip(self.log.stamps.tolist(), paths, strict=True))

    def transforms(self, joints, topic="/tf"):
        """Write (parent, child, (N, 4, 4) at the scans' times) joints."""
        messages = []
        for parent, child, poses in joints:
            for seconds, T in zip(self.log.stamps.tolist(), poses, strict=True):
                xyzw = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
                message = _transforms(self.types, 0, [(parent, child, T[:3, 3].tolist(), xyzw)])
                message.transforms[0].header = self._header(seconds, parent)
                messages.append((seconds, message))
        self.write(topic, messages)

    def _header(self, seconds, frame):
        nanoseconds = round(1e9 * seconds)
        time = self.types.types["builtin_interfaces/msg/Time"](*divmod(nanoseconds, 10**9))
        more = {"seq": 0} if self.is_ros1 else {}
        return self.types.types["std_msgs/msg/Header"](stamp=time, frame_id=frame, **more)


def in_place(log, place="far"):
    return PLACES[place] @ log.poses


def assert_sensors_own(sequence, log, atol=0.02):
    assert len(sequence) == len(log.scans)
    for got, true in zip(sequence, log.scans, strict=True):
        np.testing.assert_allclose(got.points, true.points, atol=atol)


@pytest.mark.parametrize("name", ["log.bag", "log.mcap"])
@pytest.mark.parametrize("place", PLACES)
def test_registered_clouds_are_taken_back_by_the_odometry_that_came_with_them(tmp_path, name, place):
    log = street_log()
    with Bag(tmp_path / name, log) as bag:
        bag.clouds("/cloud_registered", "camera_init", in_place(log, place))
        bag.poses("/Odometry", "camera_init", in_place(log, place))
    sequence = pickle.loads(pickle.dumps(open_sequence(tmp_path / name)))
    assert_sensors_own(sequence, log)
    assert sequence.is_compensated
    np.testing.assert_allclose(sequence.reference_poses, log.poses, atol=1e-6)


def test_a_path_has_the_poses_of_all_scans_in_its_last_message(tmp_path):
    log = street_log()
    with Bag(tmp_path / "log.bag", log) as bag:
        bag.clouds("/cloud_registered", "camera_init", in_place(log))
        bag.path_of("/path", "camera_init", in_place(log))
    assert_sensors_own(open_sequence(tmp_path / "log.bag"), log)


KINDS = ["nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"]


@pytest.mark.parametrize("kind", KINDS)
def test_poses_may_be_any_topics_at_other_times_and_among_others(tmp_path, kind):
    log = street_log()
    dense = np.linspace(log.stamps[0] - 0.2, log.stamps[-1] + 0.2, 200)
    from automos.core.pose_files import interpolate_poses

    with Bag(tmp_path / "log.mcap", log) as bag:
        bag.clouds("/slam/points", "map", in_place(log))
        bag.poses("/wheels", "odom", log.poses)  # in another frame
        bag.poses("/slam/pose", "map", interpolate_poses(log.stamps, in_place(log), dense), kind, dense)
        bag.poses("/goal", "map", in_place(log, "near"), kind)  # of something else
    assert_sensors_own(open_sequence(tmp_path / "log.mcap"), log, atol=0.05)


@pytest.mark.parametrize("name", ["log.mcap", "log.bag"])
def test_transforms_from_the_map_by_the_odometry_to_the_lidar_are_put_together(tmp_path, name):
    log = street_log()
    T_base_lidar, T_map_odom = pose(30.0, 1.2, 0.0, 1.8), PLACES["far"]
    T_odom_base = log.poses @ np.linalg.inv(T_base_lidar)
    still = np.broadcast_to
    with Bag(tmp_path / name, log) as bag:
        bag.clouds("/points_in_map", "map", T_map_odom @ T_odom_base @ T_base_lidar)
        shape = (len(log.scans), 4, 4)
        bag.transforms([("map", "odom", still(T_map_odom, shape)), ("odom", "base_link", T_odom_base)])
        bag.transforms([("base_link", "lidar", still(T_base_lidar, shape))], "/tf_static")
    sequence = open_sequence(tmp_path / name)
    assert_sensors_own(sequence, log)


def test_odometry_of_a_vehicle_goes_on_to_the_lidar_that_is_mounted_on_it(tmp_path):
    log, T_body_lidar = street_log(), pose(0.0, 1.0, 0.0, 1.6)
    with Bag(tmp_path / "log.mcap", log) as bag:
        bag.clouds("/cloud_registered", "camera_init", in_place(log))
        bag.poses("/Odometry", "camera_init", in_place(log) @ np.linalg.inv(T_body_lidar))
        bag.transforms([("body", "velodyne", np.broadcast_to(T_body_lidar, (len(log.scans), 4, 4)))], "/tf_static")
    assert_sensors_own(open_sequence(tmp_path / "log.mcap"), log)


def test_without_poses_they_are_refused_and_the_message_says_why(tmp_path):
    log = street_log()
    with Bag(tmp_path / "log.bag", log) as bag:
        bag.clouds("/cloud_registered", "camera_init", in_place(log, "near"))
    with pytest.raises(
        InputError, match=r"log.bag/cloud_registered holds clouds in a world frame \('camera_init'\).*recor"
    ):
        open_sequence(tmp_path / "log.bag")
    with Bag(tmp_path / "short.bag", log) as bag:
        bag.clouds("/cloud_registered", "camera_init", in_place(log, "near"))
        bag.poses("/Odometry", "camera_init", in_place(log)[:3], stamps=log.stamps[:3])
    with pytest.raises(InputError, match=r"world frame \('camera_init'\).*\(.*Odometry has no pose for scan \d"):
        open_sequence(tmp_path / "short.bag")


@pytest.mark.parametrize("frame", ["", "velodyne", "my_frame"])
def test_clouds_far_from_their_origin_are_a_worlds_whatever_it_is_called(tmp_path, frame):
    log = street_log()
    with Bag(tmp_path / "log.bag", log) as bag:
        bag.clouds("/points", frame, in_place(log))
    with pytest.raises(InputError, match=rf"holds clouds in a world frame \('{frame}'\), not in the sensor's"):
        open_sequence(tmp_path / "log.bag")
    with Bag(tmp_path / "tf.mcap", log) as bag:
        bag.clouds("/points", "my_frame", in_place(log))
        bag.transforms([("my_frame", "base", in_place(log))])
    assert_sensors_own(open_sequence(tmp_path / "tf.mcap"), log)


def test_the_sensors_own_topic_is_preferred_and_the_other_can_be_named(tmp_path):
    log = street_log()
    with Bag(tmp_path / "log.mcap", log) as bag:
        bag.clouds("/a/cloud_registered", "odom", in_place(log))
        bag.clouds("/raw", "os_sensor", None)
        bag.poses("/odometry", "odom", in_place(log))
    sequence = open_sequence(tmp_path / "log.mcap")
    assert_sensors_own(sequence, log, atol=0)
    assert sequence.is_compensated is None
    assert sequence.about["frame"] == "the sensor's own (os_sensor)"
    assert any(
        "/a/cloud_registered holds clouds in a map's frame; those of /raw are taken" in w for w in sequence.warnings
    )
    named = open_sequence(tmp_path / "log.mcap" / "a" / "cloud_registered")
    assert_sensors_own(named, log)
    assert named.about["frame"] == "a map's, from which they were taken back (odom)"


@pytest.mark.parametrize("has_poses", [False, True])
@pytest.mark.parametrize("frame", ["map", "world", "odom"])
def test_a_sensors_clouds_that_are_only_called_a_maps_are_the_sensors(tmp_path, frame, has_poses):
    log = street_log()
    with Bag(tmp_path / "log.mcap", log) as bag:
        bag.clouds("/kitti/velo", frame, None)
        if has_poses:
            bag.poses("/gps/odometry", frame, in_place(log, "near"))
    assert_sensors_own(open_sequence(tmp_path / "log.mcap"), log, atol=0)


@pytest.mark.parametrize(
    "frame", ["map", "odom", "camera_init", "world", "global_map", "robot1/odom", "odom_lidar", "map2"]
)
def test_names_of_frames_that_sensors_move_in(frame):
    assert is_named_world(frame)


@pytest.mark.parametrize(
    "frame", ["velodyne", "os_sensor", "base_link", "livox_frame", "mapper_lidar", "body", "modem"]
)
def test_names_of_frames_that_move_with_a_sensor(frame):
    assert not is_named_world(frame)
