"""The messages of one topic of a bag, those of a scan together: a turn may come in packets, or in parts."""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.arrays import Array, Ints
from automos.core.errors import InputError
from automos.readers import bag_messages
from automos.readers.bag import Bag, reported
from automos.readers.bag_messages import Topic
from automos.readers.columns import Columns, coordinates
from automos.readers.packets.decode import Decoder, make_decoder
from automos.readers.packets.messages import as_datagrams, read_packets, rows_of_scans
from automos.readers.point_cloud2 import EMPTY, points_counted
from automos.readers.point_times import judge_times
from automos.readers.time_order import usual_step
from automos.readers.turns import Parts, joined, parts_in_a_turn, places_in_time


class TopicMessages:
    """The messages of one topic.

    Attributes
    ----------
    rows : (len, 4) int64, of each scan the row of the bag's index that its first message has; see `Bag.index`.
    sizes : (len,) bytes of a scan's messages.
    n_messages : how many there are on the topic.
    is_joined : whether scans are joined of several messages that hold parts of a turn.
    """

    def __init__(self, bag: Bag, topic: Topic, where: Path):
        """Find those that begin a scan, as others of packets may belong to the one before; `where` names them.

        Raises
        ------
        InputError
            There are none, or packets of which none says that it begins a scan.
        """
        self._bag, self._topic, self._where = bag, topic, where
        self._is_packets, self._is_ros2 = topic.kind in bag_messages.PACKETS, topic.encoding == "cdr"
        self._every, self.is_joined = bag.index(topic), False
        self.n_messages = len(self._every)
        if not self.n_messages:
            raise InputError(f"{bag.path} has no messages on topic {topic.name}; record it again or give another topic")
        self._unit: float | None = None
        groups = list(self._every[:, None])
        if self._is_packets:
            heads = (bag.read(row, bag_messages.head_size(topic)) for row in self._every)
            groups = rows_of_scans(self._every, heads, topic.kind, self._is_ros2, str(where))
        self._parts = [Parts(group) for group in groups]
        self.rows = np.stack([group[0] for group in groups])
        self.sizes = np.array([bag.size(row) for row in self.rows])

    def __len__(self) -> int:
        return len(self.rows)

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in self.__dict__.items() if key != "_decoder"}

    def heads(self) -> list[tuple[float, str]]:
        """Return the stamp, s, and the frame that the header of each scan names."""
        most = bag_messages.head_size(self._topic)
        return [bag_messages.head(self._bag.read(row, most), self._topic) for row in self.rows]

    def sort(self, order: Ints) -> None:
        """Put the scans in this order (len,)."""
        self.rows, self.sizes = self.rows[order], self.sizes[order]
        self._parts = [self._parts[index] for index in order]

    def join(self, stamps: Array | None) -> tuple[Array | None, list[str]]:
        """Join those that hold parts of a turn to whole ones; return the scans' stamps, s, and what to say of it."""
        places = places_in_time(stamps, len(self))
        parts = parts_in_a_turn(lambda index: coordinates(self.columns(index), self._where), places)
        if parts < 2.0:
            return stamps, []
        fullest = [self.columns(index) for index in np.argsort(-self.sizes, kind="stable")[:3].tolist()]
        self._unit = judge_times(fullest, self._where, usual_step(stamps)).unit
        first = np.flatnonzero(np.diff(places // parts, prepend=-1.0))
        turns = np.split(np.arange(len(self)), first[1:])
        since = [None if stamps is None else stamps[turn] - stamps[turn[0]] for turn in turns]
        rows = [np.concatenate([self._parts[index].rows for index in turn]) for turn in turns]
        self._parts, self.is_joined = list(map(Parts, rows, since)), True
        self.sizes, self.rows = np.add.reduceat(self.sizes, first), self.rows[first]
        said = f"{self._where}: a message holds a part of a turn; {parts:.3g} of them are joined to a scan each."
        return None if stamps is None else stamps[first], [said]

    def columns(self, index: int) -> Columns:
        """Return the columns of a scan; InputError where its messages do not hold what their headers promise."""
        parts, where = self._parts[index], f"{self._where}, scan {index}"
        with reported(self._bag.path):
            if self._is_packets:
                packets = (packet for row in parts.rows for packet in self._packets(row))
                return self._decoder.columns(as_datagrams(packets, self._decoder.layout.size, where))
            read = [bag_messages.read_message(self._bag.read(row), self._topic, where) for row in parts.rows]
            return read[0] if len(read) == 1 else joined(read, parts.since, self._unit)

    def digest(self, index: int) -> int:
        """Return a number that scans share if they hold the same points, whatever their time; EMPTY if none."""
        with reported(self._bag.path):
            found = tuple(bag_messages.digest(self._bag.read(row), self._topic) for row in self._parts[index].rows)
        return hash(found) if set(found) != {EMPTY} else EMPTY

    def points_counted(self, index: int) -> int | None:
        """Return how many points the headers of a scan's clouds count; None where they have none that do."""
        if self._topic.kind != bag_messages.CLOUD:
            return None
        with reported(self._bag.path):
            return sum(points_counted(self._bag.read(row), self._is_ros2) for row in self._parts[index].rows)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the decoder of packets says of the sensor."""
        return self._decoder.warnings if self._is_packets else ()

    @cached_property
    def _decoder(self) -> Decoder:
        return make_decoder((packet for row in self._every for _, packet in self._packets(row)), self._bag.path)

    def _packets(self, row: Ints) -> list[tuple[float, bytes]]:
        return read_packets(self._bag.read(row), self._topic.kind, self._is_ros2, str(self._where))
