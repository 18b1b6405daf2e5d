"""What a person waits for comes first: what goes on beside it gives way."""

import threading
from collections.abc import Callable


class Waiting:
    """Entered while somebody waits for an answer, in which nothing that gives way is waited for."""

    def __init__(self) -> None:
        self._n, self._news = 0, threading.Condition()

    def __enter__(self) -> None:
        self._add(1)

    def __exit__(self, *error: object) -> None:
        self._add(-1)

    def _add(self, n: int) -> None:
        with self._news:
            self._n += n
            self._news.notify_all()

    def give_way(self, unless: Callable[[], bool] = lambda: False) -> None:
        """Return once nobody waits any more, or `unless` is true."""
        with self._news:
            self._news.wait_for(lambda: not self._n or unless())
