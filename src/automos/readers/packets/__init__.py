"""Packets as sensors send them, in captures, Livox's files and bags: a table of sensors, and one decoder for all."""

from pathlib import Path

from automos.core.scan import Sequence
from automos.readers.formats import Format, recordings_at


def _holds_packets(path: Path) -> bool:
    from automos.readers.packets.sequence import holds_packets

    return holds_packets(path)


def _find(path: Path) -> list[Path]:
    """Return the recordings at `path`: itself, a sensor of it, or those that lie in it by name."""
    return [path] if _holds_packets(path.parent) else recordings_at(path, _holds_packets)


def _open(path: Path) -> Sequence:
    from automos.readers.packets.sequence import PacketSequence

    return PacketSequence(path)


FORMAT = Format(
    layout="packets: .pcap or .pcapng of Velodyne (extra velodyne), Hesai, RoboSense or Livox, .lvx, "
    ".lvx2; of several give one: drive.pcap/ADDRESS-PORT",
    truth="",
    find=_find,
    open=_open,
)
