"""Packets of an Ouster as they arrive: put together to frames and decoded by the maker's library, as from a file."""

from itertools import count
from pathlib import Path
from typing import Any

from automos.core.errors import InputError
from automos.core.reading import read_text
from automos.core.scan import Scan
from automos.readers.formats import import_extra
from automos.readers.ouster import first_stamp, frame_to_scan, make_to_points


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
        n_foreign = 0
        for payload, moment in zip(payloads, seconds, strict=True):
            packet = self._packet(payload, moment)
            if packet is None:
                n_foreign += 1
                continue
            if self._batch(packet, self._frame):  # the packet is of the next frame already, and kept for it
                scans += self._finish()
            self._has_begun = True
        return scans, n_foreign

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
