"""When each point of a sweep was measured.

Times are fractions of a sweep in [-0.5, 0.5], so no clock is needed.
"""

from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt

from automos.core.scan import Points, Scan
from automos.odometry.drifting_seam import drifting_times, turns_from
from automos.odometry.point_order import NEARLY_ALL, SAME_TIME, PointOrder, turns_since_start

LONGEST_SWEEP = 1e4
"""Seconds; larger values are not times within a sweep: the slowest surveying scanners take minutes."""


@dataclass(frozen=True)
class SweepTiming:
    """How the time of each point within its sweep is known.

    Its source is "file": times in the scans; "order": the advance of the azimuth along the file; "index": the place in
    the file, of a sensor that measures at a steady rate; "azimuth": the azimuth of the point; or "none": the points are
    already compensated, or it is unknown.
    """

    source: Literal["file", "order", "index", "azimuth", "none"] = "none"
    duration: float = 0.0  # "file": seconds from a sweep's first point to its last
    turn: int = 0  # "azimuth", "order": +1 counter-clockwise seen from the sensor's +z, -1 clockwise
    seam_deg: float | None = 0.0  # "azimuth": where a sweep starts and ends, from +x towards +y; None if it drifts
    turns: float = 1.0  # "azimuth": turns per scan if the seam drifts
    share: float = 0.0  # sweep duration over the time between scans; 0 for "none", negative if played backwards
    order: PointOrder | None = None  # "order" only

    @property
    def has_fixed_seam(self) -> bool:
        """Whether the azimuth alone gives the time, of a surfel as of a point."""
        return self.source == "azimuth" and self.seam_deg is not None

    @property
    def has_seam(self) -> bool:
        """Whether the times are known to be those of a rotating sensor."""
        return self.source in ("azimuth", "order")

    @property
    def turns_per_scan(self) -> float:
        """Turns of a rotating sensor from the start of a scan to that of the next, 1 if unknown."""
        return self.turns if self.order is None else self.order.turns_per_scan

    def agrees_with(self, other: Self, scan: Scan) -> bool:
        """Whether two timings agree on the points of a scan."""
        here, there = sweep_times(scan, self), sweep_times(scan, other)
        if here is None or there is None:
            return False
        off = np.abs(self.share * here - other.share * there)[scan.is_valid]
        return len(off) > 0 and bool((off < SAME_TIME).mean() > NEARLY_ALL)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as plain numbers and text, for `from_dict`."""
        return asdict(self)

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> Self:
        """Return the timing from the fields of `to_dict`."""
        order = fields.get("order")
        known = None if order is None else {name: order[name] for name in ("turn", "turns", "turns_per_scan", "start")}
        return cls(**{**fields, "order": None if known is None else PointOrder(**known)})

    def __str__(self) -> str:
        """Return the timing in a few words."""
        turning = {1: "counter-clockwise", -1: "clockwise"}
        if self.source == "none":
            return "none (compensated already, or unknown)"
        if self.source == "file":
            text = f"times in the file ({1e3 * self.duration:.0f} ms a scan)"
        elif self.source == "index":
            text = "order of the points (a steady rate)"
        elif self.order is not None:
            text = f"order of the points ({turning[self.order.turn]}, {self.order.turns:.2f} turns a scan)"
        else:
            is_fixed = self.seam_deg is not None
            seam = f"at {self.seam_deg:.0f} degrees" if is_fixed else f"drifting, {self.turns:.2f} turns a scan"
            text = f"azimuth ({turning[self.turn]}, cut {seam})"
        part = abs(self.share) / max(1.0 if self.order is None else self.order.span / self.order.turns_per_scan, 1e-9)
        if self.source != "file" and part < 0.6:
            text += f", {part:.2g} of the time between scans"
        return f"{text}, backwards" if self.share < 0.0 else text


def recorded_duration(scan: Scan) -> float | None:
    """Return the seconds from a sweep's first point to its last according to the scan's times; None if unknown.

    Ignores NaN and times above `LONGEST_SWEEP`.
    """
    if scan.time is None or not scan.is_valid.any():
        return None
    times = scan.time[np.abs(scan.time) < LONGEST_SWEEP]  # never true of NaN
    return float(times.max(initial=0.0)) or None


def sweep_times(scan: Scan, timing: SweepTiming) -> npt.NDArray[np.float32] | None:
    """Return (N,) float32 times of all points of `scan` in [-0.5, 0.5] of a sweep, or None if unknown.

    NaN for points with two possible times: `compensation.settled_times` chooses one once the motion is known. Where a
    scan names the LiDARs that measured its points, each has a sweep of its own, about its own axis.
    """
    if timing.source == "none":
        return None
    if scan.T_scan_sensor is not None and timing.source != "file":
        if timing.order is not None and scan.n_sensors > 1:  # each begins where it is, not where the others do
            timing = replace(timing, order=replace(timing.order, start=None))
        times = np.zeros(len(scan), np.float32)
        for rows, part in map(scan.of_sensor, range(scan.n_sensors)):
            times[rows] = sweep_times(part, timing)
        return times
    if timing.source == "order" and timing.order is not None:
        fraction = turns_since_start(scan, timing.order) / np.float32(timing.order.span) - np.float32(0.5)
        return np.minimum(fraction, np.float32(0.5))
    if timing.source == "index":
        return (np.arange(len(scan), dtype=np.float32) + np.float32(0.5)) / np.float32(len(scan)) - np.float32(0.5)
    if timing.source == "azimuth":
        if timing.seam_deg is None:
            times, is_twofold = drifting_times(scan.points, timing.turn, timing.turns)
            times[is_twofold] = np.nan
            return times
        return azimuth_times(scan.points, timing.turn, timing.seam_deg)
    if scan.time is None:
        return np.zeros(len(scan), np.float32)
    fraction = np.nan_to_num(scan.time / np.float32(timing.duration) - np.float32(0.5))
    return np.clip(fraction, -0.5, 0.5).astype(np.float32)


def azimuth_times(points: Points, turn: int, seam_deg: float) -> npt.NDArray[np.float32]:
    """Return (N,) float32 times in [-0.5, 0.5] of `points` (N, 3) from a sensor that rotates about its z axis.

    `turn` is +1 for counter-clockwise, -1 for clockwise; sweeps start and end at azimuth `seam_deg`.
    """
    return turns_from(np.ascontiguousarray(points), turn, seam_deg / 360.0, 0.5)
