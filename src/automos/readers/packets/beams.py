"""Where the beams of a sensor point: what its own calibration says, or else what its manual says of all of its kind."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.reading import is_there, read_json, read_text
from automos.readers.packets.layouts import Layout

TOLD = bytes.fromhex("A5FF005A11115555")
"""What packets with a RoboSense's calibration (DIFOP) begin with."""
_SIGNED = np.dtype([("is_below", "u1"), ("angle", ">u2")])
_PITCHES, _ANGLES = slice(1165, 1165 + 48), slice(468, 468 + 192)
"""Where an RS-LiDAR-16 tells the elevations of its beams, and an RS-LiDAR-32 these and their azimuths."""


@dataclass(frozen=True, eq=False)
class Beams:
    """The (C,) elevations and azimuths of a sensor's beams, degrees, and what to say of them."""

    elevation: npt.NDArray[np.float64]
    azimuth: npt.NDArray[np.float64]
    warnings: tuple[str, ...] = ()


def beams_of(layout: Layout, packets: Iterable[bytes], source: Path) -> Beams:
    """Return the beams of a sensor, told by NAME.csv beside the recording `source`, by some of its packets, or known.

    Raises
    ------
    InputError
        Nothing tells them; or the file is of another sensor, or no table of angles.
    """
    nominal = read_json(Path(__file__).with_name("beams.json")).get(layout.sensor)
    beside = table_beside(source)
    if is_there(beside) and "elevation" in read_text(beside)[:200].lower():
        return _from_table(beside, len(nominal["elevation"]) if nominal else 32)
    told = next((packet for packet in packets if packet.startswith(TOLD) and len(packet) == layout.size), None)
    if told is not None and layout.sensor == "RS-LiDAR-16":
        pitch = np.frombuffer(told[_PITCHES], np.uint8).reshape(16, 3) @ np.array([65536, 256, 1])
        return Beams(1e-4 * np.where(np.arange(16) < 8, -pitch, pitch), np.zeros(16))
    if told is not None:
        angles = np.frombuffer(told[_ANGLES], _SIGNED)
        return Beams(*(1e-3 * np.where(angles["is_below"], -1.0, 1.0) * angles["angle"]).reshape(2, 32))
    if nominal is None:
        raise InputError(
            f"{source} does not say where the beams of its {layout.sensor} point; record the sensor's DIFOP packets "
            f"(port 7788), too, or save a table of Channel,Elevation,Azimuth as {beside.name}"
        )
    said = (
        f"{source}: the beams are taken to point where those of any {layout.sensor} do, which is right to some tenths "
        f"of a degree; save this one's calibration (Channel,Elevation,Azimuth) as {beside.name}."
    )
    return Beams(np.array(nominal["elevation"], float), np.array(nominal["azimuth"], float), (said,))


def table_beside(source: Path) -> Path:
    """Return where the table of angles of the sensor that recorded `source` may be: NAME.csv."""
    return source.with_name(f"{source.name}.csv") if source.is_dir() else source.with_suffix(".csv")


def _from_table(path: Path, n_beams: int) -> Beams:
    """Return what a table of its maker says, a row for each beam: its number, elevation and azimuth."""
    try:
        rows = [line.split(",")[:3] for line in read_text(path).splitlines() if line[:1].isdigit()]
        table = np.array(rows, np.float64)
    except ValueError as error:
        raise InputError(f"{path} is no table of Channel,Elevation,Azimuth ({error}); save it again") from None
    if table.shape != (n_beams, 3) or not (np.abs(table[:, 1:]) <= 90.0).all():
        raise InputError(
            f"{path} has {len(table)} rows of angles, and the sensor {n_beams} beams; give the sensor's own table"
        )
    return Beams(table[:, 1], table[:, 2])
