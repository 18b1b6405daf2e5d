"""Packets of a Velodyne as they arrive: cut into sweeps and decoded exactly as those of a capture are."""

from itertools import count, pairwise

import numpy as np

from automos.core.scan import Scan
from automos.readers.packets.decode import to_scan
from automos.readers.packets.layouts import VELODYNE, layout_of
from automos.readers.packets.pcap import Datagrams, join
from automos.readers.packets.sweeps import SweepCutter
from automos.readers.packets.velodyne import FACTORY, VelodyneDecoder, tells_calibration

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
        bounds = [0, *np.flatnonzero(is_first).tolist(), len(packets)]
        for a, b in pairwise(bounds):
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
        return [to_scan(self._decoder.columns(join(parts)), self._stamp, f"{next(self._number):06d}")]

    def _is_own(self, payload: bytes) -> bool:
        if layout_of(payload) is not VELODYNE:
            return False
        return self._decoder is None or self._sends_calibration or payload[FACTORY] == self._first[0][FACTORY]

    def _learn(self, packets: Datagrams) -> None:
        """Keep the packets that contain the model, and of an HDL-64E its calibration."""
        wanted = CALIBRATION if self._sends_calibration else MODEL_PACKETS
        for payload in packets.payloads:
            if len(self._first) < wanted:
                self._first.append(payload.tobytes())
                if len(self._first) == MODEL_PACKETS:
                    self._sends_calibration = tells_calibration(self._first)
                    wanted = CALIBRATION if self._sends_calibration else MODEL_PACKETS
                    self._decoder = VelodyneDecoder(self._first, "what comes")
