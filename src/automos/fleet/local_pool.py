"""Who does the work: one small interface, this very process, and processes on this machine.

Workers are plain child processes that read orders and write reports through their pipes. They neither import the
caller's script again nor share any state, so that a kill, a crash or an empty memory hits one order; a new process
takes the place. When the parent dies, they end themselves.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections import deque
from pathlib import Path
from types import TracebackType

import automos
from automos.core.working_folder import SAFE_PATH
from automos.fleet.orders import Ended, Order, Report
from automos.fleet.units import work
from automos.fleet.work_folder import thread_limits


class Executor:
    """Takes orders and gives back what became of them, in any order; a context that is closed at its end.

    Attributes
    ----------
    slots : int
        Orders worked on at a time.
    cores : int
        Processor cores all orders may use together.
    max_threads : int
        Most that one order may use.
    """

    def __init__(self, slots: int, cores: int, max_threads: int):
        self.slots, self.cores, self.max_threads = slots, cores, max_threads

    def submit(self, order: Order) -> None:
        """Take an order; returns at once."""
        raise NotImplementedError

    def wait(self, seconds: float) -> list[Ended]:
        """Return orders that ended or were lost, none if none does within some seconds."""
        raise NotImplementedError

    def has(self, place: str) -> bool:
        """Return whether a machine, named in earlier reports, can still be worked on."""
        return True

    def close(self) -> None:
        """Stop; what is not done is not done."""

    def __enter__(self) -> Executor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class InProcess(Executor):
    """Orders done in this process, one by one."""

    def __init__(self, cores: int = 1):
        """Take how many cores an order may use."""
        super().__init__(1, cores, max_threads=cores)
        self._orders: deque[Order] = deque()

    def submit(self, order: Order) -> None:
        """Take an order."""
        self._orders.append(order)

    def wait(self, seconds: float) -> list[Ended]:
        """Do one order and return it."""
        if not self._orders:
            return []
        order = self._orders.popleft()
        return [Ended(order, work(order))]


class LocalPool(Executor):
    """Processes of this machine."""

    def __init__(self, workers: int, cores: int):
        """Take the number of processes and their total number of cores; processes start on demand."""
        super().__init__(workers, cores, max_threads=cores)
        self._limits = thread_limits(max(1, cores // workers))
        self._idle: list[_Worker] = []
        self._busy: list[_Worker] = []
        self._said: queue.Queue[tuple[_Worker, Report | None]] = queue.Queue()

    @property
    def pids(self) -> list[int]:
        """The process ids of busy workers."""
        return [worker.process.pid for worker in self._busy]

    def submit(self, order: Order) -> None:
        """Give an order to a worker."""
        worker = self._idle.pop() if self._idle else _Worker(self._limits, self._said)
        self._busy.append(worker)
        worker.give(order)

    def wait(self, seconds: float) -> list[Ended]:
        """Return one order that ended or was lost; none after a timeout."""
        try:
            worker, report = self._said.get(timeout=seconds)
        except queue.Empty:
            return []
        order, worker.order = worker.order, None
        if worker in self._busy:
            self._busy.remove(worker)
        if report is not None:
            self._idle.append(worker)
        elif worker in self._idle:
            self._idle.remove(worker)
        if order is None:  # it died with nothing to do
            return []
        return [Ended(order, report, "" if report is not None else worker.how_it_ended())]

    def close(self) -> None:
        """End all processes."""
        for worker in (*self._busy, *self._idle):
            worker.end()
        self._busy, self._idle = [], []


class _Worker:
    def __init__(self, limits: dict[str, str], said: queue.Queue[tuple[_Worker, Report | None]]):
        source = str(Path(automos.__file__).parents[1])
        # An empty entry would be the working folder.
        path = os.pathsep.join(filter(None, [source, *os.environ.get("PYTHONPATH", "").split(os.pathsep)]))
        self.process = subprocess.Popen(
            [sys.executable, "-m", "automos.fleet.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **limits, **SAFE_PATH, "PYTHONPATH": path},
        )
        self.order: Order | None = None
        self._said = said
        threading.Thread(target=self._listen, daemon=True).start()

    def give(self, order: Order) -> None:
        self.order = order
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):  # a worker that died just now shows at its other pipe
            pickle.dump(order, self.process.stdin)
            self.process.stdin.flush()

    def how_it_ended(self) -> str:
        code = self.process.wait()
        if code >= 0:
            return f"its worker ended by itself, with code {code}"
        name = signal.Signals(-code).name if -code in set(signal.Signals) else str(-code)
        why = ": by a user, or by the system because memory ran out" if name == "SIGKILL" else ""
        return f"its worker was killed ({name}{why})"

    def end(self) -> None:
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        with contextlib.suppress(EOFError, OSError, ValueError, pickle.UnpicklingError):
            while True:
                self._said.put((self, pickle.load(self.process.stdout)))
        self._said.put((self, None))
