"""What of a scan's points a recorder keeps, and how: functions on arrays."""

from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label
from automos.core.scan import Scan
from automos.simulation.recorders.convention import Convention, Times

Rows = npt.NDArray[np.int64]

PACKETS = 150
"""A turn's."""
FAULTY_SCANS = 0.3
"""Share of scans that lack a sector, where some do."""
SPECK_RANGE = (1.0, 20.0)
"""Metres from the sensor at which specks fly."""
_COLUMNS = ("intensity", "time", "ring", "sensor")


def kept_cuts(n_cuts: int, about: Convention) -> Rows:
    """Return the numbers of the cuts that are kept as scans, in the order in which they are kept."""
    cuts = np.arange(0, n_cuts, about.every)
    if about.leave_out:
        cuts = cuts[(np.arange(len(cuts)) + 1) % about.leave_out != 0]
    if about.double:
        cuts = np.repeat(cuts, np.where((np.arange(len(cuts)) + 1) % about.double == 0, 2, 1))
    if about.renumbered:
        cuts = cuts[sorted(range(len(cuts)), key=str)]
    return cuts


def kept_rows(scan: Scan, when: npt.NDArray[np.float64], about: Convention, rng: np.random.Generator) -> Rows:
    """Return the rows of `scan` that are kept, in the order in which they are; `when` (N,) turns they were measured."""
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


def times_in_file(clock: npt.NDArray[np.float64], times: Times) -> npt.NDArray[np.float32] | None:
    """Return what a reader takes for the (N,) times of points measured at `clock` seconds, from the scan's first on."""
    if times == "none" or len(clock) == 0:
        return None
    seconds = clock - clock.min()
    wrong = {
        "backwards": seconds.max() - seconds,
        "constant": np.zeros_like(seconds),
        "nan": np.full_like(seconds, np.nan),
        "too long": 2.0 * seconds,
    }
    return wrong.get(times, seconds).astype(np.float32)


def with_specks(points, truth, share, rng):  # type: ignore[no-untyped-def]
    """Return points and labels with a share of the points somewhere in the air on their rays, nearer; static."""
    distance = np.linalg.norm(points, axis=1)
    rows = np.flatnonzero((rng.random(len(points)) < share) & (distance > SPECK_RANGE[0]))
    near = rng.uniform(SPECK_RANGE[0], np.minimum(distance[rows], SPECK_RANGE[1]))
    points = points.copy()
    points[rows] *= (near / distance[rows])[:, None].astype(points.dtype)
    if truth is not None:
        truth = truth.copy()
        truth[rows] = Label.STATIC
    return points, truth


def rows_of(scan: Scan, rows: Rows) -> Scan:
    """Return the scan of some points of `scan`, in the order of `rows`."""

    def column(values: npt.NDArray | None) -> npt.NDArray | None:
        return None if values is None else values[rows]

    columns: dict[str, Any] = {name: column(getattr(scan, name)) for name in _COLUMNS}
    return Scan(scan.points[rows], T_scan_sensor=scan.T_scan_sensor, **columns)


def joined(scans: list[Scan]) -> Scan:
    """Return one scan of the points of all, one after the other."""

    def column(name: str) -> npt.NDArray | None:
        parts = [getattr(scan, name) for scan in scans]
        return None if any(part is None for part in parts) else np.concatenate(parts)

    columns: dict[str, Any] = {name: column(name) for name in _COLUMNS}
    return Scan(np.concatenate([s.points for s in scans]), T_scan_sensor=scans[0].T_scan_sensor, **columns)
