"""A recording as a recorder keeps it: cut, ordered, timed and numbered by a convention, labels with their points.

What a sensor measures is a stream of points. It comes here as sweeps of one turn each; when a point was measured, in
turns since the recording's start, is its sweep's number and the share of the turn that had passed.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol, Self

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import inverse, se3_exp, se3_log
from automos.core.scan import Pose, Scan, Sequence
from automos.simulation.recorders.convention import Convention, Rows, joined, rows_of, with_specks


class Turns(Protocol):
    """Raw sweeps of one turn each, with times (seconds after the turn's start) and beams."""

    name: str

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> Scan: ...

    @property
    def period(self) -> float:
        """Seconds of a turn."""

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        """(len,) seconds of the turns' middles."""

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return the (N,) labels of a turn's points, if known."""

    def poses_at(self, times: npt.NDArray[np.float64]) -> Pose:
        """Return the (len(times), 4, 4) true poses T_world_sensor; ValueError if they are not known."""


@dataclass(frozen=True, eq=False)
class _Kept:
    """Points of a scan as they are kept: the scan, when each was measured (turns), labels."""

    scan: Scan
    when: npt.NDArray[np.float64]
    truth: npt.NDArray[np.uint32] | None

    def rows(self, rows: Rows) -> Self:
        """Return some of the points, in the order of `rows`."""
        truth = None if self.truth is None else self.truth[rows]
        return replace(self, scan=rows_of(self.scan, rows), when=self.when[rows], truth=truth)


class Recorded(Sequence):
    """The sequence `turns` as a recorder of `convention` keeps it; nothing is computed until a scan is asked for."""

    def __init__(self, turns: Turns, convention: Convention, seed: int = 0):
        self.turns, self.convention, self.seed = turns, convention, seed
        self.name = turns.name
        n_cuts = int((len(turns) - convention.first_cut) / convention.turns + 1e-9)
        self._cuts = convention.kept_cuts(n_cuts)
        if len(self._cuts) == 0:
            raise InputError(
                f"a recorder ({convention}) keeps no scan of {len(turns)} turns: give more, or another convention"
            )

    def __len__(self) -> int:
        return len(self._cuts)

    def __getitem__(self, index: int) -> Scan:
        return self._keep(index).scan

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return the (N,) labels of scan `index`, each its point's."""
        return self._keep(index).truth

    def when(self, index: int) -> npt.NDArray[np.float64]:
        """Return (N,) seconds on the recording's clock at which the points of scan `index` were truly measured."""
        return self.clock(self._keep(index).when)

    def clock(self, turns: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return seconds on the recording's clock at `turns` since its start."""
        middles, stamps = np.arange(len(self.turns)) + 0.5, self.turns.stamps
        if len(stamps) < 2:
            return stamps[0] + (np.asarray(turns) - 0.5) * self.turns.period
        turns = np.asarray(turns, np.float64)
        before, after = np.minimum(turns - 0.5, 0.0), np.maximum(turns - middles[-1], 0.0)
        ends = before * (stamps[1] - stamps[0]) + after * (stamps[-1] - stamps[-2])
        return np.interp(turns, middles, stamps) + ends

    @property
    def cuts(self) -> npt.NDArray[np.float64]:
        """(len, 2) turns at which each scan begins and ends."""
        start = self.convention.first_cut + self._cuts * self.convention.turns
        return np.column_stack([start, start + self.convention.turns])

    @property
    def true_stamps(self) -> npt.NDArray[np.float64]:
        """(len,) seconds of the scans' middles, as they are; in order or not."""
        return self.clock(self.cuts.mean(axis=1))

    @property
    def stamps(self) -> npt.NDArray[np.float64] | None:
        """(len,) seconds of the scans' middles; None without a clock, or where scans are out of order."""
        in_order = np.all(np.diff(self.true_stamps) > 0)
        return self.true_stamps if self.convention.stamps and in_order else None

    @property
    def reference_poses(self) -> Pose | None:
        """(len, 4, 4) true T_world_sensor at the time that the points of each scan are given from, or its middle."""
        try:
            poses = self.turns.poses_at(self._reference_times())
        except ValueError:
            return None
        return inverse(poses[0]) @ poses

    def fingerprint(self) -> str:
        """Return a text that changes when the recording does."""
        inner = getattr(self.turns, "fingerprint", lambda: self.name)()
        return f"{super().fingerprint()}:{inner}:{self.convention}:{self.seed}"

    # ------------------------------------------------------------------------------------------------ inner workings
    def _reference_times(self) -> npt.NDArray[np.float64]:
        start, end = self.cuts.T
        at = {"start": start, "end": end}.get(self.convention.reference, 0.5 * (start + end))
        return self.clock(at)

    def _keep(self, index: int) -> _Kept:
        return _keep(self, self._scan_number(index))

    def _measured(self, index: int) -> _Kept:
        """Return all points measured between the cuts of scan `index`, sweep by sweep."""
        start, end = self.cuts[index]
        parts = []
        for sweep in range(int(start), min(int(np.ceil(end - 1e-9)), len(self.turns))):
            scan = self.turns[sweep]
            assert scan.time is not None
            when = sweep + scan.time.astype(np.float64) / self.turns.period
            measured = _Kept(scan, when, self.turns.truth(sweep))
            parts.append(measured.rows(np.flatnonzero((when >= start) & (when < end))))
        truths = [part.truth for part in parts if part.truth is not None]
        truth = np.concatenate(truths) if len(truths) == len(parts) else None
        return _Kept(joined([part.scan for part in parts]), np.concatenate([part.when for part in parts]), truth)

    def _carried(self, index: int, points: npt.NDArray, when: npt.NDArray[np.float64]) -> npt.NDArray:
        """Return the points as seen from where the sensor was at the scan's reference time."""
        firings, at = np.unique(when, return_inverse=True)
        poses = self.turns.poses_at(np.append(self.clock(firings), self._reference_times()[index]))
        T = inverse(poses[-1]) @ poses[:-1]
        if self.convention.reference_speed != 1.0:
            T = se3_exp(self.convention.reference_speed * se3_log(T))
        T = T[at]
        return np.einsum("nij,nj->ni", T[:, :3, :3], points) + T[:, :3, 3]


@lru_cache(maxsize=2)
def _keep(recorded: Recorded, index: int) -> _Kept:
    about = recorded.convention
    chance = [recorded.seed, int(recorded._cuts[index])]  # a scan that is there twice is the same twice
    kept = recorded._measured(index)
    kept = kept.rows(about.kept_rows(kept.scan, kept.when, np.random.default_rng([*chance, 21])))
    scan, truth = kept.scan, kept.truth
    points: npt.NDArray[np.floating] = scan.points
    if about.reference != "raw":
        points = recorded._carried(index, points.astype(np.float64), kept.when)
        points[~scan.is_valid] = scan.points[~scan.is_valid]
    if about.specks:
        points, truth = with_specks(points, truth, about.specks, np.random.default_rng([*chance, 22]))
    if about.rounding:
        points = np.round(points / about.rounding) * about.rounding
    stamps = recorded.stamps
    scan = replace(
        scan,
        points=np.ascontiguousarray(points / about.unit, np.float32),
        time=about.times_in_file(recorded.clock(kept.when)),
        stamp=None if stamps is None else float(stamps[index]),
        name=f"{index:06d}",
    )
    return replace(kept, scan=scan, truth=truth)
