"""What arrives is cut and decoded as a file of the same packets is read."""

import numpy as np
import pytest
from velodyne_packets import hdl64e_packets, udp, write_pcap

from automos.live.opening import VelodyneAssembler
from automos.readers import open_sequence

pytest.importorskip("velodyne_decoder", reason="packets need velodyne-decoder: pip install '.[velodyne]'")


def assembled(packets, at_once=7):
    assembler = VelodyneAssembler()
    scans, n_foreign = [], 0
    for i in range(0, len(packets), at_once):
        some = packets[i : i + at_once]
        got, foreign = assembler.add([payload for _, payload in some], [seconds for seconds, _ in some])
        scans += got
        n_foreign += foreign
    return scans + assembler.rest(), n_foreign


@pytest.mark.parametrize("at_once", [1, 7, 10_000])
def test_scans_are_those_of_a_file_of_the_same_packets(packets, tmp_path, at_once):
    path = write_pcap(tmp_path / "drive.pcap", [(seconds, udp(payload)) for seconds, payload in packets])
    wanted = open_sequence(path)
    got, n_foreign = assembled(packets, at_once)
    assert n_foreign == 0
    assert len(got) == len(wanted) >= 6
    for one, other in zip(got, wanted, strict=True):
        assert one.name == other.name
        assert one.stamp == pytest.approx(other.stamp, abs=1e-6)
        for column in ("points", "intensity", "time", "ring"):
            np.testing.assert_array_equal(getattr(one, column), getattr(other, column))


def test_what_is_no_packet_of_the_sensor_is_counted_and_changes_nothing(packets):
    other_model = bytearray(packets[0][1])
    other_model[1205] = 0x28
    strange = [b"", b"\xff" * 1206, b"x" * 512, bytes(other_model), packets[0][1][:-1]]
    mixed = []
    for i, (seconds, payload) in enumerate(packets):
        mixed.append((seconds, payload))
        if i > 10:
            mixed.append((seconds, strange[i % len(strange)]))
    got, n_foreign = assembled(mixed)
    wanted, _ = assembled(packets)
    assert n_foreign == len(packets) - 11
    assert [len(scan) for scan in got] == [len(scan) for scan in wanted]


@pytest.mark.slow
def test_a_clock_that_stands_still_does_not_fill_memory(packets):
    assembler = VelodyneAssembler()
    for _ in range(6000):
        assembler.add([packets[0][1]], [100.0])
    assert sum(map(len, assembler._parts)) <= 4000


def test_an_hdl_64e_is_decoded_once_it_has_told_its_calibration(tmp_path):
    azimuth = 0.17 * np.arange(6 * 5400)
    distance = np.random.default_rng(0).integers(2000, 30000, (len(azimuth), 64)) * 0.002
    packets = hdl64e_packets(distance, azimuth)
    path = write_pcap(tmp_path / "drive.pcap", [(seconds, udp(payload)) for seconds, payload in packets])
    wanted = {round(scan.stamp, 4): scan for scan in open_sequence(path)}
    got, n_foreign = assembled(packets, 100)
    assert n_foreign == 0
    assert 2 <= len(got) < len(wanted)  # the first three seconds went by
    for scan in got[:-1]:
        np.testing.assert_array_equal(scan.points, wanted[round(scan.stamp, 4)].points)
