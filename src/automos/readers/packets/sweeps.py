"""Where the sweeps of sensors begin in a capture, from what their packets say of the turn and the time.

A sweep begins where a turning sensor comes round to the direction of the capture's first packet, so all but the last
are whole; or where another begins a frame.
"""

from collections.abc import Iterator

import numpy as np

from automos.core.arrays import Array, Ints, Mask
from automos.core.kernels import kernel
from automos.readers.packets.layouts import LAYOUTS, LVX, LVX2, Layout
from automos.readers.packets.lvx import LvxFile
from automos.readers.packets.pcap import Capture, Datagrams

_LONGEST = 0.3
"""Seconds: no sensor turns as slowly, so what lasts longer has a gap."""
_LOOKED_AT = (0, 1 << 23)
"""The part of a capture that is searched for packets that are known: its first 8 MB."""


def find_packets(capture: Capture | LvxFile, layout: Layout, *part: int) -> Iterator[Datagrams]:
    """Yield, piece by piece, the packets of a kind in a part of the file (first byte, end); without it, in all of it.

    Those that were captured twice, as on a bridge, are there once.

    Raises
    ------
    InputError
        A damaged file.
    """
    for piece in capture.datagrams(layout.size, *part):
        own = piece[layout.are_own(piece.payloads)]
        is_other = np.ones(len(own), bool)
        is_other[1:] = (own.payloads[1:] != own.payloads[:-1]).any(axis=1) | (own.senders[1:] != own.senders[:-1])
        yield own[is_other]


def kinds_in(capture: Capture | LvxFile) -> Iterator[Layout]:
    """Yield, each as it is found, which packets of points the beginning of a capture holds."""
    if isinstance(capture, Capture):
        sizes = capture.sizes(_LOOKED_AT[1])
        known = tuple(layout for layout in LAYOUTS if layout.size in sizes)
    else:
        known = LVX2 if capture.is_second else LVX
    return (layout for layout in known if any(map(len, find_packets(capture, layout, *_LOOKED_AT))))


def find_sweeps(capture: Capture | LvxFile, layout: Layout) -> dict[int, tuple[Ints, Array]]:
    """Return of each sender where its N sweeps begin, (N + 1,) bytes with the file's end, and (N,) stamps in seconds.

    Stamps are of the sweeps' first packets on the sensor's clock, which is set to the recorder's at the first of all.

    Raises
    ------
    InputError
        A damaged file.
    """
    cutters: dict[int, SweepCutter] = {}
    found: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for packets in find_packets(capture, layout):
        for sender in np.unique(packets.senders).tolist():
            own = packets[packets.senders == sender]
            is_first, seconds = cutters.setdefault(sender, SweepCutter(layout)).cut(own)
            found.setdefault(sender, []).append((own.records[is_first], seconds[is_first]))
    return {
        sender: (np.concatenate([*starts, [capture.size]]), np.concatenate(stamps))
        for sender, parts in found.items()
        for starts, stamps in [zip(*parts, strict=True)]
    }


class SweepCutter:
    """Cuts the packets of one sensor, which come in pieces, into sweeps; what it keeps does not grow."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._last: Datagrams | None = None
        self._seconds, self._sense = 0.0, 0
        self._turn = np.array([0.0, 0.0, -np.inf])

    def cut(self, packets: Datagrams) -> tuple[Mask, Array]:
        """Return of the sensor's next packets, at least one, which begin a sweep (N,), and their stamps (N,)."""
        turned = self._layout.turned(packets)
        self._sense = self._sense or int(np.sign(usual_turn(turned)))
        turned = turned * (self._sense or 1)
        known = packets if self._last is None else Datagrams.concatenate([self._last, packets])
        if self._last is None:
            self._seconds = float(packets.seconds[0])
            self._turn[0] = turned[0] if self._layout.turns and self._layout.mirrors == 1 else 0.0
        clock = self._layout.clock(known)
        seconds = (self._seconds + clock - clock[0])[len(known) - len(packets) :]
        is_first = np.zeros(len(packets), bool)
        _mark_first(turned, seconds, self._turn, is_first)
        self._last, self._seconds = packets[np.array([-1])], float(seconds[-1])
        return is_first, seconds


def usual_turn(azimuth: np.ndarray) -> float:
    """Return how far a sensor turns from one of (N,) directions to the next, in 1/36000 of a turn.

    It is less than 0 where it turns back, and 0 where it rests.
    """
    steps = (np.diff(azimuth.astype(np.float64)) + 18000.0) % 36000.0 - 18000.0
    return float(np.median(steps[steps != 0.0])) if steps.any() else 0.0


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
