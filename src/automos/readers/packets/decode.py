"""From the packets of a sweep to its points, whatever sensor sent them: what `layouts` says is all that differs.

Those of a Velodyne are decoded by velodyne-decoder, which knows each model's calibration.
"""

from collections.abc import Iterable
from functools import cached_property
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.core.reading import damage_reported
from automos.core.scan import Scan
from automos.readers.columns import Columns
from automos.readers.packets.beams import Beams, beams_of
from automos.readers.packets.layouts import VELODYNE, Layout, layout_of
from automos.readers.packets.pcap import Datagrams
from automos.readers.packets.sweeps import usual_turn

FACTORY = slice(1204, 1206)
"""Return mode and model in a packet, always the same; an HDL-64E sends its state and calibration there bytewise."""


class VelodyneDecoder:
    """Decodes the packets of one sensor."""

    layout: Layout = VELODYNE
    warnings: tuple[str, ...] = ()

    def __init__(self, packets: Iterable[bytes], source: str):
        """Take packets that contain the model, and of an HDL-64E its calibration (4160 in a row do); read when needed.

        `source` is where they come from, for messages.
        """
        self._packets, self._source = packets, source

    def columns(self, packets: Datagrams) -> Columns:
        """Return x, y, z, intensity, time (s since the first) and ring of the returns in a sweep's packets.

        Raises
        ------
        InputError
            Packets of an unknown model.
        MissingExtraError
            The library is not installed.
        """
        decoder = import_extra("velodyne_decoder", "velodyne")
        clock = VELODYNE.hour + VELODYNE.clock(packets)
        sent = zip(clock.tolist(), packets.payloads.tolist(), strict=True)
        vector = decoder.PacketVector([decoder.VelodynePacket(seconds, payload) for seconds, payload in sent])
        what, remedy = "cannot be decoded as packets of a Velodyne", "convert it with its maker's tools"
        with damage_reported(self._source, what, remedy):
            rows = decoder.ScanDecoder(self._config).decode(vector, as_pcl_structs=True)[1]
        return {name: rows[name] for name in ("x", "y", "z", "intensity", "time", "ring")}

    @cached_property
    def _config(self) -> Any:
        """What the library decodes by: all returns, whatever their range, timed from the sweep's first packet."""
        decoder = import_extra("velodyne_decoder", "velodyne")
        config = decoder.Config(min_range=0.0, max_range=np.inf, timestamp_first_packet=True)
        packets = iter(self._packets)
        first = list(islice(packets, 5))
        if tells_calibration(first):
            status = decoder.hdl64e.read_status_info(chain(first, packets))
            status_values = decoder.hdl64e.status_info_to_calib_dict(status)
            config.model = decoder.Model[f"HDL64E_{status_values['status']['Model']}"]
            config.calibration = decoder.Calibration.from_string(yaml.safe_dump(status_values))
        return config


def tells_calibration(packets: Iterable[bytes]) -> bool:
    """Return whether these few packets are of an HDL-64E, whose factory bytes change from packet to packet."""
    return len({packet[FACTORY] for packet in packets}) > 1


class TableDecoder:
    """Decodes packets as their layout says."""

    def __init__(self, layout: Layout, beams: Beams | None):
        """Take where the beams point, for sensors that have them."""
        self.layout, self._beams = layout, beams
        self.warnings = () if beams is None else beams.warnings

    def columns(self, packets: Datagrams) -> Columns:
        """Return x, y, z, intensity, time (s since the first packet) and, of beams, ring of the returns in a sweep.

        Points of no return, and returns that only repeat another, are left out.
        """
        rows, clock = self.layout.rows(packets), self.layout.clock(packets)
        blocks = rows["blocks"] if "blocks" in self.layout.names else rows[:, None]
        points = blocks["points"]  # (P, B, C)
        _, n_blocks, n = points.shape
        xyz, n_returns = (_places(points, self.layout.unit), 1) if self._beams is None else self._along_beams(blocks)
        step = float(np.median(np.diff(clock))) if len(clock) > 1 else 0.0
        turn = np.arange(n_blocks) // n_returns * n_returns / n_blocks  # two returns of a ray are a block each
        within = np.resize(self.layout.fired, n) * n_returns / n_blocks if n_blocks > 1 else np.arange(n) / n
        time = (clock - clock[0])[:, None, None] + step * (turn[:, None] + within)
        is_return = np.any(xyz, axis=-1)
        if n_returns == 2:
            is_return[:, 1::2] &= (xyz[:, 1::2] != xyz[:, ::2]).any(axis=-1)
        columns: Columns = {axis: xyz[..., k][is_return] for k, axis in enumerate("xyz")}
        columns |= {"intensity": points["intensity"][is_return].astype(np.float32), "time": time[is_return]}
        if self._beams is not None:
            rank = np.argsort(np.argsort(self._beams.elevation, kind="stable")).astype(np.uint16)
            columns["ring"] = np.broadcast_to(np.resize(rank, n), points.shape)[is_return]
        return columns

    def _along_beams(self, blocks: npt.NDArray) -> tuple[npt.NDArray[np.float32], int]:
        """Return (P, B, C, 3) points of (P, B) blocks, metres, and how many returns of a ray there are, 1 or 2.

        They are at their ranges along the beams, and at the origin where there was no return.
        """
        assert self._beams is not None
        points, azimuth = blocks["points"], blocks["azimuth"].astype(np.float64)
        if "fine" in (blocks.dtype.names or ()):
            azimuth += blocks["fine"] / 256
        n_returns = 2 if (azimuth[:, ::2] == azimuth[:, 1::2]).mean() > 0.5 else 1
        turned = usual_turn(azimuth.reshape(-1)[::n_returns])
        fired = 0.01 * (azimuth[..., None] + turned * np.resize(self.layout.fired, points.shape[2]))
        around, elevation = map(np.radians, self._beams.towards(fired))
        ahead = np.radians(self.layout.ahead)
        heading, mount = ahead - around, ahead - np.radians(fired)
        distance = points["range"] * self.layout.unit
        level, reach = distance * np.cos(elevation), self.layout.lens * (distance > 0)
        x = level * np.cos(heading) + reach * np.cos(mount)
        y = level * np.sin(heading) + reach * np.sin(mount)
        return np.stack([x, y, distance * np.sin(elevation)], axis=-1).astype(np.float32), n_returns


def _places(points: npt.NDArray, unit: float) -> npt.NDArray[np.float32]:
    """Return (..., 3) points, metres, of those that tell where they are."""
    names = points.dtype.names or ()
    if "x" in names:
        return (unit * np.stack([points[axis] for axis in "xyz"], axis=-1)).astype(np.float32)
    if "zenith" in names:
        up, around = (np.radians(0.01 * points[name]) for name in ("zenith", "around"))
        up = np.pi / 2 - up
    else:
        up, around = (np.radians(0.01 * (points[name].astype(np.float64) - 32768)) for name in ("pitch", "yaw"))
    ray = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1)
    return (unit * points["range"][..., None] * ray).astype(np.float32)


Decoder = VelodyneDecoder | TableDecoder
"""Makes points of the packets of one sensor."""
_TOLD_WITHIN = 4200
"""Packets that contain a sensor's calibration: an HDL-64E takes 4160 to tell it, a RoboSense tells it each second."""


def make_decoder(packets: Iterable[bytes], source: Path, layout: Layout | None = None) -> Decoder:
    """Return what decodes a sensor's packets, of which the first tell its kind and its calibration.

    Raises
    ------
    InputError
        Packets of no known kind, or beams of which nothing is told; `source` is where they come from.
    """
    packets = iter(packets)
    first: list[bytes] = []
    while layout is None and len(first) < _TOLD_WITHIN and (packet := next(packets, None)) is not None:
        first.append(packet)
        layout = layout_of(packet)
    if layout is None:
        raise InputError(
            f"{source} holds packets of a sensor that is not known here; play it through its maker's driver and record "
            "the points"
        )
    packets = chain(first, packets)
    if layout.sensor == VELODYNE.sensor:
        return VelodyneDecoder(packets, str(source))
    return TableDecoder(layout, beams_of(layout, islice(packets, _TOLD_WITHIN), source) if layout.turns else None)


def to_scan(rows: Columns, stamp: float, name: str) -> Scan:
    """Return the scan of one sweep's columns, all of whose points have a time."""
    ring = rows.get("ring")
    return Scan(
        np.column_stack([rows[axis] for axis in "xyz"]),
        intensity=np.ascontiguousarray(rows["intensity"]),
        time=np.ascontiguousarray(rows["time"], np.float32),
        ring=None if ring is None else ring.astype(np.uint16),
        stamp=stamp,
        name=name,
    )
