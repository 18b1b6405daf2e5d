"""Time and memory that a method took on a recording, for each of its runs, and how they are measured."""

from __future__ import annotations

import os
import statistics
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from automos.core.reading import read_json

_EVERY = 0.2  # s


class Effort:
    """Context manager that measures this process and its children; memory and processor time on Linux only.

    Attributes
    ----------
    seconds : by the clock.
    peak : bytes at most (shared pages counted in part, so that nothing is counted twice), nan if unknown.
    busy : seconds of processor time, nan if unknown.
    others : processor cores that others kept busy on average, nan if unknown.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        self.peak = self.busy = self.others = float("nan")
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._before: dict[int, float] = {}
        self._busy_of: dict[int, float] = {}

    def __enter__(self) -> Effort:
        self._start, self._machine = time.perf_counter(), _busy_seconds()
        if Path("/proc/self/smaps_rollup").exists():
            self.peak = 0.0
            # What helpers that work on from before have computed is not of this context.
            self._before = {pid: _busy_of(pid) for pid in _family(os.getpid())}
            self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.seconds = time.perf_counter() - self._start
        self._done.set()
        if self._thread.is_alive():
            self._thread.join()
            self.busy = sum(busy - self._before.get(pid, 0.0) for pid, busy in self._busy_of.items())
            self.others = max(_busy_seconds() - self._machine - self.busy, 0.0) / self.seconds

    def _watch(self) -> None:
        while True:
            family = _family(os.getpid())
            self.peak = max(self.peak, float(sum(_bytes_of(pid) for pid in family)))
            self._busy_of |= {pid: busy for pid in family if (busy := _busy_of(pid)) > 0.0}
            if self._done.wait(_EVERY):
                self._busy_of[os.getpid()] = _busy_of(os.getpid())
                return


def _family(pid: int) -> list[int]:
    """Return `pid` and all its descendants."""
    family = [pid]
    with suppress(OSError):  # it ended meanwhile
        for task in Path(f"/proc/{pid}/task").iterdir():
            for child in (task / "children").read_text().split():
                family += _family(int(child))
    return family


def _bytes_of(pid: int) -> int:
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0
    return sum(1024 * int(line.split()[1]) for line in lines if line.startswith("Pss:"))


def _busy_of(pid: int) -> float:
    """Return the seconds that process `pid` has computed, 0 if it has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _busy_seconds() -> float:
    """Return the seconds that all cores together have computed since the machine started, nan if unknown."""
    try:
        user, nice, system, _, _, irq, softirq = Path("/proc/stat").read_text().splitlines()[0].split()[1:8]
    except (OSError, ValueError):
        return float("nan")
    return sum(map(int, (user, nice, system, irq, softirq))) / os.sysconf("SC_CLK_TCK")


ALONE = 0.1
"""Processor cores that others may keep busy while something is timed; where more were, seconds are upper bounds."""


@dataclass(frozen=True)
class Cost:
    """Time and memory of a method, one value per run. Bytes, seconds and cores are nan if unknown.

    Attributes
    ----------
    seconds : list of float
        Per scan, by the clock.
    busy : list of float
        Per scan, seconds of processor time.
    memory : list of float
        Bytes, at most, of the process and its children with all their libraries.
    others : list of float
        Processor cores that other programs kept busy meanwhile.
    """

    seconds: list[float]
    busy: list[float]
    memory: list[float]
    others: list[float]

    @property
    def seconds_per_scan(self) -> float:
        """The median of the runs."""
        return statistics.median(self.seconds)

    @property
    def spread(self) -> float:
        """Seconds per scan between the fastest and the slowest run."""
        return max(self.seconds) - min(self.seconds)

    @property
    def peak_memory(self) -> float:
        """Bytes, the maximum over all runs."""
        return max(self.memory)

    @property
    def was_alone(self) -> bool:
        """Whether other programs used hardly any processor time."""
        return max(self.others) <= ALONE


def read_cost(file: Path, key: str) -> Cost | None:
    """Return the cost stored in `file` for a run with fingerprint `key`; None if there is none."""
    try:
        found = read_json(file)
        return Cost(**{name: found[name] for name in Cost.__annotations__}) if found["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError):  # damaged from outside: it is run again
        return None
