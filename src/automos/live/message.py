"""The message sent for each labelled scan: one UDP datagram, described byte by byte in docs/how-to/live.md.

All numbers are little-endian. A header of 128 bytes is followed by `objects` records of 44 bytes and by the compressed
labels of the points; labels that do not fit into a datagram are left out.
"""

from __future__ import annotations

import socket
import zlib
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.labels import Label
from automos.core.scan import Pose
from automos.labeler import LabelledScan

MAGIC, VERSION = b"AMOS", 1
LARGEST = 65507
"""Bytes of a UDP datagram, at most."""
HEADER = np.dtype(
    [
        ("magic", "S4"),
        ("version", "<u2"),
        ("objects", "<u2"),
        ("index", "<u4"),
        ("points", "<u4"),
        ("moving", "<u4"),
        ("label_bytes", "<u4"),
        ("stamp", "<f8"),
        ("pose", "<f8", (3, 4)),
    ]
)
OBJECT = np.dtype([("track", "<i4"), ("center", "<f4", 3), ("size", "<f4", 3), ("yaw", "<f4"), ("velocity", "<f4", 3)])


@dataclass(frozen=True, eq=False)
class Message:
    """A labelled scan as it was sent.

    Attributes
    ----------
    index, stamp : int and float
        Number of the scan, and its seconds.
    pose : (4, 4) float64
        T_world_sensor.
    objects : (K,) array
        `OBJECT`, what moves: world frame, metres, radians, m/s.
    labels : (N,) uint8, optional
        251 moving, 9 static, 0 not known; None if they were left out.
    """

    index: int
    stamp: float
    pose: Pose
    objects: npt.NDArray
    labels: npt.NDArray[np.uint8] | None


def encode(scan: LabelledScan) -> bytes:
    """Return the datagram of a labelled scan."""
    objects = scan.objects[list(OBJECT.names or ())][:1000].astype(OBJECT)
    labels = zlib.compress(np.ascontiguousarray(scan.labels, np.uint8).tobytes(), 1)
    if HEADER.itemsize + objects.nbytes + len(labels) > LARGEST:
        labels = b""
    header = np.zeros((), HEADER)
    header["magic"], header["version"], header["objects"] = MAGIC, VERSION, len(objects)
    header["index"], header["points"], header["label_bytes"] = scan.index, len(scan.labels), len(labels)
    header["moving"], header["stamp"] = np.count_nonzero(scan.labels == Label.MOVING), scan.stamp
    header["pose"] = scan.pose[:3]
    return header.tobytes() + objects.tobytes() + labels


def decode(data: bytes) -> Message:
    """Return the message in a datagram.

    Raises
    ------
    InputError : it is none of these messages, or only the beginning of one.
    """
    if len(data) < HEADER.itemsize or data[:4] != MAGIC:
        raise InputError(f"these {len(data)} bytes are not a message of automos live")
    header = np.frombuffer(data, HEADER, 1)[0]
    if header["version"] != VERSION:
        raise InputError(f"this message is of version {header['version']}, {VERSION} is read: use one version")
    begin = HEADER.itemsize + OBJECT.itemsize * int(header["objects"])
    whole = begin + int(header["label_bytes"])
    if len(data) != whole:
        raise InputError(f"this message was {whole} bytes, {len(data)} of which came")
    pose = np.eye(4)
    pose[:3] = header["pose"]
    objects = np.frombuffer(data, OBJECT, int(header["objects"]), HEADER.itemsize)
    labels = _labels(data[begin:], int(header["points"])) if header["label_bytes"] else None
    return Message(int(header["index"]), float(header["stamp"]), pose, objects, labels)


def _labels(packed: bytes, n: int) -> npt.NDArray[np.uint8]:
    unpacker = zlib.decompressobj()
    try:
        labels = unpacker.decompress(packed, n + 1)  # never more than the header says
    except zlib.error as error:
        raise InputError(f"the labels of this message are damaged ({error})") from None
    if len(labels) != n:
        raise InputError(f"this message announces {n} points, but holds the labels of {len(labels)}")
    return np.frombuffer(labels, np.uint8)


class Sender:
    """Sends every labelled scan to one address; a context that closes it.

    Nobody need listen: what cannot be sent is counted in `n_failed`, and never waited for.
    """

    def __init__(self, host: str, port: int):
        try:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.connect((host, port))
        except OSError as error:
            raise InputError(f"nothing can be sent to udp://{host}:{port} ({error.strerror or error})") from None
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
        self._socket.setblocking(False)
        self.n_sent = self.n_failed = 0

    def send(self, scan: LabelledScan) -> None:
        """Send one scan."""
        try:
            self._socket.send(encode(scan))
            self.n_sent += 1
        except OSError:  # nobody listens, or the network is full
            self.n_failed += 1

    def summary(self) -> str:
        """Return how many messages could not be sent; empty if all were."""
        if not self.n_failed:
            return ""
        return (
            f"{self.n_failed:,} of {self.n_sent + self.n_failed:,} messages could not be sent: nobody listened there, "
            "or the network was full"
        )

    def __enter__(self) -> Sender:
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.close()
