import pickle
import struct
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from typer.testing import CliRunner
from velodyne_packets import (
    CYCLE,
    ELEVATIONS,
    HDL64_ELEVATIONS,
    data_packets,
    firings,
    hdl64e_packets,
    to_points,
    udp,
    write_pcap,
    write_pcapng,
)
from worlds import ROADSIDE, SENSOR_HEIGHT, TRAFFIC, cast, iou_of_moving

from automos.cli import app
from automos.core.errors import InputError, MissingExtraError
from automos.core.labels import Label
from automos.readers import find_recordings, load_format, open_sequence
from automos.readers.packets.sequence import PacketSequence

decoder = pytest.importorskip("velodyne_decoder")

HOUR = 3600.0 * 444_444
"""Seconds since 1970 of a full hour."""
TURN = 0.1 / (24 * CYCLE)
"""Packets of a turn: 75 and a bit."""


def room(n_packets, first_azimuth=30.0, second=False):
    """Return ranges, reflectivities and azimuths (n, 16) of a sensor in a room whose walls are 8 and 30 m away."""
    n = (12 if second else 24) * n_packets
    azimuth, _ = firings(n, first_azimuth)
    rays = to_points(np.ones_like(azimuth), azimuth)
    with np.errstate(divide="ignore"):
        walls = np.array([8.0, 30.0, 3.0]) / np.abs(rays)
    distance = 0.002 * np.round(walls.min(axis=-1) / 0.002)
    distance[(rays[..., 2] > 0.2) & (rays[..., 0] > 0.5)] = 0.0  # a window in the roof
    return distance, np.arange(n * 16).reshape(n, 16) % 256, azimuth


def capture(path, packets, start=HOUR, noise=(), **options):
    """Write packets as they arrive 20 ms after they were sent, with other traffic; return the path."""
    frames = [(start + 0.02 + seconds, udp(packet)) for seconds, packet in packets]
    return write_pcap(path, sorted([*frames, *noise]), **options)


def with_clock(packet, seconds):
    """Return the packet sent `seconds` after the hour."""
    return packet[:1200] + struct.pack("<I", round(1e6 * seconds)) + packet[1204:]


def assert_same_returns(sequence, distance, reflectivity, azimuth):
    """Assert that the scans in order hold all returns and nothing else, in the order of firing."""
    is_return = distance > 0
    points = np.concatenate([scan.points for scan in sequence])
    assert len(points) == is_return.sum()
    # half of 2 mm of range, and the table of azimuths in steps of 0.01 degrees (at 31 m, 5 mm)
    np.testing.assert_allclose(points, to_points(distance, azimuth)[is_return], atol=0.012)
    np.testing.assert_array_equal(np.concatenate([scan.intensity for scan in sequence]), reflectivity[is_return])
    ring = np.broadcast_to(np.argsort(np.argsort(ELEVATIONS)), distance.shape)  # from the lowest beam up
    np.testing.assert_array_equal(np.concatenate([scan.ring for scan in sequence]), ring[is_return])


def test_every_return_is_read_once_in_the_order_of_firing_with_its_time(tmp_path):
    distance, reflectivity, azimuth = room(n_packets=400)
    path = capture(tmp_path / "drive.pcap", data_packets(distance, reflectivity, azimuth, start=100.0))
    sequence = open_sequence(path)
    assert (sequence.name, len(sequence), sequence.is_compensated) == ("drive", 6, False)
    assert_same_returns(sequence, distance, reflectivity, azimuth)
    _, fired = firings(len(distance))
    times = np.concatenate([scan.stamp + scan.time.astype(np.float64) for scan in sequence])
    np.testing.assert_allclose(times, HOUR + 100.02 + fired[distance > 0], atol=2e-6)


def test_all_sweeps_but_the_last_are_whole(tmp_path):
    distance, reflectivity, azimuth = room(n_packets=400, first_azimuth=200.0)
    sequence = open_sequence(capture(tmp_path / "drive.pcap", data_packets(distance, reflectivity, azimuth)))
    np.testing.assert_allclose(np.diff(sequence.stamps), 0.1, atol=24 * CYCLE)
    for scan in list(sequence)[:-1]:
        turned = (np.degrees(np.arctan2(-scan.points[:, 1], scan.points[:, 0])) - 200.0) % 360.0
        assert turned[0] < 5.0
        assert turned[-1] > 355.0 or turned[-1] < 5.0
        assert scan.time[-1] == pytest.approx(0.1, abs=24 * CYCLE)


def test_a_sweep_is_the_same_alone_in_a_thread_and_in_another_process(tmp_path):
    path = capture(tmp_path / "drive.pcap", data_packets(*room(n_packets=400)))
    sequence = open_sequence(path)
    in_order = [scan.points for scan in sequence]
    copy = pickle.loads(pickle.dumps(sequence))
    np.testing.assert_array_equal(copy[-2].points, in_order[-2])
    with ThreadPoolExecutor(2) as pool:
        for got, points in zip(pool.map(copy.__getitem__, range(len(copy))), in_order, strict=True):
            np.testing.assert_array_equal(got.points, points)
    with pytest.raises(IndexError):
        sequence[len(sequence)]


def test_what_is_kept_of_a_capture_does_not_grow_with_its_packets(tmp_path):
    few = open_sequence(capture(tmp_path / "few.pcap", data_packets(*room(n_packets=100))))
    many = open_sequence(capture(tmp_path / "many.pcap", data_packets(*room(n_packets=1000))))
    n_more = len(many) - len(few)
    assert n_more > 10
    assert len(pickle.dumps(many)) - len(pickle.dumps(few)) < 32 * n_more


@pytest.mark.parametrize("n_bytes", [1300, 5000, 90_001])
def test_a_capture_may_be_read_in_pieces_of_any_size(tmp_path, monkeypatch, n_bytes):
    returns = room(n_packets=250)
    path = capture(tmp_path / "drive.pcap", data_packets(*returns))
    whole = open_sequence(path)
    monkeypatch.setattr("automos.readers.packets.pcap._PIECE", n_bytes)
    pieces = open_sequence(path)
    np.testing.assert_array_equal(pieces.stamps, whole.stamps)
    assert_same_returns(pieces, *returns)


@pytest.mark.parametrize("options", [{"order": ">"}, {"nano": True}, {"nano": True, "order": ">"}])
def test_captures_may_be_of_either_byte_order_and_count_nanoseconds(tmp_path, options):
    returns = room(n_packets=100)
    sequence = open_sequence(capture(tmp_path / "drive.pcap", data_packets(*returns), **options))
    assert_same_returns(sequence, *returns)
    assert sequence.stamps[0] == pytest.approx(HOUR + 0.02, abs=1e-6)


@pytest.mark.parametrize(
    ("link", "wrap"),
    [
        (101, lambda frame: frame[14:]),
        (0, lambda frame: b"\x02\0\0\0" + frame[14:]),
        (113, lambda frame: bytes(14) + frame[12:]),
        (276, lambda frame: bytes(20) + frame[14:]),
        (1, lambda frame: frame[:12] + b"\x81\x00\x00\x05" + frame[12:]),
    ],
    ids=["raw IP", "loopback", "cooked", "cooked 2", "virtual LAN"],
)
def test_captures_may_be_of_other_links_than_ethernet(tmp_path, link, wrap):
    returns = room(n_packets=20)
    frames = [(HOUR + seconds, wrap(udp(packet))) for seconds, packet in data_packets(*returns)]
    assert_same_returns(open_sequence(write_pcap(tmp_path / "drive.pcap", frames, link=link)), *returns)


def test_other_traffic_is_passed_over(tmp_path):
    returns = room(n_packets=150)
    telemetry = [(HOUR + 0.01 * k, udp(bytes(512), port=8308)) for k in range(12)]
    alike = [(HOUR + 0.005, udp(bytes(1206), port=5000)), (HOUR + 0.006, b"\xff" * 12 + b"\x08\x06" + bytes(46))]
    path = capture(tmp_path / "drive.pcap", data_packets(*returns), noise=[*telemetry, *alike])
    assert_same_returns(open_sequence(path), *returns)


def test_both_returns_are_kept_where_they_differ(tmp_path):
    strongest, reflectivity, azimuth = room(n_packets=300, second=True)
    last, weaker = strongest.copy(), reflectivity.copy()
    behind = (strongest > 0) & (np.arange(16) % 3 == 0)
    last[behind] += 2.0
    weaker[behind] = 7
    packets = data_packets(strongest, reflectivity, azimuth, second=(last, weaker))
    scans = list(open_sequence(capture(tmp_path / "dual.pcap", packets)))
    points = np.concatenate([scan.points for scan in scans])
    assert len(points) == (strongest > 0).sum() + behind.sum()
    assert np.concatenate([np.diff(scan.time) for scan in scans]).min() >= 0.0
    got = np.linalg.norm(points, axis=1)
    expected = np.concatenate([strongest[strongest > 0], last[behind]])
    np.testing.assert_allclose(np.sort(got), np.sort(expected), atol=0.012)


def test_an_hdl_64e_is_read_by_the_calibration_that_its_packets_tell(tmp_path):
    azimuth = 0.17 * np.arange(6 * 4200)
    distance = np.random.default_rng(0).integers(2000, 30000, (len(azimuth), 64)) * 0.002
    distance[np.random.default_rng(1).random(distance.shape) < 0.05] = 0.0
    packets = hdl64e_packets(distance, azimuth)
    scans = list(open_sequence(capture(tmp_path / "drive.pcap", packets)))
    points = np.concatenate([scan.points for scan in scans])
    assert len(points) == (distance > 0).sum()
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), distance[distance > 0], atol=0.001)
    beam = np.broadcast_to(np.arange(64), distance.shape)[distance > 0]
    elevation = np.degrees(np.arcsin(points[:, 2] / distance[distance > 0]))
    np.testing.assert_allclose(elevation, HDL64_ELEVATIONS[beam], atol=0.01)
    np.testing.assert_array_equal(np.concatenate([scan.ring for scan in scans]), 63 - beam)  # from the lowest up
    before = np.repeat(azimuth[:, None], 64, axis=1)[distance > 0]
    turned = (np.degrees(np.arctan2(-points[:, 1], points[:, 0])) - before + 180.0) % 360.0 - 180.0
    assert turned.min() > -0.011  # azimuths count hundredths of a degree
    assert turned.max() < 0.18  # the sensor turns on while a block of beams is fired

    cut = tmp_path / "short.pcap"
    with pytest.raises(InputError, match=r"short.pcap cannot be decoded .*\(Not enough metadata bytes"):
        open_sequence(capture(cut, packets[:1000]))


def test_the_clock_may_pass_the_full_hour_within_a_sweep(tmp_path):
    returns = room(n_packets=200)
    sequence = open_sequence(capture(tmp_path / "drive.pcap", data_packets(*returns, start=3599.83), start=HOUR))
    np.testing.assert_allclose(sequence.stamps, HOUR + 3599.85 + 0.1 * np.arange(len(sequence)), atol=0.005)
    assert all(scan.time.min() >= 0.0 and scan.time.max() < 0.11 for scan in sequence)
    assert_same_returns(sequence, *returns)


def test_packets_that_were_lost_or_overtaken_make_no_further_sweeps(tmp_path):
    packets = data_packets(*room(n_packets=400))
    frames = [(HOUR + seconds, udp(packet)) for seconds, packet in packets]
    lost = write_pcap(tmp_path / "lost.pcap", [frame for k, frame in enumerate(frames) if k not in range(70, 80)])
    assert len(open_sequence(lost)) == 6
    for k in (40, int(TURN), int(TURN) + 1):
        swapped = [*frames[:k], frames[k + 1], frames[k], *frames[k + 2 :]]
        assert len(open_sequence(write_pcap(tmp_path / f"overtaken_{k}.pcap", swapped))) == 6


def test_a_pause_ends_a_sweep(tmp_path):
    packets = data_packets(*room(n_packets=60))  # less than one turn
    later = [(seconds + 5400.0, with_clock(packet, seconds + 1800.0)) for seconds, packet in packets]
    sequence = open_sequence(capture(tmp_path / "drive.pcap", [*packets, *later]))
    np.testing.assert_allclose(np.diff(sequence.stamps), [5400.0], atol=0.001)


def test_of_several_sensors_one_is_named(tmp_path):
    returns = room(n_packets=100)
    packets = data_packets(*returns)
    frames = [(HOUR + 0.0001 + seconds, udp(packet)) for seconds, packet in packets[:50]]
    frames += [(HOUR + seconds, udp(packet, "192.168.1.202", 2369)) for seconds, packet in packets]
    path = write_pcap(tmp_path / "drive.pcap", sorted(frames))
    listed = r"192.168.1.201-2368, 192.168.1.202-2369"
    with pytest.raises(InputError, match=rf"2 Velodynes \({listed}\); give one, as .*pcap/192.168.1.201-2368"):
        open_sequence(path)
    sequence = open_sequence(path / "192.168.1.202-2369")
    assert_same_returns(sequence, *returns)
    assert sequence.name == "drive_192.168.1.202-2369"
    assert open_sequence(sequence.address).fingerprint() == sequence.fingerprint()
    assert sequence.fingerprint() != open_sequence(path / "192.168.1.201-2368").fingerprint()
    with pytest.raises(InputError, match=r"has no Velodyne 10.0.0.1-1; it has: 192.168.1.201-2368, 192"):
        open_sequence(path / "10.0.0.1-1")


def test_whose_packets_a_capture_holds_is_told_by_them_not_by_its_name(tmp_path):
    velodyne = capture(tmp_path / "a.pcap", data_packets(*room(n_packets=10)))
    other = write_pcap(tmp_path / "b.pcap", [(HOUR, udp(bytes(3392), port=7502))])
    assert find_recordings(tmp_path) == [velodyne]
    assert load_format("packets").find(other) == []
    with pytest.raises(InputError, match=r"b.pcap has no metadata b.json beside it, .* no packets of a known Velodyne"):
        open_sequence(other)
    with pytest.raises(InputError, match=r"b.pcap is not a recording of format 'packets' \(packets: .pcap"):
        open_sequence(other, "velodyne")
    with pytest.raises(InputError, match=r"b.pcap holds no packets of a known sensor; give another file"):
        PacketSequence(other)
    with pytest.raises(InputError, match=r"a.pcap has no metadata a.json beside it"):
        open_sequence(velodyne, "ouster")


def test_a_capture_that_is_cut_short_is_told(tmp_path):
    path = capture(tmp_path / "drive.pcap", data_packets(*room(n_packets=20)))
    whole = path.read_bytes()
    for size in (len(whole) - 1, len(whole) - 1250, len(whole) - 1256):
        path.write_bytes(whole[:size])
        with pytest.raises(
            InputError, match=r"drive.pcap ends within a packet .* editcap -F pcap drive.pcap whole.pcap"
        ):
            open_sequence(path)
    path.write_bytes(whole[: -(len(whole) - 24) // 20])  # a whole packet less is not damage
    assert len(open_sequence(path)) == 1


def test_a_capture_of_the_beginnings_of_packets_is_told(tmp_path):
    frames = [(HOUR + seconds, udp(packet)[:96]) for seconds, packet in data_packets(*room(n_packets=4))]
    full = [(HOUR - 1.0, udp(data_packets(*room(n_packets=1))[0][1]))]
    path = write_pcap(tmp_path / "drive.pcap", [*full, *frames])
    with pytest.raises(InputError, match=r"drive.pcap holds only the beginning of its packets .* tcpdump -s 0"):
        open_sequence(path)


def test_fragments_are_told(tmp_path):
    (frame,) = [udp(packet) for _, packet in data_packets(*room(n_packets=1))]
    datagram = frame[34:]
    heads = [bytearray(frame[14:34]), bytearray(frame[14:34])]
    parts = [datagram[:600], datagram[600:]]
    for head, part, flags in zip(heads, parts, (0x2000, 600 // 8), strict=True):
        struct.pack_into(">H", head, 2, 20 + len(part))
        struct.pack_into(">H", head, 6, flags)
    full = (HOUR - 1.0, frame)
    sent = [(HOUR, frame[:14] + bytes(head) + part) for head, part in zip(heads, parts, strict=True)]
    with pytest.raises(InputError, match=r"the beginning of its packets .* sent in fragments; .* MTU above their size"):
        open_sequence(write_pcap(tmp_path / "drive.pcap", [full, *sent]))


def test_a_capture_that_goes_on_in_another_is_told(tmp_path):
    packets = data_packets(*room(n_packets=900))
    for name, part in (("a_1", packets[:450]), ("a_2", packets[450:]), ("other", [])):
        capture(tmp_path / f"{name}.pcap", part)
    first, second = (open_sequence(tmp_path / f"a_{k}.pcap") for k in (1, 2))
    assert [said for said in first.warnings if "a_2.pcap goes on where it ends" in said and "mergecap -a" in said]
    assert not [said for said in second.warnings if "goes on" in said]


def test_a_capture_of_another_kind_is_told(tmp_path):
    path = tmp_path / "drive.pcap"
    path.write_bytes(b"no packets at all, but text")
    with pytest.raises(InputError, match=r"drive.pcap is not a capture of packets"):
        PacketSequence(path)
    write_pcap(path, [], link=105)
    with pytest.raises(InputError, match=r"drive.pcap was captured on a link of type 105, which is not read"):
        PacketSequence(path)


@pytest.mark.parametrize(("order", "resolution"), [("<", 6), (">", 6), ("<", 9), ("<", 128 | 20)])
def test_a_capture_of_wiresharks_own_kind_is_read_as_the_classic_one(tmp_path, order, resolution):
    returns = room(n_packets=200)
    frames = [(HOUR + 0.02 + seconds, udp(packet)) for seconds, packet in data_packets(*returns)]
    path = write_pcapng(tmp_path / "drive.pcapng", frames, order, resolution)
    assert find_recordings(tmp_path) == [path]
    sequence, classic = open_sequence(path), open_sequence(write_pcap(tmp_path / "classic.pcap", frames))
    assert_same_returns(sequence, *returns)
    np.testing.assert_allclose(sequence.stamps, classic.stamps, atol=2e-6)
    for got, true in zip(sequence, classic, strict=True):
        np.testing.assert_array_equal(got.points, true.points)
        np.testing.assert_array_equal(got.time, true.time)


def test_a_capture_of_wiresharks_kind_that_is_cut_empty_or_damaged_is_told(tmp_path):
    frames = [(HOUR + seconds, udp(packet)) for seconds, packet in data_packets(*room(n_packets=4))]
    path = write_pcapng(tmp_path / "drive.pcapng", frames)
    whole = path.read_bytes()
    path.write_bytes(whole[:-40])
    with pytest.raises(InputError, match=r"drive.pcapng ends within a packet .* editcap -F pcap drive.pcapng whole"):
        open_sequence(path)
    damaged = bytearray(whole)
    damaged[-4000:-3996] = bytes(4)
    for at in range(0, len(whole) - 8, 4):  # a block of no length is no endless loop
        if whole[at : at + 4] == b"\x06\0\0\0":
            path.write_bytes(whole[: at + 4] + bytes(4) + whole[at + 8 :])
    with pytest.raises(InputError, match=r"drive.pcapng ends within a packet"):
        PacketSequence(path)
    write_pcapng(path, [])
    with pytest.raises(
        InputError, match=r"drive.pcapng has no metadata drive.json beside it, .* no packets of a known Velo"
    ):
        open_sequence(path)
    write_pcapng(path, frames, link=105)
    with pytest.raises(InputError, match=r"drive.pcapng holds no packets of a known sensor"):
        PacketSequence(path)


def test_clocks_that_run_backwards_are_told(tmp_path):
    packets = data_packets(*room(n_packets=160))
    backwards = [(seconds, with_clock(packet, 5.0 - seconds)) for seconds, packet in packets]
    with pytest.raises(InputError, match=r"scan 00000\d at .* is not after the one before it"):
        open_sequence(capture(tmp_path / "drive.pcap", backwards))


def test_packets_of_an_unknown_model_are_told(tmp_path):
    path = capture(tmp_path / "drive.pcap", data_packets(*room(n_packets=10), model=0x99))
    with pytest.raises(InputError, match=r"drive.pcap cannot be decoded as packets of a Velodyne \(.*153\)"):
        open_sequence(path)


def test_a_sweep_without_returns_is_an_empty_scan(tmp_path):
    distance, reflectivity, azimuth = room(n_packets=160)
    distance[: 80 * 24] = 0.0
    scan = open_sequence(capture(tmp_path / "drive.pcap", data_packets(distance, reflectivity, azimuth)))[0]
    assert scan.points.shape == (0, 3)


def test_without_the_extra_the_command_to_install_it_is_named(tmp_path, monkeypatch):
    path = capture(tmp_path / "drive.pcap", data_packets(*room(n_packets=10)))
    monkeypatch.setitem(__import__("sys").modules, "velodyne_decoder", None)
    assert load_format("packets").find(path) == [path]
    with pytest.raises(MissingExtraError, match=r"pip install '.*\[velodyne\]'"):
        open_sequence(path)


def test_a_street_is_labelled_from_its_packets(tmp_path):
    blocks = (*ROADSIDE, *TRAFFIC)
    azimuth, fired = firings(24 * round(12 * TURN))
    rays = to_points(np.ones_like(azimuth), azimuth)
    distance, hit = np.zeros(azimuth.shape), np.zeros(azimuth.shape, int)
    for k in range(0, len(azimuth), 24):  # the sensor drives 1 m/s, and rests while a packet fills, a millisecond
        here, seconds = np.array([fired[k, 0], 0.0, SENSOR_HEIGHT]), fired[k, 0]
        found, block = cast(blocks, here, rays[k : k + 24].reshape(-1, 3), seconds)
        distance[k : k + 24] = np.where(found < 100.0, found, 0.0).reshape(-1, 16)
        hit[k : k + 24] = block.reshape(-1, 16)
    path = capture(tmp_path / "drive.pcap", data_packets(distance, np.full(hit.shape, 9), azimuth))

    run = CliRunner().invoke(app, ["label", str(path), "--out", str(tmp_path / "run"), "--workers", "1"])
    assert run.exit_code == 0, run.output
    labels = [np.fromfile(file, np.uint32) & 0xFFFF for file in sorted((tmp_path / "run" / "predictions").iterdir())]
    assert [len(part) for part in labels] == [len(scan) for scan in open_sequence(path)]
    is_moving = np.array([any(block.velocity) for block in blocks] + [False])  # the last entry is the ground
    truth = np.where(is_moving[hit], Label.MOVING, Label.STATIC)[distance > 0]
    assert iou_of_moving([np.concatenate(labels)], [truth]) > 0.85
