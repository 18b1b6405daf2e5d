"""ROS 1 bags, ROS 2 bags and MCAP files: the point clouds of one topic, PointCloud2 or Livox's own messages.

The only such topic is taken; of several, one is named as if the bag were a folder: `log.mcap/front/points`. Scans are
in the order in which they were recorded and stamped by their headers.
"""

from __future__ import annotations

import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.errors import AutomosError, InputError
from automos.core.reading import require_regular
from automos.core.scan import Mask, Scan, Sequence
from automos.readers import livox_message
from automos.readers.columns import Columns, time_column, to_scan
from automos.readers.foreign import limited
from automos.readers.formats import import_extra
from automos.readers.listed import digest_of_files
from automos.readers.point_cloud2 import EMPTY, cloud_digest, header_stamp, read_columns
from automos.readers.point_times import PointTimes, judge_times
from automos.readers.time_order import count_unset, put_in_order

_SUFFIXES = (".bag", ".mcap", ".db3")
_CLOUD = "sensor_msgs/msg/PointCloud2"
_TYPES = (_CLOUD, *livox_message.TYPES)


def is_bag(path: Path) -> bool:
    """Return whether `path` is a bag: a file of one of its kinds, or ROS 2's folder."""
    if path.is_dir():
        holds = (path / "metadata.yaml").exists()
        return holds and any(p.suffix in _SUFFIXES or _is_packed(p) for p in path.iterdir())
    return path.suffix in _SUFFIXES and path.is_file()


def _is_packed(file: Path) -> bool:
    """Return whether `file` is one of a bag, compressed as a whole."""
    return file.suffix == ".zstd" and Path(file.stem).suffix in _SUFFIXES


class RosbagSequence(Sequence):
    """The point clouds of one topic, found once, read when asked for."""

    source: Path

    def __init__(self, path: Path):
        """Find the messages of the bag at `path`, or of the topic that `path` names below the bag.

        Raises
        ------
        InputError
            A bag that is damaged or compressed as a whole, no or several topics of point clouds, or stamps that run
            backwards.
        """
        bag = path if path.exists() else next(parent for parent in path.parents if is_bag(parent))
        wanted = None if path == bag else path.relative_to(bag).as_posix()
        self.source, self._address = bag, path
        self._threads = threading.local()
        packed = next(filter(_is_packed, _files(bag)), None)
        if packed is not None:  # the library would unpack all of it for every scan, with no limit on its size
            raise InputError(
                f"{packed} is compressed as a whole, so its messages cannot be read one by one; unpack it (zstd -d "
                f"{packed.name}) and give the unpacked file"
            )
        with _reported(bag):
            self._topic = _choose_topic(self._reader, bag, wanted)
            self._recorded, headers, self._sizes, self._digests = self._index()
        self.name = bag.resolve().stem + ("" if wanted is None else "_" + wanted.replace("/", "_"))
        if len(self._recorded) == 0:
            raise InputError(f"{bag} has no messages on topic {self._topic}; record it again or give another topic")
        self._stamps = self._choose_stamps(headers)

    @property
    def address(self) -> Path:
        """The bag, or the topic that was asked for below it."""
        return self._address

    def __len__(self) -> int:
        return len(self._recorded)

    def __getitem__(self, index: int) -> Scan:
        index = self._scan_number(index)
        columns = self._columns(index)
        unit = (self._point_times.unit or 0.0) if time_column(columns) is not None else None
        stamp = None if self._stamps is None else float(self._stamps[index])
        return to_scan(columns, self._where(index), self.names[index], stamp, unit)

    @property
    def stamps(self) -> npt.NDArray[np.float64] | None:
        """(len,) seconds, of the messages' headers; of their recording where the headers have none."""
        return self._stamps

    @property
    def warnings(self) -> list[str]:
        """What is wrong with the number and the order of the messages and the times of their points."""
        counted = sum(connection.msgcount for connection in self._connections())
        lost = f"{self._where()} holds {len(self)} of the {counted} messages that its bag counts; it was cut or damaged"
        return [*([lost] if counted > len(self) else []), *self._warnings, *self._point_times.warnings]

    @property
    def repeats(self) -> Mask:
        """(len,) bool: messages with the points of the one before; those without points are none."""
        return np.concatenate([[False], (self._digests[1:] == self._digests[:-1]) & (self._digests[1:] != EMPTY)])

    def fingerprint(self) -> str:
        """Return a text that changes when the bag's files do, or the topic."""
        return f"{super().fingerprint()}:{self._topic}:{digest_of_files(_files(self.source))}"

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in self.__dict__.items() if key != "_threads"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _threads=threading.local())

    @property
    def _reader(self) -> Any:
        """The opened bag; one for each thread, as readers are not made to be shared."""
        if not hasattr(self._threads, "reader"):
            anyreader, typesys = import_extra("rosbags.highlevel", "ros"), import_extra("rosbags.typesys", "ros")
            # Bags of early ROS 2 do not store their types; this one has not changed since.
            types = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
            for file in _files(self.source):
                require_regular(file)
            reader = anyreader.AnyReader([self.source], default_typestore=types)
            reader.open()
            self._threads.reader = reader
        return self._threads.reader

    @cached_property
    def frame_id(self) -> str:
        """The frame that the first cloud's header names."""
        with _reported(self.source):
            connection, _, raw = next(self._reader.messages(connections=self._connections()))
            return str(self._reader.deserialize(raw, connection.msgtype).header.frame_id).strip("/")

    def static_transforms(self) -> list[tuple[str, str, list[float], list[float]]]:
        """Return parent, child, translation and quaternion (scalar last) of each transform in /tf_static."""
        found = []
        with _reported(self.source):
            joints = [c for c in self._reader.connections if c.topic == "/tf_static"]
            for connection, _, raw in self._reader.messages(connections=joints) if joints else ():
                for joint in self._reader.deserialize(raw, connection.msgtype).transforms:
                    t, q = joint.transform.translation, joint.transform.rotation
                    names = joint.header.frame_id.strip("/"), joint.child_frame_id.strip("/")
                    found.append((*names, [t.x, t.y, t.z], [q.x, q.y, q.z, q.w]))
        return found

    def _connections(self) -> list[Any]:
        return [c for c in self._reader.connections if c.topic == self._topic and c.msgtype in _TYPES]

    def _index(self) -> tuple[npt.NDArray, npt.NDArray, npt.NDArray, npt.NDArray]:
        """Return (N,) times of recording (ns), headers' stamps (s), sizes and digests of all messages, as recorded."""
        rows = [
            (recorded, header_stamp(raw, self._reader.is2), len(raw), self._digest(raw, connection.msgtype))
            for connection, recorded, raw in self._reader.messages(connections=self._connections())
        ]
        recorded, headers, sizes, digests = zip(*rows, strict=True) if rows else ((), (), (), ())
        return np.array(recorded, np.int64), np.array(headers, np.float64), np.array(sizes, int), np.array(digests)

    def _digest(self, raw: bytes | memoryview, kind: str) -> int:
        return cloud_digest(raw, self._reader.is2) if kind == _CLOUD else zlib.crc32(raw[len(raw) // 2 :])

    def _choose_stamps(self, headers: npt.NDArray[np.float64]) -> npt.NDArray[np.float64] | None:
        said, n_unset = [], count_unset(headers)
        if n_unset:
            of_all = f"{n_unset} of {len(headers)} headers have no stamp"
            said = [f"{self._where()}: {of_all}; the times of recording are taken for all scans."]
            headers = (1e-9 * self._recorded).astype(np.float64)
        found = put_in_order(headers, self.names, self._where())
        self._warnings, self._messages = [*said, *found.warnings], found.order
        self._digests, self._sizes = self._digests[found.order], self._sizes[found.order]
        return found.stamps

    def _columns(self, index: int) -> Columns:
        message = int(self._messages[index])
        recorded = int(self._recorded[message])
        which = message - int(np.searchsorted(self._recorded, recorded))  # of those recorded at the same time
        with _reported(self.source):
            messages = self._reader.messages(connections=self._connections(), start=recorded, stop=recorded + 1)
            for k, (connection, _, raw) in enumerate(messages):
                if k == which:
                    where = f"{self._where()}, scan {index}"
                    if connection.msgtype != _CLOUD:
                        return livox_message.read_columns(raw, self._reader.is2, where)
                    return read_columns(self._reader.deserialize(raw, _CLOUD), where)
        raise InputError(f"{self.source} has changed since it was opened; run the command again")

    @cached_property
    def _point_times(self) -> PointTimes:
        """How the points' times are read, determined once: a scan of few points may not show it."""
        gap = float(np.median(np.diff(self._stamps))) if self._stamps is not None and len(self) > 2 else None
        return judge_times([self._columns(int(np.argmax(self._sizes)))], self._where(), gap)

    def _where(self, index: int | None = None) -> Path:
        return self.source / self._topic.strip("/") / ("" if index is None else f"{index:06d}")


def _files(bag: Path) -> list[Path]:
    """Return what a bag is made of: the file itself, or what lies in its folder beside other folders."""
    return sorted(file for file in bag.iterdir() if not file.is_dir()) if bag.is_dir() else [bag]


def _choose_topic(reader: Any, bag: Path, wanted: str | None) -> str:
    """Return the topic to read: the one that is `wanted`, else the only one of PointCloud2."""
    clouds = sorted({c.topic for c in reader.connections if c.msgtype in _TYPES})
    if wanted is not None:
        match = next((topic for topic in clouds if topic.strip("/") == wanted), None)
        if match is None:
            raise InputError(f"{bag} has no topic /{wanted} of point clouds; it has: {', '.join(clouds) or 'none'}")
        return match
    if not clouds:
        others = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})[:10]) or "none"
        raise InputError(f"{bag} has no topic of type {_CLOUD} or of Livox's CustomMsg; its topics are: {others}")
    if len(clouds) > 1:
        first = bag / clouds[0].strip("/")
        raise InputError(
            f"{bag} has {len(clouds)} topics of point clouds ({', '.join(clouds)}); give one, as {first}, or several, "
            "joined by +, to merge them"
        )
    return clouds[0]


@contextmanager
def _reported(bag: Path) -> Iterator[None]:
    """Turn whatever the reader of bags stumbles over into one sentence: damaged files break it in many ways."""
    try:
        with limited(bag):
            yield
    except AutomosError:
        raise
    except Exception as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(
            f"{bag} cannot be read as a ROS bag ({reason}); it may be cut short: copy it again, or repair it with "
            "'rosbag reindex', 'ros2 bag reindex' or 'mcap recover'"
        ) from error
