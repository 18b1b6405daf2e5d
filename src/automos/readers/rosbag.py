"""ROS 1 bags, ROS 2 bags and MCAP files: one topic of point clouds, or several merged.

A topic is named as if the bag were a folder: `log.mcap/front/points`; several are joined by a plus sign.
"""

from pathlib import Path

from automos.core.scan import Sequence
from automos.readers.bag import drives_of, is_bag, split_address
from automos.readers.formats import Format
from automos.readers.rosbag_topic import RosbagSequence


def find(path: Path) -> list[Path]:
    """Return the bags at `path`: itself, a topic of it, or those that lie in it by name, one for each drive."""
    if is_bag(path):
        return [path]
    if not path.is_dir():
        return [path] if any(is_bag(parent) for parent in path.parents) else []
    return [first if not more else first.with_name(f"{first.name}+") for first, *more in drives_of(path)]


def open_bag(path: Path) -> Sequence:
    """Return the topic, or the merged topics, of the bag at or above `path`."""
    from automos.readers.merged_bag import MergedBagSequence

    bag, topic = split_address(path)
    topics = (topic or "").split("+")
    return MergedBagSequence(bag, topics) if len(topics) > 1 else RosbagSequence(path)


FORMAT = Format(
    layout="a bag: ROS 1 .bag, ROS 2 bag (folder, .db3, .mcap), MCAP; of several LiDARs give one: "
    "log.mcap/front/points, or several merged: log.mcap/front/points+rear/points",
    truth="",
    find=find,
    open=open_bag,
    needs="ros",
)
