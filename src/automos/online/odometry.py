"""Poses of the sensor from the scans so far, and their correction when more is known.

The timing of sweeps and the initial speed are determined in the background from some scans. If the result differs from
the assumption, the last scans are registered again, a few with every new scan, until they have caught up; then the new
path replaces the old one.
"""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, se3_log
from automos.odometry.clock import USUAL_PERIOD
from automos.odometry.kiss import TRIAL_SCANS, find_start
from automos.odometry.motion import SweepTiming
from automos.odometry.moving_windows import MIN_BEND
from automos.online.inquiry import Inquiry, find_timing, told_by, usual_timing
from automos.online.path import Came, Path, Posed
from automos.scan import Pose, Scan
from automos.settings import OdometrySettings

TIMING_SCANS = 16
"""In which the sensor moves, from which it is found out how sweeps are timed: fewer have misled."""
OTHER_START = 0.3
"""Metres from scan to scan between two starts that are not the same."""
REMADE = 40
"""Scans that are followed once more, at most."""
AT_ONCE = 8
"""Of them, with every scan that comes: beside the stream on the other core, in about the time that one takes."""
START_SCANS, START_PATIENCE = (3, 6, TRIAL_SCANS), 0.1
"""Scans from which it is found out how fast the sensor was at first, soon and then more surely, and seconds to wait."""


@dataclass(frozen=True, eq=False)
class Moved:
    """How the sensor moved up to a scan.

    Attributes
    ----------
    stamp : float
        Seconds.
    posed : Posed
        Where it was seen from, in the world of the path that is followed.
    again : tuple[tuple[Came, Posed], ...]
        Earlier scans on the path that will be taken over, each with its stamp; at first its world is the present one.
    T_before_now : (4, 4) float64, optional
        From the new path's world to that of the one before, in which the last scan stays where it was; None if no
        other path was taken over.
    """

    stamp: float
    posed: Posed
    again: tuple[tuple[Came, Posed], ...] = ()
    T_before_now: Pose | None = None


class _Correction:
    """Another path through the last scans, while it catches up."""

    def __init__(self, path: Path, todo: list[Came], pool: ThreadPoolExecutor):
        self.path, self._pool = path, pool
        self.made: list[tuple[Came, Pose]] = []
        self._todo = deque(todo)
        self._asked: Future[list[tuple[Came, Posed]]] | None = None

    def advance(self) -> list[tuple[Came, Posed]]:
        """Return the scans that were followed since `add`."""
        done = [] if self._asked is None else self._asked.result()
        self.made += [(came, posed.T_world_sensor) for came, posed in done]
        return done

    def add(self, came: Came) -> None:
        """Take a scan that has come meanwhile, and begin on the next few."""
        self._todo.append(came)
        few = [self._todo.popleft() for _ in range(min(AT_ONCE, len(self._todo)))]
        self._asked = self._pool.submit(lambda: [(came, self.path.follow(came)) for came in few])

    def catch_up(self) -> None:
        """Begin on all scans at once."""
        todo, self._todo = list(self._todo), deque()
        self._asked = self._pool.submit(lambda: [(came, self.path.follow(came)) for came in todo])

    @property
    def has_caught_up(self) -> bool:
        """Whether all scans were followed, once `advance` has returned."""
        return self._asked is not None and not self._todo


class CausalOdometry:
    """The motion of the sensor, scan by scan."""

    def __init__(
        self,
        settings: OdometrySettings,
        pool: ThreadPoolExecutor,
        timing: SweepTiming | None = None,
        is_compensated: bool | None = None,
    ):
        """Take threads to work with, and how sweeps are timed, or None if that is to be found out."""
        if timing is None and (is_compensated or settings.time == "none"):
            timing = SweepTiming()
        self._settings, self._pool, self._is_compensated = settings, pool, is_compensated
        self._choice: Inquiry[SweepTiming] | None = None if timing is not None else Inquiry(2.0)
        self._start: Inquiry[npt.NDArray[np.float64]] | None = Inquiry(START_PATIENCE)
        self._trials = deque(START_SCANS)
        self._n, self._stamp, self._steps = 0, 0.0, deque[float](maxlen=50)
        self._last = deque[tuple[Came, Pose]](maxlen=REMADE)
        self._path = Path(settings, timing or SweepTiming(), None, np.eye(4))
        self._correction: _Correction | None = None

    def step(self, scan: Scan) -> Moved:
        """Return how the sensor moved from the last scan to this one."""
        came = self._clocked(scan)
        if self._choice is not None and self._n < 2:
            self._guess_timing(scan)
        again, T_before_now = self._correct()
        posed = self._path.follow(came)
        self._n += 1
        self._last.append((came, posed.T_world_sensor))
        if self._correction is not None:
            self._correction.add(came)
        self._ask()
        return Moved(came.stamp, posed, tuple(again), T_before_now)

    def _guess_timing(self, scan: Scan) -> None:
        """Take points for timed as they say, or as is usual, from the second scan on: what a sensor sends is raw."""
        timing = told_by(scan)
        if timing is None and self._n == 1:
            timing = usual_timing([self._last[0][0].scan, scan], self._settings)
        if timing is not None:
            self._path.timing = timing

    def _ask(self) -> None:
        """Begin to find out what can be found out from the scans so far."""
        timing, settings = self._path.timing, self._settings
        if self._start is not None and not self._start.is_asked and self._n >= self._trials[0]:
            first = [came for came, _ in self._last][: self._trials[0]]
            scans, gaps = [came.scan for came in first], np.array([came.gap for came in first[1:]])
            self._start.ask(lambda: find_start(scans, settings, timing, gaps), self._stamp)
        if self._choice is not None and not self._choice.is_asked and self._n >= TIMING_SCANS:
            last = list(self._last)[-TIMING_SCANS:]
            come = np.linalg.norm(np.diff([T[:3, 3] for _, T in last], axis=0), axis=1)
            if come.mean() >= MIN_BEND:
                moving = [replace(came.scan, stamp=came.stamp) for came, _ in last]
                self._choice.ask(lambda: find_timing(moving, settings, self._is_compensated), self._stamp)

    def _correct(self) -> tuple[list[tuple[Came, Posed]], Pose | None]:
        """Hear what was found out, and follow the last scans once more if need be."""
        if self._correction is None:
            self._correction = self._hear()
        if self._correction is None:
            if self._start is None and self._choice is None:
                self._last.clear()
            return [], None
        again, T_before_now = self._correction.advance(), None
        if self._correction.has_caught_up:
            T_before_now = self._path.T_world_sensor @ inverse(self._correction.path.T_world_sensor)
            self._last = deque(self._correction.made, maxlen=REMADE)
            self._path, self._correction = self._correction.path, None
        return again, T_before_now

    def _hear(self) -> _Correction | None:
        """Return the correction that is due where something was found out that changes where the last scans lie."""
        if self._n == 2 and self._path.timing.share:  # now it is known how the first sweep was bent
            correction = self._follow_again(self._path.timing, self._path.twist)
            correction.catch_up()
            return correction
        start = None if self._start is None else self._start.answer(self._stamp)
        timing = None if self._choice is None else self._choice.answer(self._stamp)
        if start is None and timing is None:
            return None
        if start is not None:
            self._trials.popleft()
            self._start = Inquiry(START_PATIENCE) if self._trials else None
        self._choice = self._choice if timing is None else None
        twist = se3_log(inverse(self._last[0][1]) @ self._last[1][1]) / self._last[1][0].gap
        is_other_start = start is not None and np.linalg.norm(twist[:3] - start[:3]) > OTHER_START
        if not is_other_start and (timing is None or str(timing) == str(self._path.timing)):  # else by a hair
            return None
        return self._follow_again(timing or self._path.timing, twist if start is None else start)

    def _follow_again(self, timing: SweepTiming, twist: npt.NDArray[np.float64]) -> _Correction:
        """Return another path through the last scans, with a first motion of `twist` per usual gap."""
        path = Path(self._settings, timing, twist, self._last[0][1])
        return _Correction(path, [came for came, _ in self._last], self._pool)

    @property
    def _period(self) -> float:
        return float(np.median(self._steps)) if self._steps else USUAL_PERIOD

    def _clocked(self, scan: Scan) -> Came:
        """Return the scan with the usual gaps since the last one, and move the clock on."""
        before, gap = self._stamp, 1.0
        if self._n == 0:
            self._stamp = scan.stamp or 0.0
            return Came(scan, self._stamp, 0.0, self._period)
        self._stamp = before + USUAL_PERIOD if scan.stamp is None else scan.stamp
        passed = self._stamp - before
        if passed > 0.0:  # else out of order
            usual = self._period if self._steps else passed
            self._steps.append(passed)
            gap = passed / usual if passed > 1.5 * usual else 1.0
        return Came(scan, self._stamp, gap, self._period)
