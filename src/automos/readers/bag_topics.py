"""Which topic of a bag holds the points of its LiDAR: the one that is named, else the only one of the best kind."""

import re

from automos.core.errors import InputError
from automos.readers.bag import Bag
from automos.readers.bag_file import Topic
from automos.readers.bag_messages import CLOUD, PACKETS, head, head_size, is_of_points, is_raw

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
    of_ros = ("cdr", "ros1")
    kinds = [", ".join(filter(None, [t.kind, "" if t.encoding in of_ros else t.encoding])) for t in topics]
    return ", ".join(f"{topic.name} ({kind})" for topic, kind in zip(topics, kinds, strict=True))
