"""Where the sweeps of Velodyne sensors begin in a capture, from the azimuths and clocks in their packets.

A sweep begins where the azimuth comes round to that of the capture's first packet, so all but the last are whole.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel
from automos.readers.pcap import Capture, Datagrams

PACKET = 1206
"""Bytes of a packet of points of any model."""
_AZIMUTH, _CLOCK = 2, 1200
"""Where in a packet the first azimuth is (1/100 degrees), and the microseconds of the hour."""
_HOUR = 3600.0
_LONGEST = 0.3
"""Seconds: no sensor turns as slowly, so what lasts longer has a gap."""


def find_packets(capture: Capture, *part: int) -> Iterator[Datagrams]:
    """Yield, piece by piece, the packets of points in a part of the file (first byte, end); without it, in all of it.

    Raises
    ------
    InputError
        A damaged file.
    """
    for piece in capture.datagrams(PACKET, *part):
        yield piece[is_of_points(piece.payloads)]


def is_of_points(payloads: npt.NDArray[np.uint8]) -> npt.NDArray[np.bool_]:
    """Return (N,) whether each of N payloads of PACKET bytes holds points of a Velodyne."""
    return (payloads[:, 0] == 0xFF) & (payloads[:, 1] == 0xEE)


def clock_of(packets: Datagrams) -> npt.NDArray[np.float64]:
    """Return (N,) seconds on the sensor's clock since the hour before that of the first of `packets`."""
    return _HOUR + _count_hours(packets.numbers(_CLOCK, "<u4"), packets.seconds)


def find_sweeps(capture: Capture) -> dict[int, tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]]:
    """Return of each sender where its N sweeps begin, (N + 1,) bytes with the file's end, and (N,) stamps in seconds.

    Stamps are of the sweeps' first packets on the sensor's clock, which is set to the recorder's at the first of all.

    Raises
    ------
    InputError
        A damaged file.
    """
    sweeps: dict[int, _Sweeps] = {}
    for packets in find_packets(capture):
        for sender in np.unique(packets.senders).tolist():
            sweeps.setdefault(sender, _Sweeps()).add(packets[packets.senders == sender])
    return {sender: found.found(capture.size) for sender, found in sweeps.items()}


class SweepCutter:
    """Cuts the packets of one sensor, which come in pieces, into sweeps; what it keeps does not grow."""

    def __init__(self) -> None:
        self._microseconds, self._recorded = np.zeros(0, np.int64), np.zeros(0)  # of the last packet
        self._seconds = 0.0
        self._turn = np.array([0.0, 0.0, -np.inf])

    def cut(self, packets: Datagrams) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.float64]]:
        """Return of the sensor's next packets, at least one, which begin a sweep (N,), and their stamps (N,)."""
        azimuth = packets.numbers(_AZIMUTH, "<u2")
        n_before = len(self._recorded)
        if n_before == 0:
            self._turn[0], self._seconds = azimuth[0], packets.seconds[0]
        microseconds = np.concatenate([self._microseconds, packets.numbers(_CLOCK, "<u4")])
        recorded = np.concatenate([self._recorded, packets.seconds])
        clock = _count_hours(microseconds, recorded)
        seconds = (self._seconds + clock - clock[0])[n_before:]
        is_first = np.zeros(len(packets), bool)
        _mark_first(azimuth, seconds, self._turn, is_first)
        self._microseconds, self._recorded, self._seconds = microseconds[-1:], recorded[-1:], float(seconds[-1])
        return is_first, seconds


class _Sweeps:
    """Where the sweeps of one sensor begin in a file, and their stamps."""

    def __init__(self) -> None:
        self._cutter = SweepCutter()
        self._starts: list[npt.NDArray[np.int64]] = []
        self._stamps: list[npt.NDArray[np.float64]] = []

    def add(self, packets: Datagrams) -> None:
        """Take the sensor's next packets, at least one."""
        is_first, seconds = self._cutter.cut(packets)
        self._starts.append(packets.records[is_first])
        self._stamps.append(seconds[is_first])

    def found(self, end: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
        """Return where the sweeps begin and, last, `end`; and their stamps."""
        return np.concatenate([*self._starts, [end]]), np.concatenate(self._stamps)


def _count_hours(microseconds: npt.NDArray[np.int64], recorded: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return (N,) seconds since the hour of the first, from microseconds since each one's hour.

    How many hours passed between two packets is what brings their clock nearest to the times of recording, seconds.
    """
    seconds = 1e-6 * microseconds.astype(np.float64)
    hours = np.round((np.diff(recorded) - np.diff(seconds)) / _HOUR)
    seconds[1:] += _HOUR * np.cumsum(hours)
    return seconds


@kernel
def _mark_first(azimuth, seconds, turn, is_first):  # type: ignore[no-untyped-def]
    """Mark the packets that begin a sweep; `turn` holds the azimuth of cuts, the way turned since, and the start."""
    for i in range(len(azimuth)):
        turned = (azimuth[i] - turn[0]) % 36000.0
        is_over = seconds[i] - turn[2] > _LONGEST
        if not is_over and (turned - turn[1]) % 36000.0 > 35000.0:
            continue  # overtaken by the packet before it
        if is_over or turned < turn[1]:
            is_first[i], turn[2] = True, seconds[i]
        turn[1] = turned
