"""Packets of Velodyne sensors: a .pcap or .pcapng alone, as Wireshark, tcpdump or VeloView record it.

Where the sweeps begin is found once; one is decoded, by velodyne-decoder, when asked for. A scan is the returns of a
sweep in the order of their measurement, both of a sensor that gives two, where they differ. Of several sensors one is
named by address and port, as if the file were a folder: `drive.pcap/192.168.1.201-2368`.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.scan import Scan, Sequence
from automos.readers.foreign import limited
from automos.readers.formats import Format, recordings_at
from automos.readers.listed import digest_of_files, require_increasing
from automos.readers.pcap import CAPTURES, Capture, Datagrams, join, open_capture, sender_name
from automos.readers.sensor_choice import choose_sensor, split_sensor
from automos.readers.velodyne_decoder import SweepDecoder
from automos.readers.velodyne_sweeps import find_packets, find_sweeps

_LOOKED_AT = (0, 1 << 23)
"""The part of a capture that is searched for a Velodyne's packets: its first 8 MB."""


def find(path: Path) -> list[Path]:
    """Return the captures with a Velodyne's packets at `path`: itself, a sensor of it, or those in it by name."""
    return [path] if _is_velodynes(path.parent) else recordings_at(path, _is_velodynes)


def _is_velodynes(path: Path) -> bool:
    if path.suffix not in CAPTURES or not path.is_file():
        return False
    try:
        return len(next(find_packets(open_capture(path), *_LOOKED_AT), ())) > 0
    except InputError:
        return False


class VelodyneSequence(Sequence):
    """The sweeps of one sensor, found once, read when asked for."""

    source: Path

    def __init__(self, path: Path):
        """Find the sweeps in the file at `path`, or those of the sensor that `path` names below it.

        Raises
        ------
        InputError
            A damaged file, several sensors, a clock that runs backwards, or packets of an unknown model.
        """
        self.source, wanted = split_sensor(path)
        self._address = path
        sweeps = find_sweeps(self._capture)
        if not sweeps:
            raise InputError(f"{self.source} holds no packets of a Velodyne; give another file or another --format")
        senders = {sender_name(sender): sender for sender in sorted(sweeps)}
        self._sender = senders[choose_sensor(self.source, wanted, list(senders), "Velodyne")]
        self._starts, self._stamps = sweeps[self._sender]
        self.name = self.source.stem if wanted is None else f"{self.source.stem}_{wanted}"
        require_increasing(self._stamps, self.names, self.source)
        self[0]  # an unknown model is reported now

    @property
    def address(self) -> Path:
        """The file, or the sensor that was asked for below it."""
        return self._address

    def __len__(self) -> int:
        return len(self._stamps)

    def __getitem__(self, index: int) -> Scan:
        index = self._scan_number(index)
        packets = self._packets(index)
        with limited(self.source):
            return self._decoder.scan(packets, float(self._stamps[index]), self.names[index])

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        """(len,) seconds, of each sweep's first packet: the sensor's clock, set to the recorder's at the first."""
        return self._stamps

    @property
    def is_compensated(self) -> bool:
        """Packets are as measured."""
        return False

    def fingerprint(self) -> str:
        """Return a text that changes when the file does, or the sensor."""
        return f"{super().fingerprint()}:{self._sender}:{digest_of_files([self.source])}"

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in self.__dict__.items() if key not in ("_capture", "_decoder")}

    @cached_property
    def _capture(self) -> Capture:
        return open_capture(self.source)

    def _packets(self, index: int) -> Datagrams:
        """Return the sensor's packets of a sweep."""
        pieces = find_packets(self._capture, *self._starts[index : index + 2].tolist())
        return join(piece[piece.senders == self._sender] for piece in pieces)

    @cached_property
    def _decoder(self) -> SweepDecoder:
        return SweepDecoder(self._all_packets(), str(self.source))

    def _all_packets(self) -> Iterator[bytes]:
        for index in range(len(self)):
            for payload in self._packets(index).payloads:
                yield payload.tobytes()


FORMAT = Format(
    layout="Velodyne packets: a .pcap or .pcapng; of several sensors give one: drive.pcap/ADDRESS-PORT",
    truth="",
    find=find,
    open=VelodyneSequence,
    needs="velodyne",
)
