"""One file of a bag: which topics it holds, where their messages lie, and the bytes of one."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

LARGEST = 1 << 30
"""Bytes of a message, or of the chunk it is in, at most; the clouds of any sensor have a hundredth of that."""


class Topic(NamedTuple):
    """A topic's name, the type of its messages (sensor_msgs/msg/PointCloud2), and how they are packed (cdr, ros1)."""

    name: str
    kind: str
    encoding: str


class BagFile:
    """The topics and messages of one file; each kind of file derives from it.

    Attributes
    ----------
    fault : where the file was cut off, in a sentence; empty for a whole one.
    """

    def __init__(self, path: Path):
        """Begin with no topics.

        Raises
        ------
        InputError
            Of those that derive from it: the file is of a version that is not read; others where it is damaged.
        """
        self.path, self.topics, self.fault = path, dict[int, Topic](), ""

    def places(self, number: int) -> npt.NDArray[np.int64]:
        """Return (N, 3) when each message of topic `number` was recorded (ns), its chunk, and where it begins there."""
        raise NotImplementedError

    def keep(self, numbers: set[int]) -> None:
        """Forget the messages of all other topics, of which there may be millions."""

    def read(self, chunk: int, place: int, most: int = LARGEST) -> bytes:
        """Return the first `most` bytes, or all, of the message at a place."""
        raise NotImplementedError

    def size_of(self, chunk: int, place: int) -> int:
        """Return how many bytes the message at a place has."""
        raise NotImplementedError


def type_name(name: str) -> str:
    """Return the name of a message type as ROS 2 writes it: ROS 1 says sensor_msgs/PointCloud2."""
    package, _, kind = name.rpartition("/")
    return f"{package}/msg/{kind}" if package and not package.endswith("/msg") else name
