"""ROS 1 bags, ROS 2 bags and MCAP files: one topic of point clouds, or several merged.

A topic is named as if the bag were a folder: `log.mcap/front/points`; several are joined by a plus sign.
"""

from __future__ import annotations

from pathlib import Path

from automos.core.scan import Sequence
from automos.readers.formats import Format
from automos.readers.rosbag_topic import RosbagSequence, is_bag


def find(path: Path) -> list[Path]:
    """Return the bags at `path`: itself, a topic of it, or those that lie in it by name."""
    if is_bag(path):
        return [path]
    if not path.exists():
        return [path] if any(is_bag(parent) for parent in path.parents) else []
    return sorted(p for p in path.iterdir() if not p.name.startswith(".") and is_bag(p)) if path.is_dir() else []


def open_bag(path: Path) -> Sequence:
    """Return the topic, or the merged topics, of the bag at or above `path`."""
    from automos.readers.merged_bag import MergedBagSequence

    bag = path if path.exists() else next(parent for parent in path.parents if is_bag(parent))
    topics = [] if path == bag else path.relative_to(bag).as_posix().split("+")
    return MergedBagSequence(bag, topics) if len(topics) > 1 else RosbagSequence(path)


FORMAT = Format(
    layout="ROS 1 .bag, ROS 2 bag (folder, .db3, .mcap), MCAP; of several LiDARs give one: log.mcap/front/points, or "
    "several merged: log.mcap/front/points+rear/points",
    truth="",
    find=find,
    open=open_bag,
    needs="ros",
)
