"""Returns labelled scans in the order of their arrival, including unusable ones."""

from collections import deque
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from automos.online.intake import Kind, Taken
from automos.online.labelled_scan import LabelledScan


class ReturnOrder:
    """Holds labelled scans until all earlier ones can be returned, too."""

    def __init__(self) -> None:
        self._pending: deque[tuple[int, Taken, int]] = deque()  # index, role, number of points
        self._ready: dict[int, LabelledScan] = {}
        self._last: LabelledScan | None = None

    def expect(self, index: int, about: Taken, n_points: int) -> None:
        """Register the arrival of scan `index` with `n_points` points."""
        self._pending.append((index, about, n_points))

    def add(self, labelled: Iterable[LabelledScan]) -> None:
        """Add labelled scans."""
        self._ready.update((scan.index, scan) for scan in labelled)

    def take(self) -> list[LabelledScan]:
        """Return the ready scans before the first one that is not ready."""
        done = []
        while self._pending:
            index, about, n_points = self._pending[0]
            if about.kind in (Kind.NEXT, Kind.RESTART):
                if index not in self._ready:
                    break
                scan = self._ready.pop(index)
            else:
                scan = self._unusable(index, about, n_points)
            if about.kind not in (Kind.LATE, Kind.EMPTY):  # a repeat after it has the labels of the scan before it
                self._last = scan
            self._pending.popleft()
            done.append(scan)
        return done

    def _unusable(self, index: int, about: Taken, n_points: int) -> LabelledScan:
        """Return the result for an unusable scan; a repeated scan has the labels of the original."""
        last = self._last
        if about.kind is Kind.REPEAT and last is not None and len(last.labels) == n_points:
            return replace(last, index=index, stamp=about.stamp)
        return LabelledScan.of_nothing(index, about.stamp, np.eye(4) if last is None else last.pose, n_points)
