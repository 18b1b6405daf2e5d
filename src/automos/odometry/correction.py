"""A new path through the last scans, a few at a time, until it has caught up with the present one."""

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor

from automos.odometry.followed import Followed, TimedScan
from automos.odometry.path import Path

AT_ONCE = 8
"""Scans per new scan: beside the stream on another core, in about the time of one scan."""


class Correction:
    """A new path through the last scans, while it catches up."""

    def __init__(self, path: Path, made: list[Followed], todo: list[TimedScan], pool: ThreadPoolExecutor):
        """Take a path, its scans so far, and those that it lacks."""
        self.path, self._pool = path, pool
        self.told: list[Followed] = []
        self._made, self._todo = deque(made), deque(todo)
        self._future: Future[list[Followed]] | None = None

    def advance(self, n: int = AT_ONCE) -> list[Followed]:
        """Return the next scans on the path, at most `n`."""
        if self._future is not None:
            self._made.extend(self._future.result())
            self._future = None
        next_ones = [self._made.popleft() for _ in range(min(n, len(self._made)))]
        self.told += next_ones
        return next_ones

    def add(self, timed: TimedScan) -> None:
        """Append a new scan, and start following the next few."""
        self._todo.append(timed)
        self.follow(AT_ONCE)

    def follow(self, n: int) -> None:
        """Start following the next `n` scans."""
        few = [self._todo.popleft() for _ in range(min(n, len(self._todo)))]
        self._future = self._pool.submit(lambda: [(timed, self.path.push(timed)) for timed in few])

    @property
    def has_caught_up(self) -> bool:
        """Whether `advance` has returned all scans."""
        return bool(self.told) and self._future is None and not self._todo and not self._made
