"""The loop and the feeds, with a labeler that does as it is told."""

import signal
import socket
import threading
import time
from collections import deque
from dataclasses import dataclass, field

import numpy as np
import pytest

from automos.core.array_sequence import ArraySequence
from automos.core.errors import InputError
from automos.core.parallel import one_ahead
from automos.core.scan import Scan
from automos.labeler import LabelledScan
from automos.live.feed import ROOM, Feed, Latest, Replay
from automos.live.opening import VelodyneAssembler, open_feed
from automos.live.run import Tally, run_live
from automos.live.udp import UdpFeed, parse_address


@dataclass
class Given:
    index: int
    stamp: float = 0.0
    pose: np.ndarray = field(default_factory=lambda: np.eye(4))
    labels: np.ndarray = field(default_factory=lambda: np.array([9, 251], np.uint8))
    track_ids: np.ndarray = field(default_factory=lambda: np.array([-1, 4]))
    confidence: np.ndarray = field(default_factory=lambda: np.ones(2))
    objects: np.ndarray = field(default_factory=lambda: np.zeros(0))


class Slow:
    """Takes its time, and gives every scan back `late` scans later."""

    def __init__(self, seconds: float = 0.0, late: int = 0):
        self.seconds, self.late, self.n, self.kept = seconds, late, 0, []

    def push(self, scan: Scan) -> list[Given]:
        time.sleep(self.seconds)
        self.kept.append(Given(self.n))
        self.n += 1
        n = max(len(self.kept) - self.late, 0)
        done, self.kept = self.kept[:n], self.kept[n:]
        return done

    def push_each(self, scans):
        for scan in one_ahead(lambda scan: scan, scans, lambda scan: False):
            yield self.push(scan)

    def finish(self) -> list[Given]:
        done, self.kept = self.kept, []
        return done


def recording(n: int, step: float = 0.1) -> ArraySequence:
    return ArraySequence([np.full((2, 3), i + 1.0) for i in range(n)], step * np.arange(n))


def collect(seen: list) -> object:
    return lambda scan, given: seen.append((scan.name, given.index))


@pytest.mark.parametrize("late", [0, 3])
def test_every_scan_reaches_every_sink_in_order(late):
    seen, names = [], []
    tally = run_live(Replay(recording(8), speed=0), Slow(late=late), [collect(seen)], names)
    assert seen == [(f"{i:06d}", i) for i in range(8)]
    assert names == [name for name, _ in seen]
    assert (tally.labelled, tally.left_out, tally.points, tally.moving) == (8, 0, 16, 8)


def test_a_replay_keeps_the_recordings_pace():
    begin = time.monotonic()
    tally = run_live(Replay(recording(6), speed=2.0), Slow(), [])
    assert time.monotonic() - begin > 5 * 0.1 / 2.0
    assert (tally.labelled, tally.left_out) == (6, 0)


def test_a_replay_waits_for_who_is_slower_and_leaves_nothing_out():
    seen = []
    tally = run_live(Replay(recording(20, 0.001)), Slow(0.01), [collect(seen)])
    assert (tally.labelled, tally.left_out) == (20, 0)
    assert [index for _, index in seen] == list(range(20))


class Sensor(Feed):
    """Sends forty scans, a hundred a second, whoever takes them."""

    def receive(self):
        for i in range(40):
            time.sleep(0.01)
            self.latest.put(Scan(np.full((2, 3), i + 1.0), name=f"{i:06d}"))


def test_what_is_too_much_of_a_sensor_is_left_out_counted_and_said(caplog):
    seen = []
    tally = run_live(Sensor(), Slow(0.05), [collect(seen)])
    assert tally.left_out > 10
    assert tally.labelled + tally.left_out == 40
    assert [index for _, index in seen] == list(range(tally.labelled))
    assert [name for name, _ in seen] == sorted({name for name, _ in seen})  # later ones only, none twice
    assert "too slow" in caplog.text
    assert "scans were left out so far" in caplog.text


def test_the_room_for_scans_holds_the_latest_in_order():
    latest = Latest()
    for i in range(1000):
        latest.put(Scan(np.full((1, 3), float(i), np.float32)))
    assert latest.left_out == 1000 - ROOM
    assert [latest.take(0.0).points[0, 0] for _ in range(ROOM)] == list(range(1000 - ROOM, 1000))
    assert latest.take(0.0) is None
    assert not latest.is_over
    latest.close()
    assert latest.is_over


def test_a_push_that_takes_longer_than_a_period_leaves_none_out():
    latest, one = Latest(), Scan(np.ones((1, 3), np.float32))
    latest.put(one)
    for _ in range(5):  # one is labelled while the next two come, twice as slowly as usual
        assert latest.take(0.0) is one
        latest.put(one)
        latest.put(one)
        assert latest.take(0.0) is one
    assert latest.left_out == 0


def test_who_waits_to_put_a_scan_in_when_it_closes_leaves_none_out():
    latest, one = Latest(), Scan(np.ones((1, 3), np.float32))
    for _ in range(ROOM):
        latest.put(one)
    waiting = threading.Thread(target=latest.put, args=(one, True))
    waiting.start()
    time.sleep(0.05)
    latest.close()
    waiting.join(5.0)
    assert (latest.offered, latest.left_out) == (ROOM, 0)
    assert all(latest.take(0.0) is one for _ in range(ROOM))
    assert latest.is_over


def test_ctrl_c_gives_back_what_was_pushed_and_tells():
    class Interrupted(Slow):
        def push(self, scan):
            if self.n == 5:
                raise KeyboardInterrupt
            return super().push(scan)

    seen = []
    tally = run_live(Replay(recording(100), speed=0), Interrupted(late=2), [collect(seen)])
    assert [index for _, index in seen] == [0, 1, 2, 3, 4]
    assert "5 scans labelled, 0 left out" in tally.sentence("street")
    assert not [t for t in threading.enumerate() if t.name == "automos-live"]


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="this system has no signals of its own")
def test_ctrl_c_in_the_middle_of_a_sink_waits_for_it_and_the_rest_is_given_back():
    begun, ended = [], []

    def sink(scan, given):
        begun.append((scan.name, given.index))
        if given.index == 4:
            signal.raise_signal(signal.SIGINT)
        ended.append((scan.name, given.index))

    tally = run_live(Replay(recording(100), speed=0), Slow(late=2), [sink])
    assert begun == ended == [(f"{i:06d}", i) for i in range(tally.labelled)]
    assert 7 <= tally.labelled < 100  # those of the lag, too


@pytest.mark.parametrize("error", [InputError("the cable is cut"), KeyError("the cable is cut")])
def test_what_stops_the_feed_is_told_after_what_was_pushed_is_given_back(error):
    class Broken(Feed):
        def receive(self):
            self.latest.put(Scan(np.ones((2, 3), np.float32)), wait=True)
            raise error

    seen = []
    with pytest.raises(InputError, match="the cable is cut"):
        run_live(Broken(), Slow(late=1), [collect(seen)])
    assert [index for _, index in seen] == [0]


# --------------------------------------------------------------------------------------------------------- addresses
def test_an_address_without_a_host_is_this_machine():
    assert parse_address("udp://:2368") == ("127.0.0.1", 2368)
    assert parse_address("udp://10.0.0.5:2368/") == ("10.0.0.5", 2368)


@pytest.mark.parametrize("text", ["udp://127.0.0.1", "tcp://127.0.0.1:80", "udp://127.0.0.1:99999", "udp://a:1/b"])
def test_what_is_no_address_is_told(text):
    with pytest.raises(InputError, match=r"is not an address: write udp://127.0.0.1:2368"):
        parse_address(text)


@pytest.mark.parametrize(("sensor", "said"), [(None, "--sensor velodyne or"), ("livox", "ouster, not livox")])
def test_a_sensor_that_is_not_known_is_told(sensor, said):
    with pytest.raises(InputError, match=said):
        open_feed("udp://127.0.0.1:0", sensor)


def test_an_ouster_without_metadata_is_told():
    with pytest.raises(InputError, match="need its metadata"):
        open_feed("udp://127.0.0.1:0", "ouster")


@pytest.mark.parametrize("speed", [float("nan"), float("inf"), -1.0])
def test_a_speed_that_no_replay_can_keep_is_refused(speed):
    with pytest.raises(InputError, match=f"speed is {speed:g}: give how many times as fast"):
        Replay(recording(2), speed)


@pytest.mark.parametrize("patience", [float("nan"), float("inf"), 0.0])
def test_a_timeout_that_never_ends_is_refused(patience):
    with pytest.raises(InputError, match=f"a timeout of {patience:g} s .*: give some seconds"):
        UdpFeed("127.0.0.1", 0, VelodyneAssembler(), patience)


def test_a_port_in_use_is_told():
    first = UdpFeed("127.0.0.1", 0, VelodyneAssembler())
    said = rf"udp://127.0.0.1:{first.port} cannot be listened at .*in use"
    with first, pytest.raises(InputError, match=said):
        UdpFeed("127.0.0.1", first.port, VelodyneAssembler())


def test_an_address_of_another_machine_is_told():
    with pytest.raises(InputError, match=r"udp://203.0.113.7:2368 cannot be listened at"):
        UdpFeed("203.0.113.7", 2368, VelodyneAssembler())


# ----------------------------------------------------------------------------------------------------------- packets
def run_in_background(feed, labeler, sinks):
    box = {}

    def run():
        try:
            box["tally"] = run_live(feed, labeler, sinks)
        except InputError as error:
            box["error"] = error

    thread = threading.Thread(target=run)
    thread.start()
    return thread, box


def send_all(port, payloads, pause=0.0005):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for payload in payloads:
            out.sendto(payload, ("127.0.0.1", port))
            time.sleep(pause)


def test_packets_over_loopback_become_scans(packets):
    pytest.importorskip("velodyne_decoder")
    feed, points = UdpFeed("127.0.0.1", 0, VelodyneAssembler(), patience=1.0), []
    thread, box = run_in_background(feed, Slow(), [lambda scan, given: points.append(len(scan))])
    send_all(feed.port, [payload for _, payload in packets])
    thread.join(30)
    assert box["tally"].labelled + box["tally"].left_out >= 6
    assert min(points[1:-1]) > 10_000
    assert feed.summary() == ""


def test_a_packet_is_looked_at_when_it_comes(packets):
    with UdpFeed("127.0.0.1", 0, VelodyneAssembler()) as feed, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        begin = time.monotonic()
        for n, (_, payload) in enumerate(packets[:20], 1):
            out.sendto(payload, ("127.0.0.1", feed.port))
            while feed.n_packets < n:
                time.sleep(0.0002)
        assert time.monotonic() - begin < 20 * 0.05  # not each of them after a wait for more


def test_foreign_packets_are_told_once_and_counted(packets, caplog):
    pytest.importorskip("velodyne_decoder")
    feed = UdpFeed("127.0.0.1", 0, VelodyneAssembler(), patience=1.0)
    thread, box = run_in_background(feed, Slow(), [])
    send_all(feed.port, [x for _, payload in packets for x in (payload, b"\0" * 512, b"")], 0.0002)
    thread.join(30)
    assert box["tally"].labelled + box["tally"].left_out >= 6
    assert caplog.text.count("they are left out") == 1
    assert f"{2 * len(packets):,} of {3 * len(packets):,} packets were not the sensor's" in feed.summary()


def test_whoever_sent_the_last_of_what_waited_is_not_taken_for_the_sensor():
    class Assembler:
        kind = "Velodyne"

        def add(self, payloads, seconds):
            own = [payload for payload in payloads if payload.startswith(b"own")]
            return [Scan(np.ones((2, 3), np.float32), name=payload.decode()) for payload in own], len(payloads) - len(
                own
            )

        def rest(self):
            return []

    batches = [
        [(b"?", 0.0, "b"), (b"own 1", 0.0, "a"), (b"own too", 0.0, "c"), (b"?", 0.0, "b")],
        [(b"own 2", 0.1, "a")],
    ]
    feed, names = UdpFeed("127.0.0.1", 0, Assembler(), patience=0.2), []
    feed._packets = lambda: batches.pop(0) if batches else time.sleep(0.05) or []
    feed.latest.put = lambda scan: names.append(scan.name)
    with feed:
        while not feed.is_over:
            time.sleep(0.05)
    assert names == ["own 1", "own 2"]
    assert (feed.n_packets, feed.n_foreign) == (2, 3)


def test_no_packets_are_told():
    feed = UdpFeed("127.0.0.1", 0, VelodyneAssembler(), patience=0.3)
    with pytest.raises(InputError, match=r"no packets of a Velodyne came to udp://127.0.0.1:0 for 0.3 s; look at"):
        run_live(feed, Slow(), [])


def test_packets_of_another_maker_alone_are_told():
    feed = UdpFeed("127.0.0.1", 0, VelodyneAssembler(), patience=0.5)
    thread, box = run_in_background(feed, Slow(), [])
    send_all(feed.port, [b"\1" * 3392] * 50)
    thread.join(30)
    assert "but 50 of another kind or sensor did; is --sensor right?" in str(box["error"])


def test_packets_of_a_model_that_nobody_knows_are_told(packets):
    pytest.importorskip("velodyne_decoder")
    feed = UdpFeed("127.0.0.1", 0, VelodyneAssembler(), patience=2.0)
    thread, box = run_in_background(feed, Slow(), [])
    send_all(feed.port, [payload[:-1] + b"\x99" for _, payload in packets])
    thread.join(30)
    assert "what comes cannot be decoded as packets of a Velodyne" in str(box["error"])


def test_a_line_says_scans_a_second_lag_movers_and_what_was_dropped():
    tally = Tally(labelled=3, left_out=1, movers=2, ages=deque([(10.0, 0.3), (10.1, 0.3), (10.2, 0.25)]))
    assert tally.line() == "10.0 scans/s, lag 0.25 s, 2 moving, 1 of 4 dropped"  # two scans in 0.2 s


def test_the_lag_is_from_when_a_scan_was_taken_until_its_labels_are_given_back(monkeypatch):
    clock = [5.0]
    monkeypatch.setattr("automos.live.run.time.perf_counter", lambda: clock[0])
    tally, given = Tally(), LabelledScan.of_nothing(0, 0.0, np.eye(4), 7)
    tally.add(given, taken_at=4.6)
    assert tally.ages[-1] == pytest.approx((5.0, 0.4))
    assert (tally.labelled, tally.points, tally.movers) == (1, 7, 0)
