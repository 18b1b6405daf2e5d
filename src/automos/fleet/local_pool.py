"""Who does the work: one small interface, this very process, and processes on this machine.

Workers are plain child processes that read orders and write reports through their pipes. They neither import the
caller's script again nor share any state, so that a kill, a crash or an empty memory hits one order; a new process
takes the place. When the parent dies, they end themselves.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from concurrent import futures
from pathlib import Path

import automos
from automos.core.parallel import SAFE_PATH
from automos.fleet.orders import Ended, Order
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

    def __exit__(self, *error: object) -> None:
        self.close()


class InProcess(Executor):
    """Orders done in this process, one by one."""

    def __init__(self) -> None:
        super().__init__(1, 1, max_threads=1)
        self._orders: list[Order] = []

    def submit(self, order: Order) -> None:
        """Take an order."""
        self._orders.append(order)

    def wait(self, seconds: float) -> list[Ended]:
        """Do what was taken and return it."""
        orders, self._orders = self._orders, []
        return [Ended(order, work(order)) for order in orders]


class LocalPool(Executor):
    """Processes of this machine, each with a thread of ours that waits for it."""

    def __init__(self, workers: int, cores: int):
        """Take the number of processes and their total number of cores; processes start on demand."""
        super().__init__(workers, cores, max_threads=cores)
        self._limits = thread_limits(max(1, cores // workers))
        self._waiting = futures.ThreadPoolExecutor(workers)
        self._idle: list[subprocess.Popen[bytes]] = []
        self._busy: dict[futures.Future[Ended], subprocess.Popen[bytes]] = {}

    @property
    def pids(self) -> list[int]:
        """The process ids of busy workers."""
        return [worker.pid for worker in self._busy.values()]

    def submit(self, order: Order) -> None:
        """Give an order to a worker."""
        self._idle = [worker for worker in self._idle if worker.poll() is None]
        worker = self._idle.pop() if self._idle else _started(self._limits)
        self._busy[self._waiting.submit(_done_by, worker, order)] = worker

    def wait(self, seconds: float) -> list[Ended]:
        """Return orders that ended or were lost; none after a timeout."""
        ended = []
        for future in futures.wait(self._busy, seconds, futures.FIRST_COMPLETED).done:
            ended.append(future.result())
            worker = self._busy.pop(future)
            if ended[-1].report is not None:
                self._idle.append(worker)
        return ended

    def close(self) -> None:
        """End all processes."""
        workers = (*self._busy.values(), *self._idle)
        for worker in workers:
            worker.kill()
        self._waiting.shutdown()
        for worker in workers:
            worker.communicate()  # closes its pipes
        self._busy, self._idle = {}, []


def _started(limits: dict[str, str]) -> subprocess.Popen[bytes]:
    source = str(Path(automos.__file__).parents[1])
    # An empty entry would be the working folder.
    path = os.pathsep.join(filter(None, [source, *os.environ.get("PYTHONPATH", "").split(os.pathsep)]))
    return subprocess.Popen(
        [sys.executable, "-m", "automos.fleet.worker"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, **limits, **SAFE_PATH, "PYTHONPATH": path},
    )


def _done_by(worker: subprocess.Popen[bytes], order: Order) -> Ended:
    """Return what became of `order`, which the process is given."""
    assert worker.stdin is not None
    assert worker.stdout is not None
    try:
        pickle.dump(order, worker.stdin)
        worker.stdin.flush()
        return Ended(order, pickle.load(worker.stdout))
    except (EOFError, OSError, ValueError, pickle.UnpicklingError):
        return Ended(order, None, _how_it_ended(worker.wait()))


def _how_it_ended(code: int) -> str:
    if code >= 0:
        return f"its worker ended by itself, with code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else str(-code)
    why = ": by a user, or by the system because memory ran out" if name == "SIGKILL" else ""
    return f"its worker was killed ({name}{why})"
