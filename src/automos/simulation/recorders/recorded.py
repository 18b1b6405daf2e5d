"""A recording as a recorder keeps it: cut, ordered, timed and numbered by a convention, labels with their points.

What a sensor measures is a stream of points. It comes here as sweeps of one turn each; when a point was measured, in
turns since the recording's start, is its sweep's number and the share of the turn that had passed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, se3_exp, se3_log
from automos.labels import Label
from automos.scan import Pose, Scan, Sequence
from automos.simulation.recorders.convention import Convention

Rows = npt.NDArray[np.int64]

PACKETS = 150
"""A turn's."""
FAULTY_SCANS = 0.3
"""Share of scans that lack a sector, where some do."""
SPECK_RANGE = (1.0, 20.0)
"""Metres from the sensor at which specks fly."""


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
        """Return the (len(times), 4, 4) true poses T_world_sensor; ValueError where they are not known."""


@dataclass(frozen=True, eq=False)
class _Kept:
    """Points of a scan as they are kept: the scan, when each was measured (turns), labels."""

    scan: Scan
    when: npt.NDArray[np.float64]
    truth: npt.NDArray[np.uint32] | None


class Recorded(Sequence):
    """The sequence `turns` as a recorder of `convention` keeps it; nothing is computed until a scan is asked for."""

    def __init__(self, turns: Turns, convention: Convention, seed: int = 0):
        self.turns, self.convention, self.seed = turns, convention, seed
        self.name = turns.name
        n_cuts = int((len(turns) - convention.first_cut) / convention.turns + 1e-9)
        self._cuts = _kept_cuts(n_cuts, convention)

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
        return _keep(self, range(len(self))[index])

    def _measured(self, index: int) -> tuple[Scan, npt.NDArray[np.float64], npt.NDArray[np.uint32] | None]:
        """Return all points measured between the cuts of scan `index`, sweep by sweep, when, and their labels."""
        start, end = self.cuts[index]
        scans, times, truths = [], [], []
        for sweep in range(int(start), min(int(np.ceil(end - 1e-9)), len(self.turns))):
            scan = self.turns[sweep]
            assert scan.time is not None
            when = sweep + scan.time.astype(np.float64) / self.turns.period
            rows = np.flatnonzero((when >= start) & (when < end))
            scans.append(_rows_of(scan, rows))
            times.append(when[rows])
            truth = self.turns.truth(sweep)
            truths.append(None if truth is None else truth[rows])
        truth = None if any(t is None for t in truths) else np.concatenate([t for t in truths if t is not None])
        return _joined(scans), np.concatenate(times), truth

    def _rows(self, index: int, scan: Scan, when: npt.NDArray[np.float64]) -> Rows:
        """Return the rows that are kept, in the order in which they are kept."""
        about, rng = self.convention, np.random.default_rng([self.seed, int(self._cuts[index]), 21])
        keep = np.ones(len(scan), bool)
        if about.lost_packets:
            packet = ((when - when.min(initial=0.0)) * PACKETS).astype(np.int64)
            keep &= rng.random(packet.max(initial=0) + 1)[packet] >= about.lost_packets
        if about.beams > 1 and scan.ring is not None:
            keep &= scan.ring % about.beams == 0
        azimuth = np.degrees(np.arctan2(scan.points[:, 1], scan.points[:, 0]))
        keep &= np.abs(azimuth) <= 0.5 * about.field_of_view
        if about.lost_sector and rng.random() < FAULTY_SCANS:
            keep &= (azimuth - rng.uniform(0.0, 360.0)) % 360.0 >= about.lost_sector
        rows = np.flatnonzero(keep)
        if about.order == "random":
            return rng.permutation(rows)
        if about.order == "time":
            return rows[np.argsort(when[rows], kind="stable")]
        if about.order == "ring" and scan.ring is not None:
            return rows[np.lexsort((when[rows], scan.ring[rows]))]
        return rows

    def _carried(self, index: int, points: npt.NDArray, when: npt.NDArray[np.float64]) -> npt.NDArray:
        """Return the points as seen from where the sensor was at the scan's reference time."""
        firings, at = np.unique(when, return_inverse=True)
        poses = self.turns.poses_at(np.append(self.clock(firings), self._reference_times()[index]))
        T = inverse(poses[-1]) @ poses[:-1]
        if self.convention.reference_speed != 1.0:
            T = se3_exp(self.convention.reference_speed * se3_log(T))
        T = T[at]
        return np.einsum("nij,nj->ni", T[:, :3, :3], points) + T[:, :3, 3]

    def _times(self, index: int, when: npt.NDArray[np.float64]) -> npt.NDArray[np.float32] | None:
        """Return the times a reader finds in the scan's file; `absolute` ones start at its first point like others."""
        if self.convention.times == "none" or len(when) == 0:
            return None
        seconds = self.clock(when)
        seconds = seconds - seconds.min()
        wrong = {
            "backwards": seconds.max() - seconds,
            "constant": np.zeros_like(seconds),
            "nan": np.full_like(seconds, np.nan),
            "too long": 2.0 * seconds,
        }
        return wrong.get(self.convention.times, seconds).astype(np.float32)


@lru_cache(maxsize=2)
def _keep(recorded: Recorded, index: int) -> _Kept:
    about = recorded.convention
    scan, when, truth = recorded._measured(index)
    rows = recorded._rows(index, scan, when)
    scan, when, truth = _rows_of(scan, rows), when[rows], None if truth is None else truth[rows]
    points: npt.NDArray[np.floating] = scan.points
    if about.reference != "raw":
        points = recorded._carried(index, points.astype(np.float64), when)
        points[~scan.is_valid] = scan.points[~scan.is_valid]
    if about.specks:
        points, truth = _with_specks(points, truth, about.specks, [recorded.seed, index, 22])
    if about.rounding:
        points = np.round(points / about.rounding) * about.rounding
    stamps = recorded.stamps
    kept = Scan(
        np.ascontiguousarray(points / about.unit, np.float32),
        intensity=scan.intensity,
        time=recorded._times(index, when),
        ring=scan.ring,
        stamp=None if stamps is None else float(stamps[index]),
        name=f"{index:06d}",
        sensor=scan.sensor,
        T_scan_sensor=scan.T_scan_sensor,
    )
    return _Kept(kept, when, truth)


def _kept_cuts(n_cuts: int, about: Convention) -> Rows:
    """Return the numbers of the cuts that are kept as scans, in the order in which they are kept."""
    cuts = np.arange(0, n_cuts, about.every)
    if about.leave_out:
        cuts = cuts[(np.arange(len(cuts)) + 1) % about.leave_out != 0]
    if about.double:
        cuts = np.repeat(cuts, np.where((np.arange(len(cuts)) + 1) % about.double == 0, 2, 1))
    if about.renumbered:
        cuts = cuts[sorted(range(len(cuts)), key=str)]
    return cuts


def _with_specks(points, truth, share, seed):  # type: ignore[no-untyped-def]
    """Return points and labels with a share of the points somewhere in the air on their rays, nearer; static."""
    rng = np.random.default_rng(seed)
    distance = np.linalg.norm(points, axis=1)
    rows = np.flatnonzero((rng.random(len(points)) < share) & (distance > SPECK_RANGE[0]))
    near = rng.uniform(SPECK_RANGE[0], np.minimum(distance[rows], SPECK_RANGE[1]))
    points = points.copy()
    points[rows] *= (near / distance[rows])[:, None].astype(points.dtype)
    if truth is not None:
        truth = truth.copy()
        truth[rows] = Label.STATIC
    return points, truth


def _rows_of(scan: Scan, rows: Rows) -> Scan:
    def column(values: npt.NDArray | None) -> npt.NDArray | None:
        return None if values is None else values[rows]

    columns: dict[str, Any] = {name: column(getattr(scan, name)) for name in _COLUMNS}
    return Scan(scan.points[rows], T_scan_sensor=scan.T_scan_sensor, **columns)


def _joined(scans: list[Scan]) -> Scan:
    def column(name: str) -> npt.NDArray | None:
        parts = [getattr(scan, name) for scan in scans]
        return None if any(part is None for part in parts) else np.concatenate(parts)

    columns: dict[str, Any] = {name: column(name) for name in _COLUMNS}
    return Scan(np.concatenate([s.points for s in scans]), T_scan_sensor=scans[0].T_scan_sensor, **columns)


_COLUMNS = ("intensity", "time", "ring", "sensor")
