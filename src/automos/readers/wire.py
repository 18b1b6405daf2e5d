"""Messages of ROS as they lie in a bag, taken apart number by number: CDR of ROS 2, and what ROS 1 writes."""

import struct
from typing import Literal, Self


class Wire:
    """A place in a message. ROS 2 starts each number at a multiple of its size, ROS 1 does not.

    Parameters
    ----------
    raw : the message, or its beginning.
    is_ros2 : whether it is packed as ROS 2 does it.
    at : the byte to begin at. What comes before the stamp in a header has four bytes in both: ROS 1's number of the
        message, and what says how a message of ROS 2 is encoded.
    """

    def __init__(self, raw: bytes, is_ros2: bool, at: int = 4):
        self.raw, self.is_ros2, self.at = raw, is_ros2, at
        self.order: Literal["<", ">"] = ">" if is_ros2 and raw[1] == 0 else "<"

    @classmethod
    def behind_header(cls, raw: bytes, is_ros2: bool) -> Self:
        """Return the place behind a message's header: its stamp, and the name of a frame."""
        here = cls(raw, is_ros2, 12)
        here.text()
        return here

    def number(self) -> int:
        """Return the unsigned 32-bit number here, and move behind it; struct.error where the message ends before."""
        self.align(4)
        (value,) = struct.unpack_from(f"{self.order}I", self.raw, self.at)
        self.at += 4
        return int(value)

    def seconds(self) -> float:
        """Return the time here, seconds and nanoseconds, and move behind it."""
        return self.number() + 1e-9 * self.number()

    def header(self) -> tuple[float, str]:
        """Return the time here and the name of a frame behind it, and move behind that."""
        return self.seconds(), self.text().rstrip(b"\0").decode("utf-8", "replace").strip("/")

    def text(self) -> bytes:
        """Return the bytes here, which are counted before them, and move behind them."""
        return self.take(self.number())

    def take(self, n: int) -> bytes:
        """Return the next `n` bytes, fewer where the message ends, and move behind them."""
        self.at += n
        return self.raw[self.at - n : self.at]

    def align(self, n_bytes: int) -> None:
        """Move to where a number of `n_bytes` begins."""
        if self.is_ros2:
            self.at += (4 - self.at) % n_bytes

    def packed(self, *values: int) -> bytes:
        """Return numbers as they are written in this message."""
        return struct.pack(f"{self.order}{len(values)}I", *values)
