"""Packets of one sensor over UDP: received on one address, separated from other packets."""

import logging
import math
import select
import socket
import time
from contextlib import suppress
from typing import Protocol

from automos.core.errors import InputError
from automos.core.reading import parse_url
from automos.core.scan import Scan
from automos.live.feed import Feed

_log = logging.getLogger(__name__)

LOCAL = "127.0.0.1"
BUFFER = 1 << 23
"""Bytes that the system is asked to keep while we are busy: some sweeps."""
AT_ONCE = 128
"""Packets that are looked at together, at most."""
LONGEST = 65536
POLL = 0.1
"""Seconds after which the thread looks whether it should end."""


class Assembler(Protocol):
    """Makes scans of the packets of one sensor."""

    kind: str

    def add(self, payloads: list[bytes], seconds: list[float]) -> tuple[list[Scan], int]:
        """Take packets and when each came; return the scans they complete, and how many were no such packets."""

    def rest(self) -> list[Scan]:
        """Return the scan that was begun, if there is one."""


def parse_address(text: str) -> tuple[str, int]:
    """Return host and port of udp://HOST:PORT; without a host, this machine alone.

    Raises
    ------
    InputError : it is no such address.
    """
    parts = parse_url(text)
    try:
        port = parts.port
    except ValueError:
        port = None
    if parts.scheme != "udp" or port is None or parts.path not in ("", "/"):
        raise InputError(
            f"{text} is not an address: write udp://127.0.0.1:2368, or udp://0.0.0.0:2368 for all networks"
        )
    return parts.hostname or LOCAL, port


class UdpFeed(Feed):
    """The scans of one sensor, the first one that sends to this address."""

    def __init__(self, host: str, port: int, assembler: Assembler, patience: float = 10.0):
        """Listen at host and port, nowhere else.

        Parameters
        ----------
        assembler : Assembler
            Of the sensor's maker.
        patience : float
            Seconds without packets of the sensor after which the feed ends, with a sentence.

        Raises
        ------
        InputError
            The port is taken, the address is none of this machine's, or `patience` no number of seconds.
        """
        super().__init__()
        if not 0.0 < patience < math.inf:
            raise InputError(f"a timeout of {patience:g} s never ends or never begins: give some seconds")
        self.name = f"{assembler.kind.lower()}_{port}"
        self._where, self._patience, self._assembler = f"{host}:{port}", patience, assembler
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise InputError(
                f"udp://{self._where} cannot be listened at ({error.strerror or error}); end the program that does, "
                "or give an address and a port of this machine that are free"
            ) from None
        self._socket.setblocking(False)
        self.port = int(self._socket.getsockname()[1])
        self._sender: str | None = None
        self.n_packets, self.n_foreign = 0, 0

    def receive(self) -> None:
        """Put in every sweep when it is over."""
        last = time.monotonic()
        try:
            while not self._stop.is_set():
                came = self._packets()
                scans, n_own = self._assembled(came)
                self._count(n_own, len(came) - n_own, came)
                if n_own:
                    last = time.monotonic()
                elif time.monotonic() - last > self._patience:
                    self._give_up()
                    return
                for scan in scans:
                    self.latest.put(scan)
        finally:
            self._socket.close()
            for scan in self._assembler.rest():
                self.latest.put(scan)

    def _assembled(self, came: list[tuple[bytes, float, str]]) -> tuple[list[Scan], int]:
        """Return the scans that are complete, and how many packets were the sensor's, the first that sends any.

        What waited while we got ready comes at once, and another program's packets may be among it, even the last.
        """
        scans: list[Scan] = []
        n_own = first = 0
        while self._sender is None and first < len(came):
            payload, moment, sender = came[first]
            found, n_foreign = self._assembler.add([payload], [moment])
            if not n_foreign:
                self._sender, n_own = sender, 1
                scans += found
            first += 1
        own = [packet for packet in came[first:] if packet[2] == self._sender]
        if own:
            found, n_foreign = self._assembler.add([p[0] for p in own], [p[1] for p in own])
            scans, n_own = [*scans, *found], n_own + len(own) - n_foreign
        return scans, n_own

    def summary(self) -> str:
        """Return how many packets came that were not the sensor's."""
        if not self.n_foreign:
            return ""
        return f"{self.n_foreign:,} of {self.n_packets + self.n_foreign:,} packets were not the sensor's"

    def _packets(self) -> list[tuple[bytes, float, str]]:
        """Return what came: payload, when in seconds, and the sender's address; at most `AT_ONCE`."""
        came: list[tuple[bytes, float, str]] = []
        if select.select([self._socket], [], [], POLL)[0]:
            with suppress(BlockingIOError):  # nothing more is there
                while len(came) < AT_ONCE:
                    payload, sender = self._socket.recvfrom(LONGEST)
                    came.append((payload, time.time(), sender[0]))
        return came

    def _count(self, n_own: int, n_foreign: int, came: list[tuple[bytes, float, str]]) -> None:
        if n_foreign and not self.n_foreign:
            payload, _, sender = came[-1]
            _log.warning(
                "packets that no %s sends come to %s too, or those of a second sensor (%d bytes from %s); they are "
                "left out",
                self._assembler.kind, self._where, len(payload), sender,
            )  # fmt: skip
        self.n_packets, self.n_foreign = self.n_packets + n_own, self.n_foreign + n_foreign

    def _give_up(self) -> None:
        """Say that nothing comes any more; raise InputError if nothing came at all."""
        seconds, others = f"{self._patience:g} s", ""
        if self.n_foreign:
            others = f", but {self.n_foreign:,} of another kind or sensor did; is --sensor right?"
        if self.n_packets:
            _log.warning("no packets of the %s came for %s%s", self._assembler.kind, seconds, others)
            return
        raise InputError(
            f"no packets of a {self._assembler.kind} came to udp://{self._where} for {seconds}{others or ';'} look at "
            "the address and port that the sensor sends to, or listen on all networks, udp://0.0.0.0:PORT"
        )
