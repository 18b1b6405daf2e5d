"""From the packets of a Velodyne's sweep to its points, by velodyne-decoder, which knows each model's calibration."""

from collections.abc import Iterable
from functools import cached_property
from itertools import chain, islice
from typing import Any

import numpy as np
import yaml

from automos.core.errors import InputError
from automos.readers.columns import Columns
from automos.readers.formats import import_extra
from automos.readers.packets.layouts import VELODYNE
from automos.readers.packets.pcap import Datagrams

FACTORY = slice(1204, 1206)
"""Return mode and model in a packet, always the same; an HDL-64E sends its state and calibration there bytewise."""


class VelodyneDecoder:
    """Decodes the packets of one sensor."""

    layout, warnings = VELODYNE, tuple[str, ...]()

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
        try:
            rows = decoder.ScanDecoder(self._config).decode(vector, as_pcl_structs=True)[1]
        except (RuntimeError, ValueError) as error:
            raise InputError(
                f"{self._source} cannot be decoded as packets of a Velodyne ({error}); convert it with its maker's "
                "tools"
            ) from error
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
