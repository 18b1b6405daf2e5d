"""ROS 1 bags, ROS 2 bags and MCAP files: the point clouds of one topic, the only one or the one that is named."""

from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path

import numpy as np

from automos.core.errors import InputError
from automos.core.pose_files import read_poses
from automos.core.scan import Array, Mask, Pose, Scan, Sequence
from automos.readers.bag import Bag, name_of, reported, split_address
from automos.readers.bag_topics import choose_topic, is_named_world, odometry_frames, poses_in
from automos.readers.columns import coordinates, to_scan
from automos.readers.formats import digest_of_files
from automos.readers.point_cloud2 import EMPTY
from automos.readers.point_times import judge_times
from automos.readers.sensor_place import find_frame, frame_said
from automos.readers.stamped_poses import sensor_poses, truth_beside
from automos.readers.time_order import count_unset, put_in_order, usual_step
from automos.readers.topic_messages import TopicMessages
from automos.readers.units import unit_of

_TOO_SLOW = 40.0, 500.0
"""Seconds from scan to scan, and times the step of recording, from which headers count something else than seconds."""


class RosbagSequence(Sequence):
    """The point clouds of one topic, found once, read when asked for.

    Attributes
    ----------
    address : the bag, or the topic that was asked for below it.
    topic, bag : where they are.
    stamps : (len,) seconds, of the messages' headers; of their recording where the headers have none.
    rows : (len, 4) of each scan the row of the bag's index that its message has, or the first of its messages.
    is_joined : whether scans are joined of several messages.
    """

    source: Path
    address: Path | None = None
    stamps: Array | None = None
    _T_frame_sensor: Pose | None = None

    def __init__(self, path: Path):
        """Find the messages of the bag at `path`, or of the topic that `path` names below the bag.

        Raises
        ------
        InputError
            A bag that is damaged or compressed as a whole, no or several topics of point clouds, or clouds in the frame
            of a map without poses.
        """
        self.address = path
        self.source, wanted = split_address(path)
        with reported(self.source):
            self.bag = Bag(self.source)
            self.topic, said = choose_topic(self.bag, wanted)
            self._messages = TopicMessages(self.bag, self.topic, self._where())
            heads = self._messages.heads()
            self.frame_id = heads[0][1]
            frames = sorted({frame.strip("/") for _, frame in heads} - {""})
            if len(frames) > 1:
                raise InputError(
                    f"{self._where()} has clouds of several LiDARs, in the frames {', '.join(frames)}, one after the "
                    "other; record each on a topic of its own"
                )
            self.name = name_of(self.source) + ("" if wanted is None else "_" + wanted.replace("/", "_"))
            stamps, of_order = self._put_in_order(np.array([stamp for stamp, _ in heads]))
            self.stamps, of_parts = self._messages.join(stamps)
            self.rows, self.is_joined = self._messages.rows, self._messages.is_joined
            faults = [file.fault for file in self.bag.files if file.fault]
            self._warnings = [*faults, *said, *of_order, *of_parts]
            self._T_frame_sensor = self._find_sensor()
            counted, n_messages = self.bag.counted(self.topic), self._messages.n_messages
            if counted > n_messages:
                lost = f"{self._where()} holds {n_messages} of the {counted} messages that its bag counts"
                self._warnings.append(f"{lost}; it was cut or damaged")
            self.bag.keep(self.topic)
        # of all scans alike: one of few points may not show it
        fullest = int(np.argmax(self._messages.sizes))
        columns = self._messages.columns(fullest)
        self._point_times = judge_times([columns], self._where(), usual_step(self.stamps))
        self._unit = 1.0
        if self._T_frame_sensor is None:  # poses are in metres
            with suppress(InputError):  # reported when the scan itself is read
                self._unit, said = unit_of(coordinates(columns, self._where()))
                self._warnings += said
        n_counted, n = self._messages.points_counted(fullest), len(next(iter(columns.values()), ()))
        if n_counted is not None and n_counted < n:
            self._warnings.append(
                f"{self._where()}: headers count {n_counted} of {n} points in the data; all are read."
            )

    def __len__(self) -> int:
        return len(self._messages)

    def __getitem__(self, index: int) -> Scan:
        index = self._scan_number(index)
        stamp = None if self.stamps is None else float(self.stamps[index])
        T = None if self._T_frame_sensor is None else self._T_frame_sensor[index]
        columns, how = self._messages.columns(index), (self._point_times.unit or 0.0, self._unit, T)
        return to_scan(columns, self._where(index), self.names[index], stamp, *how)

    @property
    def about(self) -> dict[str, str]:
        """The kind of its files, and the topic; the frame of its clouds."""
        files = f"{self.bag.paths[0].suffix or 'files'} with {self.topic.name}"
        return {"files": files, "frame": f"{frame_said(self._T_frame_sensor)} ({self.frame_id})"}

    @property
    def is_compensated(self) -> bool | None:
        """Whether it is known that scans are motion-compensated: those that came in a map's frame are."""
        return None if self._T_frame_sensor is None else True

    @property
    def reference_poses(self) -> Pose | None:
        """(len, 4, 4) T_world_sensor by which clouds were taken out of a map's frame, or VBR's truth; None without."""
        T, told = self._T_frame_sensor, truth_beside(self.source.parent, self.name)
        if T is None:
            return None if told is None else read_poses(told, len(self), self.stamps)
        return sensor_poses(T)

    @property
    def warnings(self) -> list[str]:
        """What is wrong with the number and the order of the messages and the times of their points."""
        return [*self._warnings, *self._point_times.warnings, *self._messages.warnings]

    @cached_property
    def repeats(self) -> Mask:
        """(len,) bool: messages with the points of the one before; those without points are none."""
        repeats = np.zeros(len(self), bool)
        digest = cache(self._messages.digest)
        is_alike = np.diff(self._messages.sizes) == 0  # of another size, it holds something else
        for i in (np.flatnonzero(is_alike) + 1).tolist():
            repeats[i] = digest(i - 1) == digest(i) != EMPTY
        return repeats

    def fingerprint(self) -> str:
        """Return a text that changes when the bag's files do, or the topic."""
        return f"{super().fingerprint()}:{self.topic.name}:{digest_of_files(self.bag.paths)}"

    # -------------------------------------------------------------------------------------------- time and place
    def _put_in_order(self, stamps: Array) -> tuple[Array | None, list[str]]:
        """Put the messages in the order of their headers' stamps; return these, seconds, and what to say of it."""
        recorded = (1e-9 * self._messages.rows[:, 0]).astype(np.float64)
        said, n_unset = [], count_unset(stamps)
        fault = f"{n_unset} of {len(stamps)} headers have no stamp" if n_unset else ""
        own, step = usual_step(stamps) or 0.0, usual_step(recorded) or np.inf
        if own > _TOO_SLOW[0] and own / step > _TOO_SLOW[1]:
            fault = f"a scan comes every {own:.3g} s by the headers, and every {step:.3g} s as it was recorded"
        if fault:
            said = [f"{self._where()}: {fault}; the times of recording are taken for all scans."]
            stamps = recorded
        found = put_in_order(stamps, self.names, self._where())
        self._messages.sort(found.order)
        return found.stamps, [*said, *found.warnings]

    def _find_sensor(self) -> Pose | None:
        """Return (len, 4, 4) the sensor's poses in the frame of the clouds, None where that is the sensor's own."""

        def points(index: int) -> Array:
            return coordinates(self._messages.columns(index), self._where(index))

        is_told = is_named_world(self.frame_id) or self.frame_id in odometry_frames(self.bag)
        if not is_told:
            with suppress(InputError):
                return find_frame(points, len(self), [], False, self._where())
        poses, faults = ([], []) if self.stamps is None else poses_in(self.bag, self.frame_id, self.stamps)
        try:
            return find_frame(points, len(self), poses, is_told and bool(poses), self._where())
        except InputError:
            if poses:
                raise
            raise InputError(
                f"{self._where()} holds clouds in a world frame ({self.frame_id!r}), not in the sensor's, and no "
                "odometry or /tf in the bag says where the sensor was; record the sensor's own topic, too, or the "
                f"odometry{''.join(f' ({fault})' for fault in faults)}"
            ) from None

    def _where(self, index: int | None = None) -> Path:
        return self.source / self.topic.name.strip("/") / ("" if index is None else f"{index:06d}")
