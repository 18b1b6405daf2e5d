"""Opens the feed of scans for an address or a recording."""

from pathlib import Path

from automos.core.errors import InputError
from automos.live.feed import Feed, Replay
from automos.live.ouster import OusterAssembler
from automos.live.udp import UdpFeed, parse_address
from automos.live.velodyne import VelodyneAssembler
from automos.readers import open_sequence
from automos.readers.formats import import_extra


def open_feed(
    source: str,
    sensor: str | None = None,
    metadata: Path | None = None,
    speed: float = 1.0,
    patience: float = 10.0,
    format: str | None = None,
) -> Feed:
    """Return what SOURCE names: packets at udp://HOST:PORT, or a recording to replay.

    Raises
    ------
    InputError : no such address, sensor, metadata or recording, or several recordings.
    MissingExtraError : what decodes the packets is not installed.
    """
    if "://" not in source:
        return Replay(open_sequence(Path(source), format), speed)
    host, port = parse_address(source)
    if sensor == "velodyne":
        import_extra("velodyne_decoder", "velodyne")
        return UdpFeed(host, port, VelodyneAssembler(), patience)
    if sensor == "ouster":
        if metadata is None:
            raise InputError(
                "packets of an Ouster need its metadata: save http://SENSOR/api/v1/sensor/metadata to a file and give "
                "it, --metadata FILE"
            )
        return UdpFeed(host, port, OusterAssembler(metadata), patience)
    wanted = "" if sensor is None else f", not {sensor}"
    raise InputError(f"whose packets come to {source}? give --sensor velodyne or --sensor ouster{wanted}")
