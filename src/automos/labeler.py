"""The same method at the pace of the sensor: scans in, labels out some time later, or at once.

    labeler = automos.Labeler(lag=0.5)
    for scan in robot:
        for done in labeler.push(scan):         # the scans whose half second is over
            publish(done.labels, done.objects)
    publish_all(labeler.finish())

With `lag=0` every scan is labelled from itself and the past; half a second later much more is known; with `math.inf`
the labels are those of `automos.label`. Memory holds some seconds, whatever the recording's length.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.arguments import require_kind
from automos.array_sequence import ArraySequence
from automos.errors import InputError
from automos.online.intake import Intake, Kind, Taken
from automos.online.labelled_scan import LabelledScan, labelled_scans
from automos.online.segmenting import Segmented
from automos.online.stream import Stream
from automos.parallel import available_cores, checked_workers, one_ahead
from automos.scan import Scan
from automos.settings import Settings, given_settings

__all__ = ["Labeler", "LabelledScan", "as_scan"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class _Arrived:
    """Scan number `index`, with its stamp, what it is to the stream, and what it tells before others are followed."""

    index: int
    scan: Scan
    about: Taken
    segmented: Segmented | None = None


class Labeler:
    """Labels scans as they come, each `lag` seconds after it was taken.

    What was given back does not change. A scan that cannot be used (empty, late, come twice) is given back like any
    other, in its place, with a warning in the log.
    """

    def __init__(
        self,
        settings: Settings | None = None,
        *,
        lag: float = 0.0,
        is_compensated: bool | None = None,
        threads: int = 0,
    ):
        """Take what shapes the labels and how long they may wait.

        Parameters
        ----------
        settings : as `automos.label` takes them; the default preset where not given.
        lag : seconds by which labels may come later than their scan; `math.inf`: all at `finish`.
        is_compensated : whether the sensor's motion during the sweep was taken out; None where that is not known.
        threads : to work with; 0 takes one per core. The labels do not depend on it.

        Raises
        ------
        InputError : the lag is no time, `threads` is no number of them, or the settings name a method that needs the
            whole recording.
        """
        if not (isinstance(lag, int | float | np.integer | np.floating) and lag >= 0.0):
            raise InputError(f"lag must be 0 or more seconds (math.inf for the whole recording), got {lag!r:.80}")
        self.settings = given_settings(settings)
        self.lag = lag
        if math.isfinite(lag):
            _check_methods(self.settings)
        require_kind(is_compensated, bool | np.bool_ | None, "is_compensated", "True, False or None")
        self._is_compensated = is_compensated
        self._threads = checked_workers(threads, "threads")
        self._pool = ThreadPoolExecutor(self._threads or available_cores())
        self._intake = Intake()
        self._n = 0
        self._scans: list[Scan] = []
        self._arrived: deque[_Arrived] = deque()
        self._ready: dict[int, LabelledScan] = {}
        self._pending: deque[tuple[int, Kind, float, int]] = deque()  # index, what it is, stamp, points
        self._stream: Stream | None = None
        self._last_given: LabelledScan | None = None

    def push(self, scan: Scan | npt.ArrayLike, stamp: float | None = None) -> list[LabelledScan]:
        """Take the next scan; return those whose lag is over, in the order in which they came.

        Parameters
        ----------
        scan : a `Scan`, or an (N, 3) or (N, 4: x, y, z, intensity) array, metres, sensor frame.
        stamp : seconds; the scan's own where not given, and a tenth of a second after the last where it has none.

        Raises
        ------
        InputError : this is no scan.
        """
        scan = as_scan(scan, stamp)
        if math.isinf(self.lag):
            self._scans.append(scan)
            return []
        self._arrive(scan)
        self._label()
        return self._in_order()

    def push_each(self, scans: Iterable[Scan | npt.ArrayLike]) -> Iterator[list[LabelledScan]]:
        """Yield what `push` returns of each of `scans`; where the next one is and what it sees is found out meanwhile.

        On two cores that is more scans a second than by `push`, of which each waits for the one before. The next scan
        is taken from `scans` in a thread; one that was taken when the caller stops is given back later, as by `push`.

        Raises
        ------
        InputError : one of them is no scan; and what `scans` raises.
        """
        if math.isinf(self.lag):
            yield from map(self.push, scans)
            return
        try:
            # A stream that begins anew does so where the one before has ended, which labelling tells.
            for _ in one_ahead(self._arrive, scans, lambda arrived: arrived.about.kind is Kind.RESTART):
                self._label()
                yield self._in_order()
        finally:
            while self._arrived:
                self._label()

    def finish(self) -> list[LabelledScan]:
        """Return the scans that were not given back yet; afterwards a new recording may begin."""
        if math.isinf(self.lag):
            return self._label_all()
        if self._stream is not None:
            self._keep(self._stream.finish())
        rest = self._in_order()
        self._stream, self._intake, self._n, self._last_given = None, Intake(), 0, None
        return rest

    def _arrive(self, one: Scan | npt.ArrayLike) -> _Arrived:
        """Take a scan in, with what can be found out before earlier ones are labelled."""
        scan = as_scan(one)
        about = self._intake.take(scan)
        index, self._n = self._n, self._n + 1
        scan = replace(scan, stamp=about.stamp)
        segmented = self._begin_stream().segment(index, scan) if about.kind is Kind.NEXT else None
        self._arrived.append(_Arrived(index, scan, about, segmented))
        return self._arrived[-1]

    def _label(self) -> None:
        """Label the scan that has arrived first."""
        arrived = self._arrived.popleft()
        index, scan, about, segmented = arrived.index, arrived.scan, arrived.about, arrived.segmented
        if about.warning:
            _log.warning("scan %d: %s", index, about.warning)
        if about.kind is Kind.RESTART:
            self._end_stream()
            segmented = self._begin_stream().segment(index, scan)
        self._pending.append((index, about.kind, about.stamp, len(scan)))
        if segmented is not None:
            self._keep(self._begin_stream().follow(segmented))

    def _begin_stream(self) -> Stream:
        if self._stream is None:
            self._stream = Stream(self.settings, self.lag, self._pool, self._is_compensated)
        return self._stream

    def _end_stream(self) -> None:
        """Give back what waits, and begin anew where the sensor was last."""
        if self._stream is None:
            return
        self._keep(self._stream.finish())
        before = self._stream
        self._stream = Stream(
            self.settings, self.lag, self._pool, self._is_compensated, before.T_world_sensor, before.next_track
        )

    def _keep(self, given: Iterable[LabelledScan]) -> None:
        self._ready.update((scan.index, scan) for scan in given)

    def _in_order(self) -> list[LabelledScan]:
        """Return what is ready, up to the first scan that is not."""
        done = []
        while self._pending:
            index, kind, stamp, n = self._pending[0]
            if kind in (Kind.NEXT, Kind.RESTART):
                if index not in self._ready:
                    break
                given = self._ready.pop(index)
            else:
                given = _without_evidence(index, kind, stamp, n, self._last_given)
            if kind is not Kind.LATE:
                self._last_given = given
            self._pending.popleft()
            done.append(given)
        return done

    def _label_all(self) -> list[LabelledScan]:
        """Return all scans, labelled as `automos.label` does."""
        from automos.pipeline import label

        scans, self._scans = self._scans, []
        if not scans:
            return []
        recording = ArraySequence(scans, is_compensated=self._is_compensated)
        return labelled_scans(label(recording, self.settings, workers=self._threads))


def as_scan(scan: Scan | npt.ArrayLike, stamp: float | None = None) -> Scan:
    """Return a scan, an array made one, with `stamp` seconds if given.

    Raises
    ------
    InputError : an array that holds no points.
    """
    if not isinstance(scan, Scan):
        try:
            scan = ArraySequence([scan])[0]
        except (TypeError, ValueError) as error:
            raise InputError(f"a scan is a Scan or an (N, 3) array, metres: {error}") from None
    try:
        return scan if stamp is None else replace(scan, stamp=float(stamp))
    except (TypeError, ValueError):
        raise InputError(f"a scan's stamp is seconds, not {stamp!r}") from None


def _without_evidence(index: int, kind: Kind, stamp: float, n: int, before: LabelledScan | None) -> LabelledScan:
    """Return a scan that could not be used; one that came twice has the labels of the first."""
    if kind is Kind.REPEAT and before is not None and len(before.labels) == n:
        return replace(before, index=index, stamp=stamp)
    return LabelledScan.of_nothing(index, stamp, np.eye(4) if before is None else before.pose, n)


def _check_methods(settings: Settings) -> None:
    chosen = {"candidates": settings.candidates.method, "tracking": settings.tracking.method}
    able = {"candidates": "free_space", "tracking": "evidence"}
    for stage, method in chosen.items():
        if method != able[stage]:
            raise InputError(
                f"{stage}.method {method} needs the whole recording: set it to {able[stage]}, or lag to math.inf"
            )
