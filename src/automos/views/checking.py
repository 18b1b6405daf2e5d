"""What a recording is, what will be assumed of it, and whether it can be labelled: from headers and a few scans."""

from collections.abc import Sequence as Several
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.arrays import evenly_spread
from automos.core.errors import AutomosError
from automos.core.scan import Scan, Sequence
from automos.odometry.clock import GAP
from automos.readers import find_recordings, kind_of, open_sequence
from automos.results.recording_warnings import USUAL_RATE, recording_warnings

LOOKS = 20
"""Scans that are read, at most: all of so few, else half, as the others are read to open a recording."""

_FIELDS = ("intensity", "time", "ring", "sensor")
"""What points may have beside coordinates; a column of one value everywhere is none."""
_SECTORS, _FEWEST = 36, 200
"""Directions in each of which beams are counted, where it has enough points."""
_FINE, _STEEPEST, _WIDTH = 0.05, 60.0, 5
"""Degrees: bins of elevation in which beams are told apart, how far up and down, and bins of azimuth."""
_LIKE = 0.1
"""Share of the beams, or of the field of view, by which a sensor may differ from the one it is like."""


@dataclass
class Check:
    """What was found of one recording.

    Attributes
    ----------
    place, name, what : where it is, what its results will be called, and what kind it is.
    scans, points, fields : how many it has, and a usual scan has; what these have beside coordinates.
    beams, elevations, azimuths : how many beams the LiDAR has (None: no fixed ones), from and to which degrees they
        look, and how many degrees around.
    sensor : a LiDAR that has such beams; empty where none is known.
    frame : of the coordinates in the files.
    gaps, copies : places where scans are missing, and scans that are the one before them once more.
    period, clock : seconds between scans, and what says so; None and empty without.
    sweep : seconds that the points' own times span; None where they have none.
    share_not_finite, share_without_return, ranges : of the points; metres within which 5, 50 and 95 % of them are.
    brings : what comes with it and is not used to label: labels, poses.
    assumed, doubts : what will be taken for granted, and what is odd and how it was handled, in sentences.
    error : why it cannot be labelled; empty where it can.
    """

    place: str
    name: str
    what: str = ""
    scans: int = 0
    points: int = 0
    fields: list[str] = field(default_factory=list)
    beams: int | None = None
    elevations: tuple[float, float] | None = None
    azimuths: int = 0
    sensor: str = ""
    frame: str = ""
    gaps: int = 0
    copies: int = 0
    period: float | None = None
    clock: str = ""
    sweep: float | None = None
    share_not_finite: float = 0.0
    share_without_return: float = 0.0
    ranges: tuple[float, float, float] | None = None
    brings: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    error: str = ""

    @property
    def exit_code(self) -> int:
        """0, 1 where there are doubts, 2 where it cannot be labelled."""
        return 2 if self.error else 1 if self.doubts else 0

    @property
    def first_line(self) -> str:
        """The recording in one line."""
        if self.error:
            return f"{self.name} cannot be labelled: {self.error}"
        rate = "no times" if self.period is None else f"{1.0 / self.period:.1f} scans a second"
        doubts = f", with {len(self.doubts)} doubt{'s' * (len(self.doubts) > 1)}" if self.doubts else ""
        found = [f"{self.scans} scan{'s' * (self.scans != 1)}", self.what, self._seen(), rate]
        return f"{self.name} can be labelled{doubts}: {', '.join(part for part in found if part)}"

    def to_dict(self) -> dict[str, Any]:
        """Return all that was found, for JSON."""
        return asdict(self) | {"can_be_labelled": not self.error, "exit_code": self.exit_code}

    def lines(self) -> list[str]:
        """Return what was found as lines for people."""
        if not self.scans:
            return [self.first_line]
        like = f", like those of the {self.sensor}" if self.sensor else ""
        up = "" if self.elevations is None else f", {self.elevations[0]:.0f} to {self.elevations[1]:.0f} degrees"
        ranges = "" if self.ranges is None else "; 5, 50, 95 % within {:.1f}, {:.1f}, {:.1f} m".format(*self.ranges)
        sweep = "none in the files" if self.sweep is None else f"in the files, spanning {self.sweep:.3f} s a scan"
        rows = {
            "points": f"{self.points:,} a scan, {100 * self.share_not_finite:.1f} % of them not finite, "
            f"{100 * self.share_without_return:.1f} % without a return{ranges}",
            "fields": " ".join(["x y z", *self.fields]),
            "sensor": f"{self._seen()}{up}{like}",
            "rate": f"{1.0 / self.period:.2f} scans a second, by {self.clock}" if self.period else "no times of scans",
            "gaps, copies": f"{self.gaps} gaps, {self.copies} scans twice",
            "times of points": sweep,
            **({"frame": self.frame} if self.frame else {}),
            "brings": ", ".join(self.brings) or "scans alone",
        }
        said = [*rows.items(), *(("assumed", one) for one in self.assumed), *(("doubt", one) for one in self.doubts)]
        return [self.first_line, *(f"  {key:16s} {value}" for key, value in said)]

    def _seen(self) -> str:
        around = "all round" if self.azimuths >= 360 - _WIDTH else f"{self.azimuths} degrees wide"
        beams = "no fixed beams, " if self.beams is None else f"{'' if self.sensor else 'about '}{self.beams} beams "
        return beams + around if self.azimuths else ""


def check(path: str | Path, format: str | None = None) -> list[Check]:
    """Return what the recordings at `path` are, one or more.

    Parameters are those of `automos.open_sequence`. What cannot be labelled is a `Check` with an error, too.
    """
    try:
        places = find_recordings(path, format)
    except AutomosError as error:
        return [Check(str(path), Path(path).name, error=str(error))]
    return [_check_one(place, format) for place in places]


def _check_one(place: Path, format: str | None) -> Check:
    found = Check(str(place), place.resolve().name)
    try:
        sequence = open_sequence(place, format)
        found.name, found.scans = sequence.name, len(sequence)
        found.what = ", ".join(part for part in (kind_of(place, format), sequence.about.get("files")) if part)
        n = len(sequence)
        scans = [sequence[i] for i in evenly_spread(range(n), n if n <= LOOKS else LOOKS // 2 - 1)]
        _look_at(scans, found)
        found.doubts = recording_warnings(sequence, USUAL_RATE)
        if empty := [scan.name for scan in scans if not scan.is_valid.any()]:
            found.doubts.append(f"{len(empty)} of {len(scans)} scans looked at have no points of use, as {empty[0]}.")
        _look_beside(sequence, found)
    except AutomosError as error:
        found.error = str(error)
    return found


def _look_at(scans: Several[Scan], found: Check) -> None:
    """Note what the points of some scans are."""
    found.points = int(np.median([len(scan) for scan in scans]))
    columns = {name: [getattr(scan, name) for scan in scans if len(scan)] for name in _FIELDS}
    found.fields = [
        name for name, given in columns.items() if any(one is not None and len(np.unique(one)) > 1 for one in given)
    ]
    points = np.concatenate([scan.rays for scan in scans])
    is_finite = np.isfinite(points).all(axis=1)
    is_valid = np.concatenate([scan.is_valid for scan in scans])
    if len(points):
        found.share_not_finite = float(1.0 - is_finite.mean())
        found.share_without_return = float((is_finite & ~is_valid).mean())
    if not is_valid.any():
        found.error = f"{found.place} has no point that is one in the {len(scans)} scans that were looked at"
        return
    near, middle, far = np.percentile(np.linalg.norm(points[is_valid].astype(np.float64), axis=1), [5, 50, 95])
    found.ranges = float(near), float(middle), float(far)
    times = [float(np.ptp(scan.time)) for scan in scans if scan.time is not None and len(scan)]
    found.sweep = float(np.median(times)) if times else None
    x, y, _ = points[is_valid].T
    found.azimuths = _WIDTH * len(np.unique(np.floor(np.degrees(np.arctan2(y, x)) / _WIDTH)))
    fullest = max(scans, key=lambda scan: int(scan.is_valid.sum()))
    _count_beams(fullest, found)


def _count_beams(scan: Scan, found: Check) -> None:
    """Note how many beams measured `scan`, and how far up and down they look."""
    x, y, z = scan.rays[scan.is_valid].astype(np.float64).T
    elevation = np.degrees(np.arctan2(z, np.hypot(x, y)))
    azimuth = np.degrees(np.arctan2(y, x))
    sector = np.floor(azimuth * (_SECTORS / 360.0))
    low, high = np.percentile(elevation, [0.5, 99.5])
    found.elevations = float(low), float(high)
    if scan.ring is not None:
        found.beams = len(np.unique(scan.ring[scan.is_valid]))
    else:
        counts = [_peaks(elevation[sector == k]) for k in np.unique(sector) if (sector == k).sum() >= _FEWEST]
        middle, upper = np.percentile(counts, [50, 75]) if counts else (0, 0)
        found.beams = round(upper) if 0 < upper < (1.0 + 2.0 * _LIKE) * middle else None
    _name_sensor(found)


def _peaks(elevation: npt.NDArray[np.float64]) -> int:
    """Return at how many of (N,) elevations in degrees, of one direction, points lie together."""
    from scipy.signal import find_peaks

    smooth = np.convolve(np.histogram(elevation, np.arange(-_STEEPEST, _STEEPEST, _FINE))[0], [0.25, 0.5, 0.25], "same")
    usual = np.median(smooth[smooth > 0]) if smooth.any() else 0.0
    return len(find_peaks(smooth, prominence=max(0.25 * usual, 3.0))[0])


def _name_sensor(found: Check) -> None:
    """Note the known sensor that has the beams that were found, if there is one, and how many it has."""
    from automos.simulation.sensing.sensors import SENSORS

    low, high = found.elevations or (0.0, 0.0)
    for sensor in SENSORS.values():
        if sensor.rosette is not None:
            sides = np.array([found.azimuths, high - low]) / sensor.rosette
            is_like = found.azimuths < 180 and bool((np.abs(sides - 1.0) < 2.0 * _LIKE).all())
        else:
            ends = np.array([low - sensor.elevations.min(), high - sensor.elevations.max()])
            is_like = bool((np.abs(ends) < _LIKE * np.ptp(sensor.elevations)).all())
            is_like &= abs((found.beams or 0) - sensor.beams) <= _LIKE * sensor.beams
        if is_like:
            found.sensor, found.beams = sensor.name, None if sensor.rosette else sensor.beams
            return


def _look_beside(sequence: Sequence, found: Check) -> None:
    """Note the clock, what comes with the recording, and what will be assumed."""
    stamps, repeats, about = sequence.stamps, sequence.repeats, sequence.about
    found.frame = about.get("frame", "")
    found.clock = "" if stamps is None else about.get("times", "the recording itself")
    found.copies = 0 if repeats is None else int(repeats.sum())
    if stamps is not None and len(stamps) > 1:
        steps = np.diff(stamps)
        found.period = float(np.median(steps))
        found.gaps = int((steps > GAP * found.period).sum())
    else:
        found.assumed.append(f"{USUAL_RATE:.0f} scans a second, as no file says when: times.txt would, or label --rate")
    if found.sweep is None and sequence.is_compensated is None:
        found.assumed.append("when in its sweep a point was measured is found from directions and from how scans fit")
    if "intensity" not in found.fields:
        found.assumed.append("no intensity; it is not needed")
    with suppress(AutomosError):  # which is among the doubts
        found.brings += ["poses (used only with --poses)"] if sequence.reference_poses is not None else []
    found.brings += ["labels to compare with"] if sequence.truth(0) is not None else []
