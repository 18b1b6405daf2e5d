"""What a bag's topics tell: which one holds the points of its LiDAR, and where things are.

The points are on the topic that is named, else on the only one of the best kind. Places are told by `/tf`,
`/tf_static`, and the topics of odometry and of poses.
"""

import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from automos.core.errors import InputError
from automos.core.scan import Array, Pose
from automos.readers.bag import Bag
from automos.readers.bag_messages import CLOUD, PACKETS, TREES, Topic, decoded, head, head_size, is_of_points, is_raw
from automos.readers.stamped_poses import from_quaternions, poses_at

_ODOMETRY = "nav_msgs/msg/Odometry"
_WORLDS = r"(^|[_/])(map|odom|world|global|earth|init|local_origin|enu|utm|gravity)(\d*$|[_/])"


def choose_topic(bag: Bag, wanted: str | None) -> tuple[Topic, list[str]]:
    """Return the topic to read, the one that is `wanted` or the only one, and what to say of others.

    Clouds in the sensor's frame come before its packets, and these before clouds in the frame of a map.

    Raises
    ------
    InputError
        There is no such topic, or there are several.
    """
    clouds = [topic for topic in bag.topics if is_of_points(topic)]
    if wanted is not None:
        match = next((topic for topic in clouds if topic.name.strip("/") == wanted), None)
        if match is None:
            names = ", ".join(topic.name for topic in clouds) or "none"
            raise InputError(f"{bag.path} has no topic /{wanted} of point clouds; it has: {names}")
        return match, []
    if not clouds:
        raise InputError(_no_clouds(bag))
    if len(clouds) == 1:
        return clouds[0], []
    ranks = {topic: _rank(bag, topic) for topic in clouds}
    best = [topic for topic in clouds if ranks[topic] == min(ranks.values())]
    if len(best) > 1:
        names, first = ", ".join(topic.name for topic in best), bag.path / best[0].name.strip("/")
        raise InputError(
            f"{bag.path} has {len(best)} topics of point clouds ({names}); give one, as {first}, or several, joined by "
            "+, to merge them"
        )
    worlds = ", ".join(topic.name for topic in clouds if ranks[topic] == 2 > ranks[best[0]])
    said = f"{bag.path}: {worlds} holds clouds in a map's frame; those of {best[0].name} are taken."
    return best[0], [said] if worlds else []


def _rank(bag: Bag, topic: Topic) -> int:
    """Return 0 for clouds in a sensor's frame, 1 for packets, 2 for clouds in a map's, 3 where there are none."""
    if len(bag.index(topic)) == 0:
        return 3
    frame = frame_of(bag, topic)
    if is_named_world(frame) or frame in odometry_frames(bag):
        return 2
    return 1 if topic.kind in PACKETS else 0


def frame_of(bag: Bag, topic: Topic) -> str:
    """Return the frame that the first message of a topic names."""
    return head(bag.read(bag.index(topic)[0], head_size(topic)), topic)[1]


def is_named_world(frame: str) -> bool:
    """Return whether a frame is called as those that sensors move in are; some drivers call the sensor's own so."""
    return re.search(_WORLDS, frame.lower()) is not None


def odometry_frames(bag: Bag) -> set[str]:
    """Return the frames in which topics of odometry tell where something is."""
    topics = [topic for topic in bag.topics if topic.kind == _ODOMETRY and len(bag.index(topic))]
    return {frame_of(bag, topic) for topic in topics}


def _no_clouds(bag: Bag) -> str:
    packets = [topic for topic in bag.topics if is_raw(topic)]
    if packets:
        names = _named(packets[:5])
        return (
            f"{bag.path} holds a sensor's packets or compressed clouds ({names}), which are not decoded here; play it "
            f"through the maker's ROS driver and record the {CLOUD} that this publishes"
        )
    others = _named(bag.topics[:10]) or "none"
    return (
        f"{bag.path} has no topic of type {CLOUD}, of Livox's CustomMsg, of packets that are known, or "
        f"foxglove.PointCloud; its topics are: {others}"
    )


def _named(topics: list[Topic]) -> str:
    """Return topics with the types of their messages, and how these are packed where ROS does not do it so."""
    told = [(topic.name, topic.kind, "" if topic.encoding in ("cdr", "ros1") else topic.encoding) for topic in topics]
    return ", ".join(f"{name} ({', '.join(filter(None, about))})" for name, *about in told)


_LIDAR = r"lidar|laser|velo|livox|ouster|os_|hesai|pandar|rslidar|scan"
_POSES = ("nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped")
_PATH = "nav_msgs/msg/Path"


State = tuple[float, list[float], list[float]]
"""When something was where: seconds, translation in metres, and quaternion, scalar last."""


class Joint(NamedTuple):
    """A frame's pose in its parent at a time; of poses that name no frame, the child is empty."""

    parent: str
    child: str
    state: State


def joints_of(bag: Bag, name: str) -> Iterator[Joint]:
    """Yield the transforms on topic `name`, /tf or /tf_static, in the order they were recorded."""
    topics = [topic for topic in bag.topics if topic.name == name and topic.kind in TREES]
    for message in _messages(bag, topics):
        for joint in message.transforms:
            yield _joint(joint, joint.transform.translation, joint.transform.rotation)


def _joint(message: Any, position: Any, rotation: Any) -> Joint:
    p, q, stamp = position, rotation, message.header.stamp
    child = getattr(message, "child_frame_id", "")
    state = float(stamp.sec + 1e-9 * stamp.nanosec), [p.x, p.y, p.z], [q.x, q.y, q.z, q.w]
    return Joint(message.header.frame_id.strip("/"), child.strip("/"), state)


def poses_in(bag: Bag, frame: str, stamps: Array) -> tuple[list[Pose], list[str]]:
    """Return (N, 4, 4) poses in `frame` at `stamps` (N,), likeliest the LiDAR's first; and why there are no others.

    A frame of the tree that is called after a LiDAR is it; else what odometry tells of is its vehicle, or the frame
    where the tree begins to branch: wheels turn on it.
    """
    told, faults = list[Pose](), list[str]()
    found: dict[str, Pose] = {frame: np.tile(np.eye(4), (len(stamps), 1, 1))}
    children: dict[str, list[str]] = {}
    for topic in bag.topics:
        poses = [joint for joint in _poses_on(bag, topic) if joint.parent == frame]
        if poses:
            with noted(faults):
                told.append(_at(stamps, [pose.state for pose in poses], bag.path / topic.name.strip("/")))
                child = poses[0].child
                if child and found.setdefault(child, told[-1]) is told[-1]:
                    children.setdefault(frame, []).append(child)
    moving, fixed = _by_child(joints_of(bag, "/tf")), _by_child(joints_of(bag, "/tf_static"))
    joints = moving | fixed
    todo = list(found)
    for parent in todo:
        for of, child in joints:
            if of != parent or child in found:
                continue
            with noted(faults):
                where, states = bag.path / "tf" / child, joints[of, child]
                is_fixed = (of, child) in fixed
                T = from_quaternions(*states[-1][1:], where) if is_fixed else _at(stamps, states, where)
                found[child] = found[parent] @ T
                children.setdefault(parent, []).append(child)
                todo.append(child)
    body = frame
    while len(children.get(body, ())) == 1:
        (body,) = children[body]
    lidars = [child for child in found if re.search(_LIDAR, child.lower())]
    others = sorted(set(found) - {frame, *lidars}, key=lambda child: (child != body, child))
    return [*(found[child] for child in lidars if child != frame), *told, *(found[child] for child in others)], faults


@contextmanager
def noted(faults: list[str]) -> Iterator[None]:
    """Put what an InputError of the block says to the `faults`: what it is about may not be needed."""
    try:
        yield
    except InputError as fault:
        faults.append(str(fault))


def _by_child(joints: Iterator[Joint]) -> dict[tuple[str, str], list[State]]:
    found: dict[tuple[str, str], list[State]] = {}
    for parent, child, state in joints:
        found.setdefault((parent, child), []).append(state)
    return found


def _at(stamps: Array, states: list[State], where: Path) -> Pose:
    times, translations, xyzw = zip(*states, strict=True)
    return poses_at(stamps, np.array(times), from_quaternions(translations, xyzw, where), where)


def _messages(bag: Bag, topics: list[Topic]) -> Iterator[Any]:
    for topic in topics:
        for row in bag.index(topic):
            yield decoded(bag.read(row), topic)


def _poses_on(bag: Bag, topic: Topic) -> Iterator[Joint]:
    """Yield the poses on a topic, or those in its last path, which has those of all before it."""
    messages: Iterable[Any] = _messages(bag, [topic]) if topic.kind in _POSES else ()
    if topic.kind == _PATH:
        messages = (pose for row in bag.index(topic)[-1:] for pose in decoded(bag.read(row), topic).poses)
    for message in messages:
        pose = getattr(message.pose, "pose", message.pose)
        yield _joint(message, pose.position, pose.orientation)
