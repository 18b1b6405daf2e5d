"""Opens the feed of scans for an address or a recording: packets of an Ouster or a Velodyne as they arrive.

Those of an Ouster are put together to frames and decoded by the maker's library, those of a Velodyne are cut into
sweeps, exactly as from a file.
"""

from itertools import count, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.core.reading import read_text
from automos.core.scan import Scan
from automos.live.feed import Feed, Replay
from automos.live.udp import UdpFeed, parse_address
from automos.readers import open_sequence
from automos.readers.ouster import first_stamp, frame_to_scan, make_to_points
from automos.readers.packets.decode import FACTORY, VelodyneDecoder, tells_calibration, to_scan
from automos.readers.packets.layouts import VELODYNE, layout_of
from automos.readers.packets.pcap import Datagrams
from automos.readers.packets.sweeps import SweepCutter


class OusterAssembler:
    """Frames of one Ouster, whose metadata is known."""

    kind = "Ouster"

    def __init__(self, metadata: Path):
        """Take the file that the sensor's metadata was saved to (http://SENSOR/api/v1/sensor/metadata).

        Raises
        ------
        InputError : no such file, or not the metadata of an Ouster.
        MissingExtraError : the library is not installed.
        """
        self._core = import_extra("ouster.sdk.core", "ouster")
        try:
            self._info = self._core.SensorInfo(read_text(metadata))
            self._format = self._core.PacketFormat.from_info(self._info)
        except Exception as error:  # the library raises what it likes
            raise InputError(
                f"{metadata} is not metadata of an Ouster ({error}); save it from the sensor: "
                "http://SENSOR/api/v1/sensor/metadata"
            ) from None
        self._to_points = make_to_points(self._info, metadata)
        self._batch = self._core.ScanBatcher(self._info)
        self._frame: Any = self._core.LidarScan(self._info)
        self._has_begun, self._number = False, count()

    def add(self, payloads: list[bytes], seconds: list[float]) -> tuple[list[Scan], int]:
        """Take packets and when each came; return the scans they complete, and how many were no such packets."""
        scans: list[Scan] = []
        own = [packet for packet in map(self._packet, payloads, seconds) if packet is not None]
        for packet in own:
            if self._batch(packet, self._frame):  # the packet is of the next frame already, and kept for it
                scans += self._finish()
            self._has_begun = True
        return scans, len(payloads) - len(own)

    def rest(self) -> list[Scan]:
        """Return the scan that was begun, if there is one."""
        return self._finish() if self._has_begun else []

    def _finish(self) -> list[Scan]:
        frame, self._frame, self._has_begun = self._frame, self._core.LidarScan(self._info), False
        if not (frame.status & 1).any():
            return []
        return [frame_to_scan(frame, self._to_points, first_stamp(frame), f"{next(self._number):06d}")]

    def _packet(self, payload: bytes, moment: float) -> Any:
        """Return the library's packet, None if it is not this sensor's."""
        if len(payload) != self._format.lidar_packet_size:
            return None
        packet = self._core.LidarPacket(len(payload))
        packet.buf[:] = memoryview(payload)
        packet.host_timestamp = int(moment * 1e9)
        failure = packet.validate(self._info, self._format)
        return packet if failure == self._core.PacketValidationFailure.NONE else None


CALIBRATION = 4160 + 16
"""Packets in which an HDL-64E sends its whole calibration; its first seconds are spent on that."""
MODEL_PACKETS = 5
"""Packets that show whether it does."""
LONGEST_SWEEP = 4000
"""Packets: no sweep has more; a sensor that stands still would fill memory."""


class VelodyneAssembler:
    """Sweeps of one Velodyne."""

    kind = "Velodyne"

    def __init__(self) -> None:
        self._cutter, self._parts = SweepCutter(VELODYNE), list[Datagrams]()
        self._first: list[bytes] = []
        self._decoder: VelodyneDecoder | None = None
        self._sends_calibration = False
        self._stamp, self._number = 0.0, count()

    def add(self, payloads: list[bytes], seconds: list[float]) -> tuple[list[Scan], int]:
        """Take packets and when each came; return the scans they complete, and how many were no such packets."""
        rows = [i for i, payload in enumerate(payloads) if self._is_own(payload)]
        if not rows:
            return [], len(payloads)
        packets = Datagrams(
            np.zeros(len(rows), np.int64),
            np.frombuffer(b"".join(payloads[i] for i in rows), np.uint8).reshape(-1, VELODYNE.size),
            np.array([seconds[i] for i in rows]),
            np.zeros(len(rows), np.int64),
        )
        self._learn(packets)
        is_first, stamps = self._cutter.cut(packets)
        scans = []
        for a, b in pairwise([0, *np.flatnonzero(is_first).tolist(), len(packets)]):
            if is_first[a]:
                scans += self.rest()
                self._stamp = float(stamps[a])
            if b > a and sum(map(len, self._parts)) < LONGEST_SWEEP:
                self._parts.append(packets[np.arange(a, b)])
        return scans, len(payloads) - len(rows)

    def rest(self) -> list[Scan]:
        """Return the scan that was begun, if there is one."""
        parts, self._parts = self._parts, []
        if not parts or self._decoder is None or (self._sends_calibration and len(self._first) < CALIBRATION):
            return []
        return [to_scan(self._decoder.columns(Datagrams.concatenate(parts)), self._stamp, f"{next(self._number):06d}")]

    def _is_own(self, payload: bytes) -> bool:
        if layout_of(payload) is not VELODYNE:
            return False
        return self._decoder is None or self._sends_calibration or payload[FACTORY] == self._first[0][FACTORY]

    def _learn(self, packets: Datagrams) -> None:
        """Keep the packets that contain the model, and of an HDL-64E its calibration."""
        for payload in packets.payloads:
            if len(self._first) >= (CALIBRATION if self._sends_calibration else MODEL_PACKETS):
                return
            self._first.append(payload.tobytes())
            if len(self._first) == MODEL_PACKETS:
                self._sends_calibration = tells_calibration(self._first)
                self._decoder = VelodyneDecoder(self._first, "what comes")


def open_feed(
    source: str,
    sensor: str | None = None,
    metadata: Path | None = None,
    speed: float = 1.0,
    patience: float = 10.0,
    format: str | None = None,
) -> Feed:
    """Return what SOURCE names: packets at udp://HOST:PORT, or a recording to replay.

    Raises
    ------
    InputError : no such address, sensor, metadata or recording, or several recordings.
    MissingExtraError : what decodes the packets is not installed.
    """
    if "://" not in source:
        return Replay(open_sequence(Path(source), format), speed)
    host, port = parse_address(source)
    if sensor == "velodyne":
        import_extra("velodyne_decoder", "velodyne")
        return UdpFeed(host, port, VelodyneAssembler(), patience)
    if sensor != "ouster":
        wanted = "" if sensor is None else f", not {sensor}"
        raise InputError(f"whose packets come to {source}? give --sensor velodyne or --sensor ouster{wanted}")
    if metadata is None:
        raise InputError(
            "packets of an Ouster need its metadata: save http://SENSOR/api/v1/sensor/metadata to a file and give "
            "it, --metadata FILE"
        )
    return UdpFeed(host, port, OusterAssembler(metadata), patience)
