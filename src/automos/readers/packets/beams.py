"""Where the beams of a sensor point: what its own calibration says, or else what its manual says of all of its kind."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from automos.core.arrays import Array
from automos.core.errors import InputError
from automos.core.reading import damage_reported, is_there, read_bytes, read_json, read_text
from automos.readers.packets.layouts import Layout

TOLD = bytes.fromhex("A5FF005A11115555")
"""What packets with a RoboSense's calibration (DIFOP) begin with."""
_SIGNED = np.dtype([("is_below", "u1"), ("angle", ">u2")])
_CORRECTED = bytes.fromhex("EEFF0105800303")
"""What an AT128's angle correction file begins with: its version, and how many beams, mirrors and frames it has."""
_CORRECTION = np.dtype([
    ("head", "V15"), ("unit", "u1"), ("starts", "<u4", 3), ("ends", "<u4", 3), ("azimuth", "<i4", 128),
    ("elevation", "<i4", 128), ("bent", "i1", (2, 128, 180)), ("hash", "V32"),
])  # fmt: skip
_PITCHES, _ANGLES = slice(1165, 1165 + 48), slice(468, 468 + 192)
"""Where an RS-LiDAR-16 tells the elevations of its beams, and an RS-LiDAR-32 these and their azimuths."""


@dataclass(frozen=True, eq=False)
class Beams:
    """The (C,) elevations and azimuths of a sensor's beams, degrees, and what to say of them."""

    elevation: Array
    azimuth: Array
    warnings: tuple[str, ...] = ()

    def towards(self, turned: Array) -> tuple[Array, Array]:
        """Return azimuths and elevations of rays (..., n) in degrees, sent where a sensor has `turned` (..., n) so far.

        Its n points of a block are of its beams, in turn.
        """
        n = turned.shape[-1]
        return turned + np.resize(self.azimuth, n), np.resize(self.elevation, n)


@dataclass(frozen=True, eq=False, kw_only=True)
class MirrorBeams(Beams):
    """Beams that mirrors turn by twice their own turn, and bend by some tenths of a degree as they go.

    `starts` (M,) is where each mirror's part of the turn begins, `bent` (2, C, 180) how far azimuth and elevation are
    off, every two degrees of the turn; all in degrees.
    """

    starts: Array
    bent: Array

    def towards(self, turned: Array) -> tuple[Array, Array]:
        """Return what `Beams.towards` does."""
        since = np.minimum.reduce([(turned - start) % 360.0 for start in self.starts])
        share, before = np.modf(turned / 2.0 % 180.0)
        step, beam = before.astype(np.int64), np.arange(len(self.azimuth))
        bent = (1.0 - share) * self.bent[:, beam, step] + share * self.bent[:, beam, (step + 1) % 180]
        return 2.0 * since - self.azimuth + bent[0], self.elevation + bent[1]


def beams_of(layout: Layout, packets: Iterable[bytes], source: Path) -> Beams:
    """Return the beams of a sensor, told by a file beside the recording `source`, by some of its packets, or known.

    Raises
    ------
    InputError
        Nothing tells them; or the file is of another sensor, or no table of angles.
    """
    nominal = read_json(Path(__file__).with_name("beams.json")).get(layout.sensor)
    beside = table_beside(source, layout)
    if layout.mirrors > 1 and is_there(beside):
        return _from_correction(beside)
    if layout.mirrors == 1 and is_there(beside) and "elevation" in read_text(beside)[:200].lower():
        return _from_table(beside, len(nominal["elevation"]) if nominal else 32)
    told = next((packet for packet in packets if packet.startswith(TOLD) and len(packet) == layout.size), None)
    if told is not None and layout.sensor == "RS-LiDAR-16":
        pitch = np.frombuffer(told[_PITCHES], np.uint8).reshape(16, 3) @ np.array([65536, 256, 1])
        return Beams(1e-4 * np.where(np.arange(16) < 8, -pitch, pitch), np.zeros(16))
    if told is not None:
        angles = np.frombuffer(told[_ANGLES], _SIGNED)
        return Beams(*(1e-3 * np.where(angles["is_below"], -1.0, 1.0) * angles["angle"]).reshape(2, 32))
    if nominal is None:
        remedy = (
            f"save the sensor's angle correction file, which PandarView exports, as {beside.name} beside it"
            if layout.mirrors > 1
            else "record the sensor's DIFOP packets (port 7788), too, or save a table of Channel,Elevation,Azimuth as "
            f"{beside.name}"
        )
        raise InputError(f"{source} does not say where the beams of its {layout.sensor} point; {remedy}")
    said = (
        f"{source}: the beams are taken to point where those of any {layout.sensor} do, which is right to some tenths "
        f"of a degree; save this one's calibration (Channel,Elevation,Azimuth) as {beside.name}."
    )
    return Beams(np.array(nominal["elevation"], float), np.array(nominal["azimuth"], float), (said,))


def table_beside(source: Path, layout: Layout) -> Path:
    """Return where the table of angles of the sensor that recorded `source` may be: NAME.csv, of mirrors NAME.dat."""
    suffix = ".dat" if layout.mirrors > 1 else ".csv"
    return source.with_name(f"{source.name}{suffix}") if source.is_dir() else source.with_suffix(suffix)


def _from_table(path: Path, n_beams: int) -> Beams:
    """Return what a table of its maker says, a row for each beam: its number, elevation and azimuth."""
    with damage_reported(path, "is no table of Channel,Elevation,Azimuth", "save it again"):
        rows = [line.split(",")[:3] for line in read_text(path).splitlines() if line[:1].isdigit()]
        table = np.array(rows, np.float64)
    if table.shape != (n_beams, 3) or not (np.abs(table[:, 1:]) <= 90.0).all():
        raise InputError(
            f"{path} has {len(table)} rows of angles, and the sensor {n_beams} beams; give the sensor's own table"
        )
    return Beams(table[:, 1], table[:, 2])


def _from_correction(path: Path) -> MirrorBeams:
    """Return what an AT128's angle correction file of version 1.5 says; its angles count 1/25600 degrees."""
    raw = read_bytes(path, _CORRECTION.itemsize)
    if len(raw) != _CORRECTION.itemsize or not raw.startswith(_CORRECTED):
        raise InputError(
            f"{path} is no angle correction file of version 1.5 of an AT128 ({_CORRECTION.itemsize} bytes); export the "
            "sensor's own from PandarView"
        )
    file = np.frombuffer(raw, _CORRECTION)[0]
    degrees = float(file["unit"]) / 25600
    azimuth, elevation = degrees * file["azimuth"], degrees * file["elevation"]
    return MirrorBeams(elevation, azimuth, starts=degrees * file["starts"], bent=256 * degrees * file["bent"])
