"""Poses of scans as they come: from the scans so far, never from later ones.

A scan is laid on submaps of the last seconds, beginning where it is expected. At the start, and where it does not fit
there, it is registered to the last scans as KISS-ICP does, which looks further around.


How sweeps are timed is a property of the sensor; it is found out once, from the first scans in which the sensor moves,
beside the stream. Two seconds later the answer is taken over and the last scans are made anew. Until then points are
taken as their own times say, or as they come.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, se3_exp, se3_log
from automos.odometry.clock import USUAL_PERIOD
from automos.odometry.kiss import START_SCANS, STEP_DIGITS, TRIAL_SCANS, find_start
from automos.odometry.motion import MIN_POINTS, SweepTiming, usable_points
from automos.odometry.moving_windows import MIN_BEND
from automos.odometry.surfels import Surfels, surfels_of
from automos.online.inquiry import Inquiry, find_timing, told_by
from automos.online.near_map import NearMap
from automos.online.past_submaps import Come, Laid, PastSubmaps
from automos.scan import Pose, Scan
from automos.settings import OdometrySettings

FIRST_STEPS = np.concatenate([s * np.vstack([np.eye(6)[:2], -np.eye(6)[:2]]) for s in (0.4, 0.8, 1.2, 1.8, 2.5)])
"""Metres along the sensor's axes at which the second scan is tried: a registration begun at rest may stay there."""
OTHER_START = 0.3
"""Metres from scan to scan between two starts that are not the same."""
REMADE = 40
"""Scans that are made anew, at most, once it is known how sweeps are timed."""
DOUBTFUL = 0.7
"""Of the usual share of surfels that lie on what was seen before, below which a scan may lie elsewhere."""


@dataclass(frozen=True, eq=False)
class Remade:
    """An earlier scan, now that it is known how sweeps are timed: where it was seen from, as this scan sees it."""

    scan: Scan
    stamp: float
    T_now_then: Pose
    timing: SweepTiming
    sweep_motion: npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Moved:
    """How the sensor moved up to a scan.

    Attributes
    ----------
    T_last_this : (4, 4) from this scan's sensor frame to the one before; identity for the first.
    stamp : seconds.
    timing : how the time of each point is known.
    sweep_motion : (6,) motion during the sweep, for its compensation.
    remade : the last scans, where it has just become known how sweeps are timed.
    """

    T_last_this: Pose
    stamp: float
    timing: SweepTiming
    sweep_motion: npt.NDArray[np.float64]
    remade: tuple[Remade, ...] = ()


@dataclass(frozen=True, eq=False)
class _Waiting:
    scan: Scan
    stamp: float
    gap: float
    T_world_sensor: Pose


class CausalOdometry:
    """The motion of the sensor, scan by scan."""

    def __init__(
        self,
        settings: OdometrySettings,
        timing_scans: int,
        timing: SweepTiming | None = None,
        is_compensated: bool | None = None,
    ):
        """Take how sweeps are timed, or None where it is to be found out after `timing_scans` scans."""
        if timing is None and (is_compensated or settings.time == "none"):
            timing = SweepTiming()
        self._settings, self._wanted, self._is_compensated = settings, timing_scans, is_compensated
        self._timing = timing
        self._choice: Inquiry[SweepTiming] | None = None if timing is not None else Inquiry(2.0)
        self._start: Inquiry[npt.NDArray[np.float64]] | None = Inquiry(1.0)
        self._n, self._stamp, self._steps = 0, 0.0, deque[float](maxlen=50)
        self._waiting = deque[_Waiting](maxlen=REMADE)
        self._past, self._near = PastSubmaps(settings), NearMap(settings)
        self._shares = deque[float](maxlen=20)
        self._T: Pose = np.eye(4)
        self._twist = np.zeros(6)

    def step(self, scan: Scan) -> Moved:
        """Return how the sensor moved from the last scan to this one."""
        gap = self._gap(scan)
        if self._choice is not None and self._timing is None:
            self._timing = told_by(scan)
        remade = self._take_answers()
        T_last_this = self._register(scan, gap)
        self._n += 1
        self._waiting.append(_Waiting(scan, self._stamp, gap, self._T))
        self._ask()
        T_now_last = inverse(T_last_this)
        remade = tuple(replace(r, T_now_then=T_now_last @ r.T_now_then) for r in remade)
        timing = self._timing or SweepTiming()
        return Moved(T_last_this, self._stamp, timing, timing.share * self._twist, remade)

    def _ask(self) -> None:
        """Begin to find out what can be found out from the scans so far."""
        timing, settings = self._timing or SweepTiming(), self._settings
        if self._start is not None and not self._start.is_asked and self._n == TRIAL_SCANS:
            first = list(self._waiting)
            scans, gaps = [w.scan for w in first], np.array([w.gap for w in first[1:]])
            self._start.ask(lambda: find_start(scans, settings, timing, gaps), self._stamp)
        if self._choice is None or self._choice.is_asked or self._n % self._wanted:
            return
        last = list(self._waiting)[-self._wanted :]
        come = np.linalg.norm(np.diff([w.T_world_sensor[:3, 3] for w in last], axis=0), axis=1)
        if len(last) > 1 and come.mean() >= MIN_BEND:
            moving = [replace(w.scan, stamp=w.stamp) for w in last]
            self._choice.ask(lambda: find_timing(moving, settings, self._is_compensated), self._stamp)

    def _take_answers(self) -> tuple[Remade, ...]:
        """Lay the last scans anew if something was found out that changes where they lie; return them, if so."""
        remade: tuple[Remade, ...] = ()
        start = None if self._start is None else self._start.answer(self._stamp)
        if start is not None:
            self._start = None
            believed = se3_log(inverse(self._waiting[0].T_world_sensor) @ self._waiting[1].T_world_sensor)
            if np.linalg.norm(believed[:3] - start[:3]) > OTHER_START:
                remade = self._remake(self._timing, start)
        timing = None if self._choice is None else self._choice.answer(self._stamp)
        if timing is not None:
            self._choice = None
            remade = self._remake(timing, self._twist) if timing != self._timing else remade
        if self._start is None and self._choice is None:
            self._waiting.clear()
        return remade

    def _remake(self, timing: SweepTiming | None, twist: npt.NDArray[np.float64]) -> tuple[Remade, ...]:
        """Lay the last scans anew, timed by `timing`, the first motion being `twist`.

        They are returned as the last of them sees them.
        """
        now, n, waiting = self._stamp, self._n, list(self._waiting)
        self._timing, self._twist, self._T = timing, twist, waiting[0].T_world_sensor
        self._past, self._near = PastSubmaps(self._settings), NearMap(self._settings)
        self._shares.clear()
        self._waiting.clear()
        made = []
        for k, w in enumerate(waiting):
            self._stamp = w.stamp
            self._register(w.scan, w.gap if k else 0.0)
            known = timing or SweepTiming()
            made.append(Remade(w.scan, w.stamp, self._T, known, known.share * self._twist))
            self._waiting.append(replace(w, T_world_sensor=self._T))
        self._stamp, self._n = now, n
        return tuple(replace(r, T_now_then=inverse(self._T) @ r.T_now_then) for r in made)

    def _register(self, scan: Scan, gap: float) -> Pose:
        """Return the (4, 4) from this scan's sensor frame to the one before."""
        share = 0.0 if self._timing is None else self._timing.share
        points, times = usable_points(scan, self._timing or SweepTiming(), share * self._twist, self._settings)
        surfels = surfels_of(points, times)
        step = gap * self._twist
        if gap > 0.0 and len(points) >= MIN_POINTS:
            laid = self._lay(surfels, Come(self._stamp, self._T, gap, self._twist, self._period, share, self._n == 1))
            step = np.round(se3_log(inverse(self._T) @ laid.T_world_sensor), STEP_DIGITS)
            self._twist, surfels = step / gap, laid.surfels
        T_last_this = se3_exp(step)
        self._T = self._T @ T_last_this
        self._past.add(self._stamp, self._T, surfels, self._period)
        self._near.add(self._T, surfels)
        return T_last_this

    def _lay(self, surfels: Surfels, come: Come) -> Laid:
        """Return where a scan lies: usually near where it is expected; if not, it is looked for further around."""
        expected = come.T_world_last @ se3_exp(come.gap * come.twist)
        laid = self._past.lay([expected], surfels, come)
        usual = float(np.median(self._shares)) if self._shares else 1.0
        if self._n < START_SCANS or laid.share < DOUBTFUL * usual:
            guesses = [self._near.register(surfels, expected)]
            if come.is_first:
                guesses += [come.T_world_last @ se3_exp(step) for step in FIRST_STEPS]
            found = self._past.lay(guesses, surfels, come)
            laid = found if found.share >= laid.share else laid
        self._shares.append(laid.share)
        return laid

    @property
    def _period(self) -> float:
        return float(np.median(self._steps)) if self._steps else USUAL_PERIOD

    def _gap(self, scan: Scan) -> float:
        """Return the usual gaps since the last scan, and move the clock on."""
        if self._n == 0:
            self._stamp = scan.stamp or 0.0
            return 0.0
        before = self._stamp
        self._stamp = before + USUAL_PERIOD if scan.stamp is None else scan.stamp
        passed = self._stamp - before
        if passed <= 0.0:  # out of order
            return 1.0
        usual = float(np.median(self._steps)) if self._steps else passed
        self._steps.append(passed)
        return passed / usual if passed > 1.5 * usual else 1.0
