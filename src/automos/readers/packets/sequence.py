"""Packets of sensors in a file: a capture of network traffic (.pcap, .pcapng), or a recording of Livox's viewer.

Where the sweeps begin is found once; one is decoded when asked for. A scan is the returns of a sweep in the order of
their measurement, both of a sensor that gives two, where they differ. Of several sensors one is named by address and
port, as if the file were a folder: `drive.pcap/192.168.1.201-2368`.
"""

from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.errors import InputError
from automos.core.reading import is_there
from automos.core.scan import Scan
from automos.readers.foreign import limited
from automos.readers.formats import Format, SensorSequence, choose_sensor, is_capture, recordings_at
from automos.readers.packets.beams import TOLD, table_beside
from automos.readers.packets.decode import Decoder, make_decoder, to_scan
from automos.readers.packets.lvx import SUFFIXES, LvxFile
from automos.readers.packets.pcap import Capture, Datagrams, open_capture, sender_name
from automos.readers.packets.sweeps import find_packets, find_sweeps, kinds_in

_TOLD_WITHIN = (0, 1 << 24)
"""The part of a capture that is searched for what a sensor says of its beams: 16 MB are more than a second."""

_BEGINNING, _PAUSE = (0, 1 << 18), 1.0
"""The part of another capture that shows when it begins, and seconds from the last scan to it, in one drive."""


def open_file(path: Path) -> Capture | LvxFile:
    """Return the capture, or Livox's recording, at `path`; errors are those of either."""
    return LvxFile(path) if path.suffix.lower() in SUFFIXES else open_capture(path)


def holds_packets(path: Path) -> bool:
    """Return whether `path` is a file with packets of points that are known."""
    if path.suffix.lower() in SUFFIXES:
        return path.is_file()
    if not is_capture(path):
        return False
    try:
        capture = open_capture(path)
    except InputError:
        return False
    try:
        return any(kinds_in(capture))
    except InputError:  # told when it is opened
        return True


class PacketSequence(SensorSequence):
    """The sweeps of one sensor, found once, read when asked for."""

    def __init__(self, path: Path):
        """Find the sweeps in the file at `path`, or those of the sensor that `path` names below it.

        Raises
        ------
        InputError
            A damaged file, several sensors, a clock that runs backwards, or packets of an unknown model.
        """
        super().__init__(path)
        found = {
            (layout, sender): sweeps
            for layout in kinds_in(self._file)
            for sender, sweeps in find_sweeps(self._file, layout).items()
        }
        if not found:
            raise InputError(f"{self.source} holds no packets of a known sensor; give another file or another --format")
        names = {sender_name(sender): (layout, sender) for layout, sender in sorted(found, key=lambda one: one[1])}
        makers = {layout.sensor for layout, _ in found}
        what = makers.pop() if len(makers) == 1 else "LiDAR"
        self._layout, self._sender = names[choose_sensor(self.source, self._wanted, list(names), what)]
        self._starts, stamps = found[self._layout, self._sender]
        self._identity = str(self._sender)
        self._set_stamps(stamps)
        self[0]  # an unknown model is reported now

    def __getitem__(self, index: int) -> Scan:
        index = self._scan_number(index)
        packets = self._packets(index)
        with limited(self.source):
            return to_scan(self._decoder.columns(packets), float(self.stamps[index]), self.names[index])

    @property
    def about(self) -> dict[str, str]:
        """The kind of sensor."""
        return {"files": f"of a {self._layout.sensor}"}

    @property
    def warnings(self) -> list[str]:
        """What is assumed of the sensor's beams, and which other captures seem to be parts of the same drive."""
        return [*self._decoder.warnings, *self._going_on]

    @cached_property
    def _going_on(self) -> list[str]:
        """What to say of captures beside this one that begin where it ends, as recorders split them."""
        if not isinstance(self._file, Capture):
            return []
        found: list[str] = []
        for other in sorted(p for p in self.source.parent.iterdir() if is_capture(p) and p != self.source):
            with suppress(InputError):  # told when that one is opened
                pieces = find_packets(open_capture(other), self._layout, *_BEGINNING)
                seconds = np.concatenate([np.zeros(0), *(p.seconds[p.senders == self._sender] for p in pieces)])
                if len(seconds) and 0.0 <= seconds[0] - self.stamps[-1] <= _PAUSE:
                    found.append(
                        f"{self.source}: {other.name} goes on where it ends; join both if they are of one drive "
                        f"(mergecap -a -w whole.pcap {self.source.name} {other.name}) and label that."
                    )
        return found

    def _files(self) -> list[Path]:
        return [self.source, *filter(is_there, [table_beside(self.source, self._layout)])]

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in self.__dict__.items() if key not in ("_file", "_decoder")}

    @cached_property
    def _file(self) -> Capture | LvxFile:
        return open_file(self.source)

    def _packets(self, index: int) -> Datagrams:
        """Return the sensor's packets of a sweep."""
        pieces = find_packets(self._file, self._layout, *self._starts[index : index + 2].tolist())
        return Datagrams.concatenate([piece[piece.senders == self._sender] for piece in pieces])

    @cached_property
    def _decoder(self) -> Decoder:
        return make_decoder(self._sent(), self.source, self._layout)

    def _sent(self) -> Iterator[bytes]:
        """Yield what the sensor sent, those packets first that may contain its calibration."""
        if self._layout.turns and isinstance(self._file, Capture):
            for piece in self._file.datagrams(self._layout.size, *_TOLD_WITHIN):
                is_told = (piece.payloads[:, : len(TOLD)] == np.frombuffer(TOLD, np.uint8)).all(axis=1)
                is_told &= piece.senders >> 16 == self._sender >> 16  # of the same address, to another port
                yield from (payload.tobytes() for payload in piece.payloads[is_told])
        for index in range(len(self)):
            yield from (payload.tobytes() for payload in self._packets(index).payloads)


def find(path: Path) -> list[Path]:
    """Return the recordings at `path`: itself, a sensor of it, or those that lie in it by name."""
    return [path] if holds_packets(path.parent) else recordings_at(path, holds_packets)


FORMAT = Format(
    layout="packets: .pcap or .pcapng of Velodyne (extra velodyne), Hesai, RoboSense or Livox, .lvx, "
    ".lvx2; of several give one: drive.pcap/ADDRESS-PORT",
    find=find,
    open=PacketSequence,
)
