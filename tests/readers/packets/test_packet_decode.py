"""Every sensor in the table: packets made byte by byte from its manual come out as the points they were made of."""

import struct

import numpy as np
import pytest
import sensor_packets as made
from velodyne_packets import udp, write_pcap, write_pcapng

from automos.core.errors import InputError
from automos.readers import find_recordings, open_sequence
from automos.readers.packets.beams import beams_of
from automos.readers.packets.layouts import LAYOUTS, layout_of
from automos.readers.packets.pcap import Capture, open_capture
from automos.readers.packets.sweeps import kinds_in

START = 1.7e9
SPINNING = {"Pandar40P": (10, 40), "Pandar64": (6, 64), "Pandar128": (2, 128), "PandarXT-16": (8, 16),
            "PandarXT-32": (8, 32), "PandarXT-32M": (6, 32)}  # fmt: skip


def nominal(model, folder):
    layout = next(layout for layout in LAYOUTS if layout.sensor == model)
    beams = beams_of(layout, [], folder / "none.pcap")
    assert beams.warnings
    return np.array(beams.elevation), np.array(beams.azimuth)


def send(path, packets, **sender):
    return write_pcap(path, [(START + seconds, udp(raw, **sender)) for seconds, raw in packets])


def drive(model, n_turns=3, first=4321):
    """Return seconds and packets, and azimuths (n,) and ranges (n, channels) of blocks 0.4 degrees apart."""
    n_blocks, n = SPINNING[model]
    count = 900 * n_turns // n_blocks * n_blocks
    azimuth = (first + 40 * np.arange(count)) % 36000
    ranges = np.random.default_rng(1).integers(200, 20_000, (count, n))
    ranges[::7, ::3] = 0
    packets = []
    for k in range(0, count, n_blocks):
        seconds = k * 0.1 / 900
        own = round(1e6 * (0.25 + seconds)) % 10**6
        some = slice(k, k + n_blocks)
        packets.append((seconds, made.hesai(model, azimuth[some].tolist(), ranges[some], own)))
    return packets, azimuth, ranges


@pytest.mark.parametrize("model", SPINNING)
def test_the_points_of_a_hesai_are_those_of_its_packets(tmp_path, model):
    packets, azimuth, ranges = drive(model)
    elevation, offset = nominal(model, tmp_path)
    sequence = open_sequence(send(tmp_path / "drive.pcap", packets))
    assert sequence.about == {"files": f"of a {model}"}
    assert len(sequence) == 3
    assert "drive.csv" in sequence.warnings[0]
    rank = np.argsort(np.argsort(elevation))
    scans = list(sequence)
    np.testing.assert_allclose(np.diff(sequence.stamps), 0.1, atol=0.002)
    heading, level = np.radians(0.01 * azimuth[:, None] + offset), 0.004 * ranges * np.cos(np.radians(elevation))
    xyz = np.stack(
        [level * np.sin(heading), level * np.cos(heading), 0.004 * ranges * np.sin(np.radians(elevation))], -1
    )
    is_return = ranges > 0
    np.testing.assert_allclose(np.concatenate([scan.points for scan in scans]), xyz[is_return], atol=1e-4)
    channel = np.broadcast_to(np.arange(ranges.shape[1]), ranges.shape)
    np.testing.assert_array_equal(np.concatenate([scan.intensity for scan in scans]), channel[is_return])
    np.testing.assert_array_equal(np.concatenate([scan.ring for scan in scans]), rank[channel[is_return]])
    seconds = np.concatenate([scan.time.astype(float) + (scan.stamp - START) for scan in scans])
    true = np.broadcast_to((0.1 / 900 * np.arange(len(azimuth)))[:, None], ranges.shape)[is_return]
    np.testing.assert_allclose(seconds, true, atol=3e-6)


def test_two_returns_of_a_ray_are_both_there_where_they_differ(tmp_path):
    packets, _, ranges = drive("PandarXT-32", 2)
    twice = []
    for k, (seconds, _) in enumerate(packets):
        rows = ranges[8 * k : 8 * k + 8].copy()
        rows[1::2] = np.where(np.arange(32) < 20, rows[::2], rows[1::2])  # the first 20 channels saw one thing only
        azimuth = np.repeat(4000 + 160 * k + 40 * np.arange(4), 2) % 36000
        twice.append((seconds, made.hesai("PandarXT-32", azimuth.tolist(), rows, round(1e6 * seconds) % 10**6)))
    scans = list(open_sequence(send(tmp_path / "drive.pcap", twice)))
    kept = np.concatenate([scan.ring for scan in scans])
    n_first = (ranges[::2, :20] > 0).sum()
    assert (kept >= 12).sum() == n_first  # ring counts from the lowest, channels from the highest
    assert (kept < 12).sum() == (ranges[:, 20:] > 0).sum() - (ranges[::2, 20:] == ranges[1::2, 20:]).sum()


def test_the_sensors_own_table_of_angles_is_obeyed_and_another_refused(tmp_path):
    packets, _, _ = drive("PandarXT-16", 1)
    path = send(tmp_path / "drive.pcap", packets)
    rows = [f"{k + 1},{20 - k},{0.5}" for k in range(16)]
    (tmp_path / "drive.csv").write_text("Channel,Elevation,Azimuth\r\n" + "\r\n".join(rows))
    sequence = open_sequence(path)
    assert sequence.warnings == []
    scan = sequence[0]
    steep = np.degrees(np.arctan2(scan.points[:, 2], np.hypot(*scan.points[:, :2].T)))
    np.testing.assert_allclose(steep, 5 + scan.ring.astype(float), atol=1e-3)
    (tmp_path / "drive.csv").write_text("time,latitude,longitude\n1,2,3\n")  # of something else
    assert "drive.csv" in open_sequence(path).warnings[0]
    (tmp_path / "drive.csv").write_text("Channel,Elevation,Azimuth\n1,2,3\n")
    with pytest.raises(InputError, match=r"drive.csv has 1 rows of angles, and the sensor 16 beams"):
        open_sequence(path)
    (tmp_path / "drive.csv").write_text("Channel,Elevation,Azimuth\n1,two,3\n")
    with pytest.raises(InputError, match=r"drive.csv is no table of Channel,Elevation,Azimuth"):
        open_sequence(path)


def at128_drive(path, n_frames=4, size=1118, sense=1):
    """Write a capture and its correction file; return azimuths (n,) in degrees, ranges (n, 128), seconds (n,), angles.

    The azimuth runs on by 0.05 degrees a block, or back if `sense` is -1; blocks are sent where a mirror looks ahead.
    """
    rng = np.random.default_rng(5)
    starts = np.array([23.0703125, 143.4375, 263.125])
    azimuth = rng.integers(-30_000, 30_000, 128)
    elevation = np.linspace(165_000, -160_000, 128).astype(int)
    bent = rng.integers(-40, 40, (2, 128, 180))
    raw = made.correction((25600 * starts / 2).astype(int).tolist(), azimuth, elevation, bent, unit=2)
    path.with_suffix(".dat").write_bytes(raw)
    turned = 150.0 + sense * 0.05 * np.arange(2400 * (n_frames + 1))
    since = np.min([(turned - start) % 360 for start in starts], axis=0)
    is_sent = (since > 15) & (since < 75)
    turned, seconds = turned[is_sent], np.abs(turned[is_sent] - 150.0) / 1200.0
    ticks = np.round(25600 * (turned % 360)).astype(int)
    ranges = rng.integers(0, 40_000, (len(ticks), 128))
    packets = [
        (seconds[k], made.at128(ticks[k : k + 2].tolist(), ranges[k : k + 2], round(1e6 * seconds[k]) % 10**6, size))
        for k in range(0, len(ticks) // 2 * 2, 2)
    ]
    send(path, packets)
    return ticks / 25600, ranges, seconds, (starts, azimuth * 2 / 25600, elevation * 2 / 25600, 0.02 * bent)


@pytest.mark.parametrize(("size", "sense"), [(1078, 1), (1118, 1), (1118, -1)])
def test_the_points_of_an_at128_lie_where_its_mirrors_send_the_beams(tmp_path, size, sense):
    path = tmp_path / "drive.pcap"
    azimuth, ranges, seconds, (starts, offset, elevation, bent) = at128_drive(path, size=size, sense=sense)
    sequence = open_sequence(tmp_path / "drive.pcap")
    assert sequence.warnings == []
    assert sequence.about == {"files": "of a Hesai AT128"}
    scans = list(sequence)
    knots, every = np.arange(0, 361, 2), np.concatenate([bent, bent[..., :1]], axis=-1)
    last = np.array([max(start for start in (*starts, starts[2] - 360) if start <= a) for a in azimuth])
    around, steep = np.empty(ranges.shape), np.empty(ranges.shape)
    for beam in range(128):
        around[:, beam] = 2 * (azimuth - last) - offset[beam] + np.interp(azimuth, knots, every[0, beam])
        steep[:, beam] = elevation[beam] + np.interp(azimuth, knots, every[1, beam])
    around, steep, r = np.radians(around), np.radians(steep), 0.004 * ranges
    xyz = np.stack([r * np.cos(steep) * np.sin(around), r * np.cos(steep) * np.cos(around), r * np.sin(steep)], -1)
    got = np.concatenate([scan.points for scan in scans])
    np.testing.assert_allclose(got, np.stack([xyz[..., 0], xyz[..., 1], xyz[..., 2]], -1)[ranges > 0], atol=1e-4)
    channel = np.broadcast_to(np.arange(128), ranges.shape)[ranges > 0]
    np.testing.assert_array_equal(np.concatenate([scan.ring for scan in scans]), 127 - channel)
    np.testing.assert_array_equal(np.concatenate([scan.intensity for scan in scans]), channel)
    when = np.concatenate([scan.time.astype(float) + (scan.stamp - START) for scan in scans])
    np.testing.assert_allclose(when, np.broadcast_to(seconds[:, None], ranges.shape)[ranges > 0], atol=3e-6)
    # every scan is what one mirror saw
    mirrors = [
        np.unique(last[(seconds > s.stamp - START - 1e-6) & (seconds < s.stamp - START + s.time[-1])]) for s in scans
    ]
    assert [len(one) for one in mirrors] == [1] * len(scans)
    np.testing.assert_allclose(np.diff(sequence.stamps)[1:-1], 0.1, atol=0.001)


def test_an_at128_without_its_angle_correction_file_or_with_another_is_refused(tmp_path):
    path = tmp_path / "drive.pcap"
    at128_drive(path, 1)
    whole = path.with_suffix(".dat").read_bytes()
    path.with_suffix(".dat").unlink()
    with pytest.raises(
        InputError, match=r"beams of its Hesai AT128 point; save the sensor's angle correction .*drive.dat"
    ):
        open_sequence(path)
    for wrong in (b"", whole[:-1], whole[:3] + b"\3" + whole[4:], bytes(len(whole))):
        path.with_suffix(".dat").write_bytes(wrong)
        with pytest.raises(InputError, match=r"drive.dat is no angle correction file of version 1.5 of an AT128"):
            open_sequence(path)


def robosense_drive(model, n_packets):
    per_block = 40 if model == 1 else 20
    azimuth = (per_block * np.arange(12 * n_packets)) % 36000
    ranges = np.random.default_rng(2).integers(0, 30_000, (12 * n_packets, 32))
    step = 1.0 / 360 * 0.1 * per_block / 100
    packets = [
        (k * 12 * step, made.robosense(model, azimuth[12 * k : 12 * k + 12].tolist(), ranges[12 * k : 12 * k + 12],
                                       round(1e6 * k * 12 * step) % 10**6))
        for k in range(n_packets)
    ]  # fmt: skip
    return packets, azimuth, ranges, step


@pytest.mark.parametrize("model", [1, 2])
def test_the_points_of_a_robosense_are_those_of_its_packets(tmp_path, model):
    packets, azimuth, ranges, step = robosense_drive(model, 160)
    if model == 1:
        elevation = np.r_[np.linspace(-15.1, -1.1, 8), np.linspace(15.2, 1.2, 8)].round(4)
        told, offset = made.difop16(elevation), np.zeros(16)
        fired = np.concatenate([np.arange(16) * 2.8, 55.5 + np.arange(16) * 2.8]) / 111.0
    else:
        rng = np.random.default_rng(3)
        elevation, offset = rng.uniform(-25, 15, 32).round(3), rng.uniform(-8, 8, 32).round(3)
        told = made.difop32(elevation, offset)
        fired = np.r_[np.arange(15) * 2.88, 44.64, 1.44 + np.arange(15) * 2.88, 46.08] / 55.52
    frames = [(START + t, udp(raw, port=6699)) for t, raw in packets] + [(START + 0.01, udp(told, port=7788))]
    sequence = open_sequence(write_pcap(tmp_path / "drive.pcap", sorted(frames)))
    assert sequence.warnings == []
    n = len(elevation)
    turned = 40 if model == 1 else 20
    mount = np.radians(0.01 * (azimuth[:, None] + turned * fired))
    heading, steep = mount + np.radians(np.resize(offset, 32)), np.radians(np.resize(elevation, 32))
    r, lens = 0.005 * ranges, 0.03825 if model == 1 else 0.03997
    x = r * np.cos(steep) * np.cos(heading) + lens * np.cos(mount)
    y = -r * np.cos(steep) * np.sin(heading) - lens * np.sin(mount)
    xyz = np.stack([x, y, r * np.sin(steep)], axis=-1)[ranges > 0]
    scans = list(sequence)
    np.testing.assert_allclose(np.concatenate([scan.points for scan in scans]), xyz, atol=1e-4)
    rank = np.argsort(np.argsort(elevation, kind="stable"))
    channel = np.broadcast_to(np.arange(32) % n, ranges.shape)[ranges > 0]
    np.testing.assert_array_equal(np.concatenate([scan.ring for scan in scans]), rank[channel])
    true = (step * (np.arange(len(azimuth))[:, None] + fired))[ranges > 0]
    np.testing.assert_allclose(
        np.concatenate([s.time.astype(float) + (s.stamp - START) for s in scans]), true, atol=3e-6
    )


def test_a_robosense_of_32_beams_that_are_nowhere_told_is_refused(tmp_path):
    packets, *_ = robosense_drive(2, 40)
    with pytest.raises(InputError, match=r"does not say where the beams of its RS-LiDAR-32 point; record .* DIFOP"):
        open_sequence(send(tmp_path / "drive.pcap", packets))


def test_the_points_of_an_m1_are_those_of_its_packets_a_scan_for_each_frame(tmp_path):
    rng = np.random.default_rng(4)
    shape = (3 * 630, 25, 5)
    ranges, pitch, yaw = (
        rng.integers(1, 30_000, shape),
        rng.integers(-1250, 1250, shape),
        rng.integers(-6000, 6000, shape),
    )
    step = 0.1 / 630
    packets = [
        (k * step, made.m1((k + 300) % 630 + 1, 5.0 + k * step, ranges[k], pitch[k], yaw[k]))
        for k in range(len(ranges))
    ]
    sequence = open_sequence(send(tmp_path / "drive.pcap", packets))
    assert [len(scan) // 125 for scan in sequence] == [330, 630, 630, 300]
    p, y, r = np.radians(0.01 * pitch), np.radians(0.01 * yaw), 0.005 * ranges
    xyz = np.stack([r * np.cos(p) * np.cos(y), r * np.cos(p) * np.sin(y), r * np.sin(p)], axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(np.concatenate([scan.points for scan in sequence]), xyz, atol=1e-4)
    assert sequence[0].ring is None
    assert (sequence[0].intensity == 77).all()
    np.testing.assert_allclose(sequence[1].time[[0, -1]], [0.0, 0.1], atol=2e-4)


def livox_drive(kind, n, is_second, n_packets=500, step=400_000):
    """Return packets of Livox's protocols and the true points (n_packets * n, 3)."""
    rng = np.random.default_rng(5)
    if kind in ((3,) if is_second else (1, 3)):
        rows = np.stack(
            [rng.integers(500, 90_000, (n_packets, n)), rng.integers(3000, 15_000, (n_packets, n)),
             rng.integers(0, 36_000, (n_packets, n)), rng.integers(0, 256, (n_packets, n))], axis=-1)  # fmt: skip
        r, zenith, around = 1e-3 * rows[..., 0], np.radians(0.01 * rows[..., 1]), np.radians(0.01 * rows[..., 2])
        flat = r * np.sin(zenith)
        xyz = np.stack([flat * np.cos(around), flat * np.sin(around), r * np.cos(zenith)], axis=-1)
    else:
        reach, unit = (3000, 1e-2) if (kind, is_second) == (2, True) else (90_000, 1e-3)
        rows = np.concatenate(
            [rng.integers(-reach, reach, (n_packets, n, 3)), rng.integers(0, 256, (n_packets, n, 1))], axis=-1
        )
        xyz = unit * rows[..., :3]
    make = made.mid360 if is_second else made.avia
    packets = [(1e-9 * step * k, make(kind, rows[k], 7_000_000_000 + step * k)) for k in range(n_packets)]
    return packets, xyz.reshape(-1, 3), rows[..., 3].ravel()


LIVOX = [(1, 96, True), (2, 96, True), (3, 96, True), (0, 100, False), (1, 100, False), (2, 96, False), (3, 96, False),
         (4, 96, False), (7, 90, False)]  # fmt: skip


@pytest.mark.parametrize(("kind", "n", "is_second"), LIVOX)
@pytest.mark.parametrize("suffix", [".pcap", ".PCAP", ".lvx"])
def test_the_points_of_a_livox_are_those_of_its_packets_a_scan_each_tenth_of_a_second(
    tmp_path, kind, n, is_second, suffix
):
    packets, xyz, intensity = livox_drive(kind, n, is_second)
    if suffix != ".lvx":
        path = send(tmp_path / f"drive{suffix}", packets)
    else:
        frames = [[raw for _, raw in packets[k : k + 125]] for k in range(0, len(packets), 125)]
        path = tmp_path / ("drive.lvx2" if is_second else "drive.lvx")
        path.write_bytes((made.lvx2 if is_second else made.lvx)(frames))
    assert find_recordings(tmp_path) == [path]
    sequence = open_sequence(path)
    assert [len(scan) for scan in sequence] == [250 * n, 250 * n]
    np.testing.assert_allclose(np.concatenate([scan.points for scan in sequence]), xyz, atol=2e-5)
    np.testing.assert_array_equal(np.concatenate([scan.intensity for scan in sequence]), intensity)
    np.testing.assert_allclose(np.diff(sequence.stamps), 0.1, atol=1e-6)
    np.testing.assert_allclose(sequence[1].time, 0.1 * np.arange(250 * n) / (250 * n), atol=1e-5)


def test_livox_files_that_are_cut_or_of_another_version_are_told(tmp_path):
    packets, *_ = livox_drive(1, 96, True, 40)
    raw = made.lvx2([[packet for _, packet in packets]])
    path = tmp_path / "drive.lvx2"
    path.write_bytes(raw[:-700])
    with pytest.raises(InputError, match=r"drive.lvx2 is cut or damaged at byte \d+ of"):
        open_sequence(path)
    path.write_bytes(raw[:16] + bytes([3]) + raw[17:])
    with pytest.raises(InputError, match=r"drive.lvx2 is no recording of Livox's viewer of version 1.1 or 2.0"):
        open_sequence(path)


def test_sensors_of_several_makers_in_a_capture_are_told_apart(tmp_path):
    hesai, *_ = drive("PandarXT-32", 1)
    livox, *_ = livox_drive(1, 96, True)
    frames = [(START + t, udp(raw, source="192.168.1.201")) for t, raw in hesai]
    frames += [(START + t, udp(raw, source="192.168.1.3", port=56300)) for t, raw in livox]
    path = write_pcap(tmp_path / "drive.pcap", sorted(frames))
    with pytest.raises(InputError, match=r"has 2 LiDARs \(192.168.1.3-56300, 192.168.1.201-2368\); give one"):
        open_sequence(path)
    assert len(open_sequence(path / "192.168.1.201-2368")[0].points) > 20_000
    assert open_sequence(path / "192.168.1.3-56300").about == {"files": "of a Livox"}


def test_packets_that_were_captured_twice_are_there_once_and_their_beginnings_are_told(tmp_path):
    packets, _, ranges = drive("PandarXT-32", 2)
    twice = send(tmp_path / "twice.pcap", [packet for packet in packets for _ in range(2)])
    assert sum(len(scan) for scan in open_sequence(twice)) == (ranges > 0).sum()
    raw = b"".join(
        struct.pack("<IIII", 1, k, 96, len(udp(packet))) + udp(packet)[:96] for k, (_, packet) in enumerate(packets)
    )
    (tmp_path / "cut.pcap").write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 96, 1) + raw)
    with pytest.raises(InputError, match=r"cut.pcap holds only the beginning of its packets"):
        open_sequence(tmp_path / "cut.pcap")


def test_packets_of_no_known_kind_are_none():
    for layout in LAYOUTS:
        assert layout_of(bytes(layout.size)) is None or layout.sensor == "Livox"
    assert layout_of(b"") is None


def test_a_pcapng_may_hold_what_is_not_of_the_internet(tmp_path):
    packets, *_ = drive("PandarXT-32", 1)
    frames = [(START + t, udp(raw)) for t, raw in packets]
    arp = b"\xff" * 6 + b"\1\2\3\4\5\6" + b"\x08\x06" + struct.pack(">HHBBH", 1, 0x800, 6, 4, 1) + bytes(20)
    six = b"\xff" * 6 + b"\1\2\3\4\5\6" + b"\x86\xdd" + b"\x60" + bytes(60)
    vlan = [(t, raw[:12] + b"\x81\x00\x00\x05" + raw[12:]) for t, raw in frames]
    noise = [(START + 0.01 * k, arp if k % 2 else six) for k in range(10)]
    plain = open_sequence(write_pcapng(tmp_path / "plain.pcapng", frames))
    for name, written in (("noise", sorted([*frames, *noise])), ("vlan", vlan)):
        found = open_sequence(write_pcapng(tmp_path / f"{name}.pcapng", written))
        np.testing.assert_array_equal(found[0].points, plain[0].points)


def test_a_capture_is_walked_once_for_all_kinds_and_once_for_those_it_may_hold(tmp_path, monkeypatch):
    packets, *_ = drive("PandarXT-32")
    capture, walked, walk = open_capture(send(tmp_path / "drive.pcap", packets)), [], Capture._walked
    monkeypatch.setattr(Capture, "_walked", lambda self, *given: walked.append(given) or walk(self, *given))
    assert [layout.sensor for layout in kinds_in(capture)] == ["PandarXT-32"]
    assert len(walked) == 2 < len(LAYOUTS)


@pytest.mark.parametrize("n_bytes", [1262, 5000, 20_001])
def test_where_the_search_for_calibration_ends_within_a_packet_the_capture_is_whole(tmp_path, monkeypatch, n_bytes):
    monkeypatch.setattr("automos.readers.packets.sequence._TOLD_WITHIN", (0, n_bytes))
    packets, *_ = drive("PandarXT-32")
    assert sum(len(scan) > 0 for scan in open_sequence(send(tmp_path / "drive.pcap", packets))) == 3
