"""Packets of Velodyne sensors: a .pcap alone, as Wireshark, tcpdump or VeloView record it.

Where the sweeps begin is found once; one is decoded, by velodyne-decoder, when asked for. A scan is the returns of a
sweep in the order of their measurement, both of a sensor that gives two, where they differ. Of several sensors one is
named by address and port, as if the file were a folder: `drive.pcap/192.168.1.201-2368`.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from automos.datasets.foreign import limited
from automos.datasets.formats import Format, import_extra, recordings_at
from automos.datasets.listed import digest_of_files, require_increasing
from automos.datasets.pcap import Capture, Datagrams, join, open_capture, sender_name
from automos.datasets.sensor_choice import choose_sensor, split_sensor
from automos.datasets.velodyne_sweeps import clock_of, find_packets, find_sweeps
from automos.errors import InputError
from automos.scan import Scan, Sequence

_LOOKED_AT = (24, 1 << 23)
"""The stretch of a capture in which a Velodyne's packets must be for it to be found: after the header, 8 MB."""
_FACTORY = slice(1204, 1206)
"""Return mode and model in a packet, always the same; an HDL-64E tells its state and calibration there, by and by."""


def find(path: Path) -> list[Path]:
    """Return the captures with a Velodyne's packets at `path`: itself, a sensor of it, or those in it by name."""
    return [path] if _is_velodynes(path.parent) else recordings_at(path, _is_velodynes)


def _is_velodynes(path: Path) -> bool:
    if path.suffix != ".pcap" or not path.is_file():
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
        self._decode(self._packets(0))  # a model that is not known is told now

    @property
    def address(self) -> Path:
        """The file, or the sensor that was asked for below it."""
        return self._address

    def __len__(self) -> int:
        return len(self._stamps)

    def __getitem__(self, index: int) -> Scan:
        index = range(len(self))[index]
        rows = self._decode(self._packets(index))
        return Scan(
            np.column_stack([rows[axis] for axis in "xyz"]),
            intensity=np.ascontiguousarray(rows["intensity"]),
            time=np.ascontiguousarray(rows["time"]),
            ring=rows["ring"].astype(np.uint16),
            stamp=float(self._stamps[index]),
            name=self.names[index],
        )

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
        return {key: value for key, value in self.__dict__.items() if key not in ("_capture", "_config")}

    @cached_property
    def _capture(self) -> Capture:
        return open_capture(self.source)

    def _packets(self, index: int) -> Datagrams:
        """Return the sensor's packets of a sweep."""
        pieces = find_packets(self._capture, *self._starts[index : index + 2].tolist())
        return join(piece[piece.senders == self._sender] for piece in pieces)

    # ------------------------------------------------------------------------------------------------ the library
    def _decode(self, packets: Datagrams) -> npt.NDArray:
        """Return the returns in `packets` (at least one) as the library's records."""
        decoder = import_extra("velodyne_decoder", "velodyne")
        sent = zip(clock_of(packets).tolist(), packets.payloads.tolist(), strict=True)
        vector = decoder.PacketVector([decoder.VelodynePacket(seconds, payload) for seconds, payload in sent])
        try:
            with limited(self.source):
                return decoder.ScanDecoder(self._config).decode(vector, as_pcl_structs=True)[1]
        except (RuntimeError, ValueError) as error:
            raise InputError(
                f"{self.source} cannot be decoded as packets of a Velodyne ({error}); convert it with its maker's tools"
            ) from error

    @cached_property
    def _config(self) -> Any:
        """What the library decodes by: all returns, whatever their range, timed from the sweep's first packet."""
        decoder = import_extra("velodyne_decoder", "velodyne")
        config = decoder.Config(min_range=0.0, max_range=np.inf, timestamp_first_packet=True)
        if len({packet[_FACTORY] for packet in islice(self._all_packets(), 5)}) > 1:
            told = decoder.hdl64e.status_info_to_calib_dict(decoder.hdl64e.read_status_info(self._all_packets()))
            config.model = decoder.Model[f"HDL64E_{told['status']['Model']}"]
            config.calibration = decoder.Calibration.from_string(yaml.safe_dump(told))
        return config

    def _all_packets(self) -> Iterator[bytes]:
        for index in range(len(self)):
            for payload in self._packets(index).payloads:
                yield payload.tobytes()


FORMAT = Format(
    layout="Velodyne packets: a .pcap; of several sensors give one: drive.pcap/ADDRESS-PORT",
    truth="",
    find=find,
    open=VelodyneSequence,
    needs="velodyne",
)
