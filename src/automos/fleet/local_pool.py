"""Worker processes on this machine, each on its own: one that dies takes nothing with it but the order it had.

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
from pathlib import Path

import automos
from automos.core.working_folder import SAFE_PATH
from automos.fleet.executors import Executor
from automos.fleet.machine import thread_limits
from automos.fleet.orders import Ended, Order, Report


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
