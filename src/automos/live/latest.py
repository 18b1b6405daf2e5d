"""A buffer for one scan between the receiving and the labelling thread."""

import threading

from automos.core.scan import Scan


class Latest:
    """The latest scan that nobody has taken yet.

    Attributes
    ----------
    left_out : scans that another came after before they were taken.
    offered : scans that were put in.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._scan: Scan | None = None
        self._is_closed = False
        self.left_out, self.offered = 0, 0

    def put(self, scan: Scan, wait: bool = False) -> None:
        """Put a scan in; where one is left, it is left out, or `wait`ed for. After `close` it is not taken any more."""
        with self._changed:
            while wait and self._scan is not None and not self._is_closed:
                self._changed.wait()
            if self._is_closed:
                return
            self.offered += 1
            self.left_out += self._scan is not None
            self._scan = scan
            self._changed.notify_all()

    def take(self, seconds: float) -> Scan | None:
        """Return the latest scan, None if none comes within `seconds` or none will come any more."""
        with self._changed:
            self._changed.wait_for(lambda: self._scan is not None or self._is_closed, seconds)
            scan, self._scan = self._scan, None
            self._changed.notify_all()
            return scan

    def close(self) -> None:
        """Say that no more scans come; the one that is left can still be taken."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()

    @property
    def is_full(self) -> bool:
        """Whether a scan waits to be taken."""
        with self._changed:
            return self._scan is not None

    @property
    def is_over(self) -> bool:
        """Whether it is closed and empty."""
        with self._changed:
            return self._is_closed and self._scan is None
