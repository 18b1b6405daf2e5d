"""Online labelling: the same method, scan by scan, with a delay that the caller chooses.

    labeler = automos.Labeler(lag=0.5)
    for scan in robot:
        for done in labeler.push(scan):         # the scans that are half a second old
            publish(done.labels, done.objects)
    publish_all(labeler.finish())

With `lag=0` each scan is labelled from itself and the past. A lag of half a second gives much better labels, and
`math.inf` gives those of `automos.label`. Memory holds a window of some seconds, whatever the length of the recording.
"""

import logging
import math
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.core.arguments import require_kind
from automos.core.array_sequence import as_scan
from automos.core.errors import InputError
from automos.core.made_up_sweep import made_up_sweep
from automos.core.parallel import available_cores, checked_workers, one_ahead
from automos.core.scan import Pose, Scan
from automos.odometry.clock import USUAL_PERIOD
from automos.online.guard import Guard
from automos.online.intake import LONGEST_GAP, Intake, Kind, Taken
from automos.online.labelled_scan import LabelledScan
from automos.online.return_order import ReturnOrder
from automos.online.segmenting import Segmented
from automos.online.stream import Stream, require_online_methods
from automos.online.whole import WholeRecording
from automos.settings import Settings, given_settings

WARM_UP = 14  # made-up scans that are labelled before the first one: with more, a long search would go on beside it
_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class _Arrived:
    """Scan number `index`, its role, and its segments; objects are tracked later."""

    index: int
    scan: Scan
    about: Taken
    segmented: Segmented | None = None


class Labeler:
    """Labels scans as they arrive, each `lag` seconds after it was recorded.

    A scan that was returned is final. A scan that cannot be used (empty, late, or a duplicate) is returned in its
    place like any other, with a warning in the log.

    Parameters
    ----------
    settings : Settings, optional
        Result of `automos.load_settings`. The default preset if not given.
    lag : float, default 0.0
        Seconds by which labels may come later than their scan; `math.inf` returns all of them at `finish`.
    is_compensated : bool, optional
        Whether the sensor's motion during the sweep was already removed. Found out from the scans if not given.
    threads : int, default 0
        Number of threads; 0 uses one per core. The labels do not depend on it.

    Raises
    ------
    InputError
        `lag` or `threads` is out of range, or the settings name a method that needs the whole recording.

    Examples
    --------
    >>> import numpy as np
    >>> import automos
    >>> noise = np.random.default_rng(0)
    >>> room = noise.uniform([-9, -9, -1.5], [9, 9, 2.5], (2000, 3))
    >>> labeler = automos.Labeler(lag=0.2, threads=1)
    >>> for i in range(5):
    ...     for done in labeler.push(room + noise.normal(0.0, 0.01, room.shape), stamp=0.1 * i):
    ...         print(done.index, done.labels.shape)
    0 (2000,)
    1 (2000,)
    2 (2000,)
    >>> [done.index for done in labeler.finish()]
    [3, 4]
    """

    def __init__(
        self,
        settings: Settings | None = None,
        *,
        lag: float = 0.0,
        is_compensated: bool | None = None,
        threads: int = 0,
    ):
        if not (isinstance(lag, int | float | np.integer | np.floating) and lag >= 0.0):
            raise InputError(f"lag must be 0 or more seconds (math.inf for the whole recording), got {lag!r:.80}")
        self.settings = given_settings(settings)
        self.lag = lag
        if math.isfinite(lag):
            require_online_methods(self.settings)
        require_kind(is_compensated, bool | np.bool_ | None, "is_compensated", "True, False or None")
        self._is_compensated = is_compensated
        self._threads = checked_workers(threads, "threads")
        self._pool = ThreadPoolExecutor(self._threads or available_cores())
        self._arrived: deque[_Arrived] = deque()
        self._guard = Guard()
        self._begin()

    def warm_up(self) -> None:
        """Load what labelling needs, or compile it (up to a minute): then the first scan is as fast as others."""
        labeler = Labeler(self.settings, lag=self.lag, threads=self._threads)
        for stamp in USUAL_PERIOD * np.arange(WARM_UP):  # of points in any order, timing takes most to find
            labeler.push(np.random.default_rng(0).permutation(made_up_sweep(stamp)).astype(np.float32), stamp)
        labeler.finish()

    def push(self, scan: Scan | npt.ArrayLike, stamp: float | None = None) -> list[LabelledScan]:
        """Add the next scan; return the scans whose lag has passed, in the order in which they arrived.

        Parameters
        ----------
        scan : Scan or (N, 3) or (N, 4) float array
            Points in metres in the sensor frame; the fourth column is the intensity. They are copied, so the next
            scan may be written into the same array.
        stamp : float, optional
            Seconds. If not given, the scan's own stamp; if it has none, a period after the scan before (0.1 s; see
            `recording.rate`).

        Returns
        -------
        list of LabelledScan
            Often one scan; none while the lag has not passed, several after a gap.

        Raises
        ------
        InputError
            `scan` is not a scan or `stamp` not a number; another thread is pushing; or an earlier call was interrupted.
        """
        with self._guard.alone():
            self._arrive(scan, stamp)
            self._label()
            return self._take()

    def push_each(self, scans: Iterable[Scan | npt.ArrayLike]) -> Iterator[list[LabelledScan]]:
        """Yield what `push` returns for each of `scans`; odometry and segmentation of the next scan run meanwhile.

        On two cores this handles more scans per second than `push`, where each scan waits for the one before. The
        next scan is read from `scans` in a thread. One that was read when the caller stops is returned by a later
        call.

        Parameters
        ----------
        scans : iterable of Scan or (N, 3) or (N, 4) float arrays
            As for `push`.

        Yields
        ------
        list of LabelledScan
            As from `push`.

        Raises
        ------
        InputError
            One of them is not a scan. Errors raised by `scans` itself pass through.
        """
        with self._guard.alone():
            try:
                # A new stream starts at the last pose of the one before, which is known after labelling.
                for _ in one_ahead(self._arrive, scans, lambda arrived: arrived.about.kind is Kind.RESTART):
                    self._label()
                    yield self._take()
            finally:
                while self._arrived and not self._guard.is_broken:
                    self._label()

    def finish(self) -> list[LabelledScan]:
        """End the recording; a new one may begin afterwards.

        Returns
        -------
        list of LabelledScan
            The scans that were not returned yet.
        """
        if self._stream is not None and not self._guard.is_broken:
            self._order.add(self._stream.finish())
        rest = self._order.take()
        self._begin()
        return rest

    def _begin(self) -> None:
        """Forget all scans: the next one is the first."""
        # A recording labelled as a whole may have gaps: `label` compares scans before and after one.
        longest = LONGEST_GAP if math.isfinite(self.lag) else math.inf
        self._intake = Intake(longest, self.settings.recording.rate)
        self._order, self._n = ReturnOrder(), 0
        self._stream: Stream | WholeRecording | None = None
        self._guard.is_broken = False
        self._arrived.clear()

    def _take(self) -> list[LabelledScan]:
        return self._order.take() if math.isfinite(self.lag) else []

    def _arrive(self, one: Scan | npt.ArrayLike, stamp: float | None = None) -> _Arrived:
        """Add a scan; do what does not depend on the labels of earlier ones."""
        scan = as_scan(one, stamp)
        with self._guard.step():
            about = self._intake.take(scan)
            index, self._n = self._n, self._n + 1
            if math.isfinite(self.lag) or scan.stamp is not None:  # without a clock, `label` counts the scans itself
                scan = replace(scan, stamp=about.stamp)
            segmented = self._begin_stream().segment(index, scan) if about.kind is Kind.NEXT else None
            self._arrived.append(_Arrived(index, scan, about, segmented))
            return self._arrived[-1]

    def _label(self) -> None:
        """Label the oldest scan that has arrived."""
        with self._guard.step():
            arrived = self._arrived.popleft()
            index, scan, about, segmented = arrived.index, arrived.scan, arrived.about, arrived.segmented
            if about.warning:
                _log.warning("scan %d: %s", index, about.warning)
            if about.kind is Kind.RESTART:
                self._end_stream()
                segmented = self._begin_stream().segment(index, scan)
            self._order.expect(index, about, len(scan))
            if segmented is not None:
                self._order.add(self._begin_stream().follow(segmented))

    def _begin_stream(self) -> Stream | WholeRecording:
        if self._stream is None:
            self._stream = self._new_stream()
        return self._stream

    def _new_stream(self, T_world_first: Pose | None = None, first_track: int = 0) -> Stream | WholeRecording:
        if math.isinf(self.lag):
            return WholeRecording(self.settings, self._is_compensated, self._threads, T_world_first, first_track)
        sensor = self._is_compensated, self._intake.has_stamps
        return Stream(self.settings, self.lag, self._pool, *sensor, T_world_first, first_track)

    def _end_stream(self) -> None:
        """Label what is waiting, and start a new stream at the last pose."""
        if self._stream is not None:
            self._order.add(self._stream.finish())
            self._stream = self._new_stream(self._stream.T_world_sensor, self._stream.next_track)
