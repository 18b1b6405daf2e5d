"""Packets written by the maker's library. It cannot be installed beside rosbags, so mostly this is skipped."""

import pickle
import re
import struct

import numpy as np
import pytest
from velodyne_packets import write_pcapng

from automos.core.errors import InputError, MissingExtraError
from automos.readers import open_sequence
from automos.readers.ouster import find


def test_a_pcap_without_metadata_is_told(tmp_path):
    path = tmp_path / "drive.pcap"
    path.touch()
    assert find(tmp_path) == [path]
    assert find(path / "1221") == [path / "1221"]
    with pytest.raises(
        InputError, match=r"drive.pcap has no metadata drive.json beside it, .* no packets of a known .*; put it there"
    ):
        open_sequence(path)


def write_drive(path, dual=False):
    """Write three frames of a sensor, one or two returns a pixel; return the ranges of each and the metadata."""
    core = pytest.importorskip("ouster.sdk.core")
    pcap = pytest.importorskip("ouster.sdk.pcap")
    util = pytest.importorskip("ouster.sdk.util")
    info = core.SensorInfo.from_default(core.LidarMode._1024x10)
    info.sn, info.init_id = 122150000150, 7
    info.config.udp_port_lidar, info.config.udp_port_imu = 7502, 7503
    if dual:
        info.format.udp_profile_lidar = core.UDPProfileLidar.RNG19_RFL8_SIG16_NIR16_DUAL
    rng = np.random.default_rng(0)
    ranges, packets = [], []
    for i in range(3):
        frame = core.LidarScan(info)
        frame.frame_id = i + 1
        frame.timestamp[:] = 1_600_000_000_000_000_000 + i * 10**8 + np.arange(frame.w) * (10**8 // frame.w)
        frame.measurement_id[:], frame.status[:] = np.arange(frame.w), 1
        returns = []
        for number in ("", "2") if dual else ("",):
            millimetres = rng.integers(2000, 50000, (frame.h, frame.w)).astype(np.uint32)
            millimetres[rng.random(millimetres.shape) < 0.2] = 0
            frame.field(f"RANGE{number}")[:] = millimetres
            frame.field(f"REFLECTIVITY{number}")[:] = rng.integers(0, 255, millimetres.shape)
            returns.append(millimetres)
        written = util.scan_to_packets(frame, info)
        if i == 1:
            del written[10]  # a packet of 16 columns was lost
            for millimetres in returns:
                millimetres[:, 160:176] = 0
        for packet in written:
            packet.host_timestamp = 1_600_000_000_000_000_000 + len(packets) * 10**6
            packets.append(packet)
        ranges.append(returns)
    pcap.record(packets, str(path))
    path.with_suffix(".json").write_text(info.to_json_string())
    return ranges, info


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Return a file of three frames, the ranges written, and the sensor's metadata."""
    path = tmp_path_factory.mktemp("ouster") / "drive.pcap"
    ranges, info = write_drive(path)
    return path, [returns[0] for returns in ranges], info


def test_second_returns_follow_the_first(tmp_path):
    ranges, _ = write_drive(tmp_path / "dual.pcap", dual=True)
    for scan, returns in zip(open_sequence(tmp_path / "dual.pcap"), ranges, strict=True):
        distance = np.linalg.norm(scan.points, axis=1)
        written = np.concatenate([millimetres.T.ravel() for millimetres in returns]) / 1000
        assert len(scan) == 2 * returns[0].size
        # the ranges are from where the beams start, a few centimetres from the frame's origin
        np.testing.assert_allclose(distance, written, atol=0.1)
        np.testing.assert_array_equal(scan.ring[: len(scan) // 2], scan.ring[len(scan) // 2 :])
        np.testing.assert_array_equal(scan.time[: len(scan) // 2], scan.time[len(scan) // 2 :])


def test_frames_are_read_column_by_column_with_every_pixel(drive):
    from ouster.sdk.core import XYZLut

    path, ranges, info = drive
    sequence = open_sequence(path)
    assert (sequence.name, len(sequence), sequence.is_compensated) == ("drive", 3, False)
    np.testing.assert_allclose(sequence.stamps - sequence.stamps[0], [0, 0.1, 0.2], atol=1e-6)
    for scan, millimetres in zip(sequence, ranges, strict=True):
        h, w = millimetres.shape
        assert len(scan) == h * w
        assert scan.is_valid.sum() == (millimetres > 0).sum()
        points = XYZLut(info, use_extrinsics=False)(millimetres)
        for column, row in ((0, 0), (5, 63), (163, 2), (1023, 31)):
            k = column * h + row
            np.testing.assert_allclose(scan.points[k], points[row, column], atol=1e-4)
            assert scan.ring[k] == row
            assert scan.time[k] == pytest.approx(column * (10**8 // w) * 1e-9, abs=1e-6)


def test_a_file_may_be_read_in_another_process_and_by_its_sensors_number(drive):
    path, ranges, _ = drive
    sequence = open_sequence(path / "122150000150")
    copy = pickle.loads(pickle.dumps(sequence))
    np.testing.assert_array_equal(copy[2].points, sequence[2].points)
    assert sequence.name == "drive_122150000150"
    with pytest.raises(InputError, match=r"has no sensor 5; it has: 122150000150"):
        open_sequence(path / "5")
    assert len(ranges) == 3


def test_a_file_that_is_cut_short_or_of_no_packets_is_told(drive, tmp_path):
    path, _, _ = drive
    (tmp_path / "cut.json").write_text(path.with_suffix(".json").read_text())
    (tmp_path / "cut.pcap").write_bytes(b"no packets at all")
    with pytest.raises(InputError, match=r"cut.pcap (cannot be read as a recording|holds no frames)"):
        open_sequence(tmp_path / "cut.pcap")
    (tmp_path / "cut.json").write_text("{")
    with pytest.raises(InputError, match=r"cut.pcap cannot be read as a recording of an Ouster"):
        open_sequence(tmp_path / "cut.pcap")


def test_a_capture_that_ends_within_a_packet_is_told(drive, tmp_path):
    path, _, _ = drive
    (tmp_path / "half.json").write_text(path.with_suffix(".json").read_text())
    content = path.read_bytes()
    (tmp_path / "half.pcap").write_bytes(content[: len(content) // 2 + 7])
    with pytest.raises(InputError, match=r"half.pcap ends within a packet"):
        open_sequence(tmp_path / "half.pcap")


def test_metadata_of_beams_that_point_nowhere_is_told(drive, tmp_path):
    path, _, _ = drive
    (tmp_path / "odd.pcap").write_bytes(path.read_bytes())
    text = path.with_suffix(".json").read_text()
    angles = re.search(r'"beam_azimuth_angles":\s*\[\s*([-\d.e]+)', text)
    (tmp_path / "odd.json").write_text(text[: angles.start(1)] + "1e300" + text[angles.end(1) :])
    with pytest.raises(InputError, match=r"odd.pcap has metadata of beams that point nowhere"):
        open_sequence(tmp_path / "odd.pcap")[0]


def test_frames_of_ousters_own_recorder_are_those_of_the_packets(drive, tmp_path):
    osf, pcap = pytest.importorskip("ouster.sdk.osf"), pytest.importorskip("ouster.sdk.pcap")
    path, _, _ = drive
    packets = pcap.PcapScanSource(str(path), meta=[str(path.with_suffix(".json"))], index=True)
    writer = osf.Writer(str(tmp_path / "drive.osf"), packets.sensor_info)
    for frames in packets:
        writer.save(0, next(frame for frame in frames if frame is not None))
    writer.close()
    sequence = open_sequence(tmp_path)  # it needs nothing beside it
    assert (sequence.name, len(sequence), sequence.source.name) == ("drive", 3, "drive.osf")
    for got, true in zip(sequence, open_sequence(path), strict=True):
        np.testing.assert_allclose(got.points, true.points, atol=1e-6)
        np.testing.assert_array_equal(got.intensity, true.intensity)
        np.testing.assert_array_equal(got.time, true.time)
    (tmp_path / "drive.osf").write_bytes((tmp_path / "drive.osf").read_bytes()[:1000])
    with pytest.raises(InputError, match=r"drive.osf (is damaged|cannot be read)"):
        open_sequence(tmp_path)


def test_a_capture_of_wiresharks_own_kind_holds_the_same_frames(drive, tmp_path):
    path, _, _ = drive
    raw, frames, at = path.read_bytes(), [], 24
    while at < len(raw):
        seconds, fraction, size, _ = struct.unpack_from("<IIII", raw, at)
        frames.append((seconds + 1e-6 * fraction, raw[at + 16 : at + 16 + size]))
        at += 16 + size
    link = struct.unpack_from("<I", raw, 20)[0]
    write_pcapng(tmp_path / "drive.pcapng", frames, link=link, other=link)
    (tmp_path / "drive.json").write_text(path.with_suffix(".json").read_text())
    for got, true in zip(open_sequence(tmp_path), open_sequence(path), strict=True):
        np.testing.assert_array_equal(got.points, true.points)


def test_without_the_library_what_converts_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "ouster.sdk.osf", None)
    (tmp_path / "drive.osf").write_bytes(b"4\0\0\0\x14\0\0\0OSF$")
    with pytest.raises(MissingExtraError, match=r"\[ouster\]', in an environment .* ouster-cli source drive.osf save"):
        open_sequence(tmp_path / "drive.osf")
