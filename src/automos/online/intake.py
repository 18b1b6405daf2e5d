"""Checks each arriving scan: whether it is the next one, unusable, or the start of a new stream.

Drivers send scans twice, late or empty; cables are unplugged, clocks are set, sensors are replaced. None of this may
stop a robot: unusable scans are skipped, and after an interruption a new stream starts. One scan with a wrong stamp is
no interruption: a pause is believed once a second scan confirms it. A clock that stands still is replaced by counting.
"""

from collections import deque
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np

from automos.core.scan import LATEST, Points, Scan
from automos.odometry.clock import SHORTEST_PERIOD, USUAL_PERIOD

LONGEST_GAP = 0.8
"""Seconds without scans after which tracking stops, and the sensor may have been replaced."""
USUAL_GAPS = 3.0
"""Usual periods that such a gap must also exceed: some sensors take one scan per second."""
MOST_LATE = 5
"""Consecutive late scans after which the clock is assumed to have been set back."""


class Kind(Enum):
    """Role of a scan in the stream."""

    NEXT, RESTART, REPEAT, LATE, EMPTY = auto(), auto(), auto(), auto(), auto()  # a scan far ahead of its time is LATE


@dataclass(frozen=True)
class Taken:
    """Role of a scan, its time in seconds, and a warning if there is a new problem."""

    kind: Kind
    stamp: float
    warning: str = ""


class Intake:
    """Checks every scan before it is processed."""

    def __init__(self, longest_gap: float = LONGEST_GAP, rate: float | None = None) -> None:
        """Take the seconds without scans after which a new stream starts, and the scans a second without stamps."""
        self._longest_gap, self._period = longest_gap, USUAL_PERIOD if rate is None else 1.0 / rate
        self._stamp: float | None = None
        self._own: float | None = None  # of the last scan, as it came
        self._ahead: float | None = None  # of a scan after a pause that no other scan has confirmed
        self._points: Points | None = None
        self._n_lidars = 0
        self._steps: deque[float] = deque(maxlen=20)
        self._n_late = 0
        self._trouble: Kind | None = None
        self._is_stopped = False

    @property
    def has_stamps(self) -> bool:
        """Whether the last scan came with its time."""
        return self._own is not None

    def take(self, scan: Scan) -> Taken:
        """Return the role of the scan. A lasting problem is reported once."""
        own = scan.stamp
        stamp, is_stopped = self._stamp_of(scan)
        kind, why = self._judge(scan, stamp)
        if kind in (Kind.NEXT, Kind.RESTART):
            if self._stamp is not None and kind is Kind.NEXT:
                self._steps.append(stamp - self._stamp)
            self._stamp, self._points, self._n_late, self._n_lidars = stamp, scan.points, 0, scan.n_sensors
        if kind is Kind.RESTART:
            self._steps.clear()
        is_new = kind is not self._trouble or kind is Kind.RESTART
        self._trouble = None if kind is Kind.NEXT else kind
        if own is not None and not abs(own) < LATEST and not why:
            why = f"its stamp {own} is invalid; the usual period after the previous scan is assumed"
        if is_stopped and kind is Kind.NEXT and not self._is_stopped:
            why = f"its clock stands still at {own} s; the usual period after the previous scan is assumed"
        self._is_stopped = is_stopped
        return Taken(kind, stamp, why if is_new else "")

    def _stamp_of(self, scan: Scan) -> tuple[float, bool]:
        """Return the time of the scan, and whether its clock stands still."""
        own, before = scan.stamp, self._own
        self._own = own
        is_stopped = own is not None and before is not None and abs(own - before) < SHORTEST_PERIOD
        if own is not None and abs(own) < LATEST and not is_stopped:
            return float(own), False
        period = float(np.median(self._steps)) if self._steps else self._period
        return 0.0 if self._stamp is None else self._stamp + period, is_stopped

    def _judge(self, scan: Scan, stamp: float) -> tuple[Kind, str]:
        if not scan.is_valid.any():
            return Kind.EMPTY, "it has no valid points; it is returned unlabelled"
        if self._stamp is None or self._points is None:
            return Kind.NEXT, ""
        if np.array_equal(scan.points, self._points, equal_nan=True):
            return Kind.REPEAT, "it repeats the previous scan; it gets the same labels"
        if scan.n_sensors != self._n_lidars:
            return Kind.RESTART, f"it has {scan.n_sensors} LiDARs, after {self._n_lidars}; a new stream starts"
        if stamp < self._stamp + SHORTEST_PERIOD:
            self._n_late += 1
            if self._n_late < MOST_LATE:
                return (
                    Kind.LATE,
                    f"it is not later than the previous scan ({stamp - self._stamp:+.3f} s); skipped, unlabelled",
                )
            return Kind.RESTART, f"the clock was set back to {stamp:.3f} s; a new stream starts"
        gap = stamp - self._stamp
        usual = float(np.median(self._steps)) if self._steps else LONGEST_GAP
        longest, ahead = max(self._longest_gap, USUAL_GAPS * usual), self._ahead
        self._ahead = stamp if gap > longest else None
        if self._ahead is None:
            return Kind.NEXT, ""
        if ahead is not None and SHORTEST_PERIOD <= stamp - ahead <= longest:
            self._ahead = None
            return Kind.RESTART, f"no scans for {ahead - self._stamp:.1f} s; a new stream starts"
        return (
            Kind.LATE,
            f"it is {gap:.1f} s later than the previous scan; skipped, unlabelled, unless it goes on there",
        )
