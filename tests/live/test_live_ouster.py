"""Frames put together of packets that the maker's library wrote. It cannot be installed beside rosbags."""

import numpy as np
import pytest

from automos.core.errors import AutomosError, InputError
from automos.live.opening import OusterAssembler


def test_metadata_that_is_none_is_told(tmp_path):
    path = tmp_path / "sensor.json"
    path.write_text("{}")
    with pytest.raises(AutomosError, match=r"is not metadata of an Ouster|is not installed; run"):
        OusterAssembler(path)


def test_scans_are_those_of_a_file_of_the_same_packets(tmp_path):
    core, pcap = pytest.importorskip("ouster.sdk.core"), pytest.importorskip("ouster.sdk.pcap")
    from test_ouster import write_drive

    from automos.readers import open_sequence

    write_drive(tmp_path / "drive.pcap")
    payloads = [
        bytes(packet.buf)
        for _, packet in pcap.PcapPacketSource(str(tmp_path / "drive.pcap"))
        if isinstance(packet, core.LidarPacket)
    ]
    assembler = OusterAssembler(tmp_path / "drive.json")
    mixed = [x for payload in payloads for x in (payload, b"\0" * 100)]
    scans, n_foreign = assembler.add(mixed, [1.6e9] * len(mixed))
    scans += assembler.rest()
    assert n_foreign == len(payloads)
    wanted = open_sequence(tmp_path / "drive.pcap")
    assert [scan.name for scan in scans] == wanted.names
    for one, other in zip(scans, wanted, strict=True):
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_allclose(one.time, other.time)
        assert one.stamp == pytest.approx(other.stamp)


def wrong_sensor(core, info):
    """Return packets of the same size that another sensor wrote."""
    util = pytest.importorskip("ouster.sdk.util")
    info.sn, info.init_id = 122150000999, 8
    frame = core.LidarScan(info)
    frame.status[:] = 1
    frame.measurement_id[:] = np.arange(frame.w)
    return [bytes(packet.buf) for packet in util.scan_to_packets(frame, info)][:3]


def test_packets_of_another_sensor_are_counted(tmp_path):
    core = pytest.importorskip("ouster.sdk.core")
    from test_ouster import write_drive

    _, info = write_drive(tmp_path / "drive.pcap", dual=True)  # the oldest profile names no sensor
    assembler = OusterAssembler(tmp_path / "drive.json")
    for packet in wrong_sensor(core, info):
        scans, n_foreign = assembler.add([packet], [1.6e9])
        assert (scans, n_foreign) == ([], 1)
    with pytest.raises(InputError, match="is not metadata of an Ouster"):
        OusterAssembler(tmp_path / "drive.pcap")
