"""ROS 1 bags, ROS 2 bags and MCAP files: one topic of point clouds, or several merged.

A topic is named as if the bag were a folder: `log.mcap/front/points`. Several are joined by a plus sign,
`log.mcap/front/points+rear/points`, and are one recording: the LiDARs of a vehicle merged, each where `/tf_static` says
that it sits. The first gives the scans, their times and their frame; of the others, the message nearest in time is
taken, if one is nearer than half the time between scans.
"""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import inverse, transform
from automos.core.scan import Array, Ints, Mask, Pose, Scan, Sequence
from automos.readers.bag import Bag, drives_of, is_bag, name_of, reported, split_address
from automos.readers.bag_topics import joints_of, noted
from automos.readers.formats import Format
from automos.readers.rosbag_topic import RosbagSequence
from automos.readers.stamped_poses import from_quaternions


class MergedBagSequence(Sequence):
    """The point clouds of several topics, one scan for each message of the first, whose stamps are the scans'."""

    source: Path
    address: Path | None = None
    stamps: Array | None = None

    def __init__(self, bag: Path, topics: list[str]):
        """Find the messages of `topics`, named below `bag`, and where their LiDARs sit.

        Raises
        ------
        InputError
            Those of a single topic; clouds without times; a LiDAR that /tf_static does not join to the first.
        """
        self.source, self.address = bag, bag / "+".join(topics)
        plain = [topic.strip("/") for topic in topics]
        twice = next((topic for topic in plain if plain.count(topic) > 1), None)
        if twice is not None:
            raise InputError(f"{self.address} names the topic /{twice} twice; name each topic once")
        self._parts = [RosbagSequence(bag / topic) for topic in topics]
        self.stamps = self._parts[0].stamps
        self.name = f"{name_of(bag)}_{'+'.join(topics).replace('/', '_')}"
        self._mounts = _find_mounts(self._parts, topics)
        self._rows = np.stack([self._rows_of(part) for part in self._parts])

    def __len__(self) -> int:
        return len(self._parts[0])

    def __getitem__(self, index: int) -> Scan:
        rows = self._rows[:, self._scan_number(index)]
        sensors = np.flatnonzero(rows >= 0).tolist()
        scans = [self._parts[k][rows[k]] for k in sensors]
        return Scan(
            np.concatenate([transform(self._mounts[k], scan.points) for k, scan in zip(sensors, scans, strict=True)]),
            intensity=_joined([scan.intensity for scan in scans]),
            time=_times(scans),
            ring=_joined([scan.ring for scan in scans]),
            stamp=scans[0].stamp,
            name=scans[0].name,
            sensor=np.repeat(np.array(sensors, np.uint8), list(map(len, scans))),
            T_scan_sensor=self._mounts,
        )

    @property
    def warnings(self) -> list[str]:
        """What is wrong with any of the topics."""
        return [warning for part in self._parts for warning in part.warnings]

    @property
    def repeats(self) -> Mask:
        """(len,) bool: scans to which every topic gives the points of the one before."""
        repeats = np.ones(len(self), bool)
        for part, rows in zip(self._parts, self._rows, strict=True):
            step = np.diff(rows, prepend=rows[:1])
            repeats &= (step == 0) | ((step == 1) & part.repeats[rows])
        repeats[:1] = False
        return repeats

    def fingerprint(self) -> str:
        """Return a text that changes when the bag's files do, or the topics."""
        return ":".join([type(self).__name__, *(part.fingerprint() for part in self._parts)])

    def _rows_of(self, part: RosbagSequence) -> Ints:
        """Return (len,) which message of a topic goes with each scan, -1 where none is near enough."""
        mine, its = self.stamps, part.stamps
        if mine is None or its is None:
            raise InputError(f"{self.address}: clouds without times cannot be merged; give one topic")
        after = np.searchsorted(its, mine).clip(0, len(its) - 1)
        before = (after - 1).clip(0)
        nearest = np.where(np.abs(its[before] - mine) < np.abs(its[after] - mine), before, after)
        reach = 0.5 * float(np.median(np.diff(mine))) if len(mine) > 1 else np.inf
        return np.where(np.abs(its[nearest] - mine) <= reach, nearest, -1)


def _joined(columns: list[Any]) -> Any:
    return None if any(column is None for column in columns) else np.concatenate(columns)


def _times(scans: list[Scan]) -> npt.NDArray[np.float32] | None:
    """Return the seconds of all points after the first of any, on the clock of the scans' stamps."""
    if any(scan.time is None or scan.stamp is None for scan in scans):
        return None
    stamps = np.array([scan.stamp for scan in scans], np.float64)
    after = (stamps - stamps.min()).astype(np.float32)
    return np.concatenate([scan.time + t for scan, t in zip(scans, after, strict=True) if scan.time is not None])


def _find_mounts(parts: list[RosbagSequence], topics: list[str]) -> Pose:
    """Return (K, 4, 4) T_scan_sensor of the topics' frames in that of the first."""
    frames, where = [part.frame_id for part in parts], parts[0].source
    joints: dict[str, list[tuple[str, Pose]]] = {}
    faults: list[str] = []
    with reported(where):  # sent again, a transform takes the place of the first
        latest = {joint.child: joint for joint in joints_of(Bag(where), "/tf_static")}
    for parent, child, (_, translation, xyzw) in latest.values():
        with noted(faults):
            T = from_quaternions(translation, xyzw, where / "tf_static" / child)[0]
            joints.setdefault(parent, []).append((child, T))
            joints.setdefault(child, []).append((parent, inverse(T)))
    T_first, todo = {frames[0]: np.eye(4)}, [frames[0]]
    for at in todo:
        for to, T in joints.get(at, []):
            if to not in T_first:
                T_first[to] = T_first[at] @ T
                todo.append(to)
    for frame, topic in zip(frames, topics, strict=True):
        if frame not in T_first:
            raise InputError(
                f"{where}: /tf_static does not say where {frame} (topic /{topic}) sits from {frames[0]} "
                f"(/{topics[0]}); record it, too, or give one topic{''.join(f' ({fault})' for fault in faults)}"
            )
    return np.stack([T_first[frame] for frame in frames])


def find(path: Path) -> list[Path]:
    """Return the bags at `path`: itself, a topic of it, or those that lie in it by name, one for each drive."""
    if is_bag(path):
        return [path]
    if not path.is_dir():
        return [path] if any(is_bag(parent) for parent in path.parents) else []
    return [first if not more else first.with_name(f"{first.name}+") for first, *more in drives_of(path)]


def open_bag(path: Path) -> Sequence:
    """Return the topic, or the merged topics, of the bag at or above `path`."""
    bag, topic = split_address(path)
    topics = (topic or "").split("+")
    return MergedBagSequence(bag, topics) if len(topics) > 1 else RosbagSequence(path)


FORMAT = Format(
    layout="a bag: ROS 1 .bag, ROS 2 bag (folder, .db3, .mcap), MCAP; of several LiDARs give one: "
    "log.mcap/front/points, or several merged: log.mcap/front/points+rear/points",
    find=find,
    open=open_bag,
    needs="ros",
)
