"""Who does the work: one small interface, and the simplest kind of it, this very process."""

from __future__ import annotations

from collections import deque
from types import TracebackType

from automos.fleet.orders import Ended, Order
from automos.fleet.units import work


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
