"""How much memory a process and its children take at most."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from types import TracebackType

_EVERY = 0.2  # s


class PeakMemory:
    """Watches this process and its children while it is open as a context; Linux only.

    Attributes
    ----------
    peak : bytes (shared pages counted in part, so that nothing is counted twice), nan where it cannot be told.
    """

    def __init__(self) -> None:
        self.peak = float("nan")
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> PeakMemory:
        if Path("/proc/self/smaps_rollup").exists():
            self.peak = 0.0
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._done.set()
        if self._thread.is_alive():
            self._thread.join()

    def _watch(self) -> None:
        while True:
            self.peak = max(self.peak, float(sum(_bytes_of(pid) for pid in _family(os.getpid()))))
            if self._done.wait(_EVERY):
                return


def _family(pid: int) -> list[int]:
    """Return `pid` and all its descendants."""
    family = [pid]
    try:
        for task in Path(f"/proc/{pid}/task").iterdir():
            for child in (task / "children").read_text().split():
                family += _family(int(child))
    except OSError:  # it ended meanwhile
        pass
    return family


def _bytes_of(pid: int) -> int:
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0
    return sum(1024 * int(line.split()[1]) for line in lines if line.startswith("Pss:"))
