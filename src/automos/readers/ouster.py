"""Ouster sensors: packets (.pcap, .pcapng) and the sensor's metadata beside them, name.json or name_0.json; or .osf.

Decoded by the maker's own library. A scan is a frame, column after column as it was measured, pixels without a return
included; the second returns of a sensor that gives two follow the first. Of several sensors one is named by its serial
number, as if the file were a folder: `drive.pcap/122150000150`.
"""

from contextlib import AbstractContextManager
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.errors import InputError, MissingExtraError
from automos.core.extras import import_extra
from automos.core.reading import damage_reported, require_regular
from automos.core.scan import Array, Scan
from automos.readers.foreign import ByThread, limited
from automos.readers.formats import Format, SensorSequence, choose_sensor, is_capture, recordings_at
from automos.readers.packets.pcap import require_whole

_RETURNS = (("RANGE", "REFLECTIVITY"), ("RANGE2", "REFLECTIVITY2"))
_TURN, _FARTHEST_MOUNT = 360.0, 1e4
"""Degrees of any beam, and millimetres of any offset in a sensor, at most."""
_KNOWN = "a known Velodyne, Hesai, RoboSense or Livox"
_IS_VALID = 1
"""Bit of a column's status; columns whose packet was lost have none."""


def find(path: Path) -> list[Path]:
    """Return the recordings at `path`: itself, a sensor of it, or those that lie in it by name."""
    return [path] if _is_pcap(path.parent) else recordings_at(path, _is_pcap)


def _is_pcap(path: Path) -> bool:
    return is_capture(path) or (path.suffix.lower() == ".osf" and path.is_file())


class OusterSequence(SensorSequence):
    """The frames of one sensor, found once, read when asked for."""

    def __init__(self, path: Path):
        """Find the frames in the file at `path`, or those of the sensor whose serial number `path` names below it.

        Raises
        ------
        InputError
            No metadata, a damaged file, several sensors, or no frames.
        """
        super().__init__(path)
        self._threads = ByThread()
        stem = self.source.stem
        self._is_osf = self.source.suffix.lower() == ".osf"  # holds frames, and their metadata
        names = () if self._is_osf else (f"{stem}.json", f"{stem}_*.json")
        self._metadata = sorted({file for name in names for file in self.source.parent.glob(name)})
        if not self._metadata and not self._is_osf:
            raise InputError(
                f"{self.source} has no metadata {stem}.json beside it, which Ouster's packets need, and no packets of "
                f"{_KNOWN}; put it there, or convert other makers' packets to a ROS bag or PCD: their drivers and "
                "viewers do"
            )
        serials = [str(info.sn) for info in self._reader.sensor_info]
        self._identity = choose_sensor(self.source, self._wanted, serials, "sensor")
        if not self._is_osf:
            require_whole(self.source)  # the library passes over the end of one that is cut short
        self._places, stamps = self._index()
        if not self._places:
            raise InputError(f"{self.source} holds no frames of sensor {self._identity}; its metadata may be another's")
        self._set_stamps(stamps)

    def __getitem__(self, index: int) -> Scan:
        index = self._scan_number(index)
        place, within = self._places[index]
        with limited(self.source):
            frame = [frame for frame in self._reader[place] if frame is not None][within]
        return frame_to_scan(frame, self._to_points, float(self.stamps[index]), self.names[index])

    def _files(self) -> list[Path]:
        return [self.source, *self._metadata]

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in self.__dict__.items() if key != "_to_points"}

    # ------------------------------------------------------------------------------------------------ the library
    @property
    def _reader(self) -> Any:
        """The opened and indexed file; one for each thread, as readers are not made to be shared."""
        if not hasattr(self._threads, "reader"):
            library = self._library()
            for file in (self.source, *self._metadata):
                require_regular(file)
            with self._damage_reported():
                if self._is_osf:
                    self._threads.reader = library.OsfScanSource(str(self.source), index=True)
                else:
                    metadata = [str(file) for file in self._metadata]
                    self._threads.reader = library.PcapScanSource(str(self.source), meta=metadata, index=True)
        return self._threads.reader

    def _damage_reported(self) -> AbstractContextManager[None]:
        """Tell what the library raises in one sentence: damaged files break it in many ways."""
        return damage_reported(self.source, "cannot be read as a recording of an Ouster", kinds=Exception)

    def _library(self) -> Any:
        try:
            return import_extra(f"ouster.sdk.{'osf' if self._is_osf else 'pcap'}", "ouster")
        except MissingExtraError as error:
            raise MissingExtraError(
                f"{error}, in an environment without rosbags, which it does not go with; or convert {self.source.name} "
                f"to a ROS bag: ouster-cli source {self.source.name} save drive.bag"
            ) from None

    @cached_property
    def _to_points(self) -> Any:
        """Turns ranges (H, W), millimetres, into points (H, W, 3), metres, sensor frame; 0 stays at the origin."""
        info = next(info for info in self._reader.sensor_info if str(info.sn) == self._identity)
        return make_to_points(info, self.source)

    def _index(self) -> tuple[list[tuple[int, int]], list[float]]:
        """Return where each frame of the sensor is (item, place in it) and its stamp in seconds."""
        places, stamps = [], []
        with self._damage_reported():
            for item, frames in enumerate(self._reader):
                for within, frame in enumerate(frame for frame in frames if frame is not None):
                    if str(frame.sensor_info.sn) == self._identity:
                        places.append((item, within))
                        stamps.append(first_stamp(frame))
        return places, stamps


def make_to_points(info: Any, path: Path) -> Any:
    """Return what turns ranges of the sensor into points, as the library does.

    Raises
    ------
    InputError
        The metadata lists beams without a direction; `path` is what it came with.
    """
    angles = np.concatenate([info.beam_altitude_angles, info.beam_azimuth_angles])
    mounts = np.concatenate([np.ravel(info.beam_to_lidar_transform), np.ravel(info.lidar_to_sensor_transform)])
    if not ((np.abs(angles) <= _TURN).all() and (np.abs(mounts) < _FARTHEST_MOUNT).all()):
        raise InputError(f"{path} has metadata of beams that point nowhere; save it from the sensor again")
    return import_extra("ouster.sdk.core", "ouster").XYZLut(info, use_extrinsics=False)


def frame_to_scan(frame: Any, to_points: Any, stamp: float, name: str) -> Scan:
    """Return a frame of the library as a scan; `to_points` turns its ranges (H, W) into points (H, W, 3)."""
    times = _column_seconds(frame)
    points, intensity = [], []
    for range_, reflectivity in _RETURNS:
        if range_ not in frame.fields:
            continue
        # (H, W, 3): the library has rows of beams; columns are what was measured together.
        points.append(to_points(frame.field(range_)).transpose(1, 0, 2).reshape(-1, 3))
        if reflectivity in frame.fields:
            intensity.append(frame.field(reflectivity).T.ravel())
    n = len(points)
    return Scan(
        np.concatenate(points).astype(np.float32),
        intensity=np.concatenate(intensity).astype(np.float32) if len(intensity) == n else None,
        time=np.tile(np.repeat(times, frame.h), n).astype(np.float32),
        ring=np.tile(np.arange(frame.h, dtype=np.uint16), frame.w * n),
        stamp=stamp,
        name=name,
    )


def first_stamp(frame: Any) -> float:
    """Return the seconds of the frame's first column that was received."""
    received = np.flatnonzero(frame.status & _IS_VALID)
    return 1e-9 * int(frame.timestamp[received[0]]) if len(received) else 0.0


def _column_seconds(frame: Any) -> Array:
    """Return (W,) seconds of each column after the first one received; lost columns lie evenly between the others."""
    received = np.flatnonzero(frame.status & _IS_VALID)
    if len(received) == 0:
        return np.zeros(frame.w)
    stamps = frame.timestamp[received]
    return np.interp(np.arange(frame.w), received, (stamps - stamps[0]).astype(np.float64) * 1e-9)


FORMAT = Format(
    layout="Ouster: .pcap or .pcapng and its .json, or .osf; of several sensors give one: drive.pcap/SERIAL",
    find=find,
    open=OusterSequence,
    needs="ouster",
)
