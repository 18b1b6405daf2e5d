"""automos live as a user runs it: replayed packets over loopback, and the labels of automos segment."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("velodyne_decoder", reason="packets need velodyne-decoder: pip install '.[velodyne]'")
sys.path[:0] = [str(Path(__file__).parents[1] / "live"), str(Path(__file__).parents[1] / "readers")]

from room_packets import room_packets  # noqa: E402
from velodyne_packets import udp, write_pcap  # noqa: E402

from automos.labeler import Labeler  # noqa: E402
from automos.live.message import Sender, decode  # noqa: E402
from automos.live.opening import VelodyneAssembler  # noqa: E402
from automos.live.run import run_live  # noqa: E402
from automos.live.segment import results_writer, segment_recording  # noqa: E402
from automos.live.udp import UdpFeed  # noqa: E402
from automos.readers import open_sequence  # noqa: E402
from automos.settings import load_settings  # noqa: E402


def send_patiently(packets, feed):
    """Send each packet when the one before has been looked at and no scan waits: none is left out, on any machine.

    Then the sensor is gone, which is told the feed at once: its patience would depend on the machine, too.
    """

    def wait_for(n):
        while feed.n_packets < n or not feed.latest.is_empty:
            time.sleep(0.0005)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for n, (_, payload) in enumerate(packets):
            wait_for(n)
            out.sendto(payload, ("127.0.0.1", feed.port))
    wait_for(len(packets))
    feed._stop.set()


@pytest.fixture(scope="module")
def walk():
    return room_packets(16)


@pytest.fixture(scope="module")
def segmented(walk, tmp_path_factory):
    """Return the results of automos segment on a capture of the packets."""
    folder = tmp_path_factory.mktemp("segmented")
    path = write_pcap(folder / "room.pcap", [(seconds, udp(payload)) for seconds, payload in walk])
    segment_recording(open_sequence(path), folder / "out", load_settings("default"), 0.3)
    return folder / "out"


def labels_of(folder):
    return {path.name: np.fromfile(path, np.uint32) for path in sorted((folder / "predictions").glob("*.label"))}


def test_labels_of_packets_over_loopback_are_those_of_segment(walk, segmented, tmp_path):
    feed, names, settings = UdpFeed("127.0.0.1", 0, VelodyneAssembler(), patience=600.0), [], load_settings("default")
    with (
        results_writer(tmp_path / "out", names, settings) as writer,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
    ):
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5.0)
        with Sender(*receiver.getsockname()) as sender:
            threading.Thread(target=send_patiently, args=(walk, feed), daemon=True).start()
            sinks = [lambda scan, given: writer.write(given), lambda scan, given: sender.send(given)]
            tally = run_live(feed, Labeler(settings, lag=0.3, is_compensated=False), sinks, names)
        first = decode(receiver.recv(65536))
        writer.finish({})
    assert tally.left_out == 0
    got, wanted = labels_of(tmp_path / "out"), labels_of(segmented)
    assert list(got) == list(wanted)
    for name, labels in wanted.items():
        np.testing.assert_array_equal(got[name], labels)
    moving = sum(int((labels & 0xFFFF == 251).sum()) for labels in wanted.values())
    assert moving > 100  # someone walks, and is seen to
    np.testing.assert_array_equal(first.labels, wanted["000000.label"] & 0xFFFF)


def start(*arguments):
    code = "from automos.cli import main; main()"
    environment = {**os.environ, "COLUMNS": "200"}
    return subprocess.Popen(
        [sys.executable, "-c", code, "live", *map(str, arguments)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
        preexec_fn=None if os.name == "nt" else _heed_ctrl_c,
    )  # fmt: skip


def _heed_ctrl_c():
    """A shell's jobs in the background, such as this suite may be, ignore Ctrl-C, and so do their children."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_a_replay_is_written_and_summed_up(automos, walk, tmp_path):
    path = write_pcap(tmp_path / "room.pcap", [(seconds, udp(payload)) for seconds, payload in walk[: len(walk) // 3]])
    ended = automos("live", path, "--speed", 0, "--out", tmp_path / "out")
    assert ended.code == 0, ended.err
    assert "scans labelled, 0 left out" in ended.out
    run = json.loads((tmp_path / "out" / "run.json").read_text())
    assert run["recording"]["scans"] == len(labels_of(tmp_path / "out")) == len(open_sequence(path))


def test_a_mistaken_command_leaves_earlier_results_as_they_are(automos, walk, segmented, tmp_path):
    path = write_pcap(tmp_path / "room.pcap", [(seconds, udp(payload)) for seconds, payload in walk[:200]])
    out = shutil.copytree(segmented, tmp_path / "out")
    ended = automos("live", path, "--out", out, "--send", "udp://nowhere")
    assert ended.code == 2
    assert "is not an address" in " ".join(ended.err.split())
    assert labels_of(out).keys() == labels_of(segmented).keys()
    assert (out / "run.json").exists()


@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C to all processes of a console")
def test_ctrl_c_ends_it_cleanly_with_a_summary(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = start(f"udp://127.0.0.1:{port}", "--sensor", "velodyne", "--timeout", 100, "--out", tmp_path / "out")
    for line in process.stderr:
        if "waiting for scans" in line:
            break
    process.send_signal(signal.SIGINT)
    printed, said = process.communicate(timeout=400)
    assert process.returncode == 0, said
    assert "0 scans labelled, 0 left out" in printed
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["udp://127.0.0.1:1", "--sensor", "livox"], "give --sensor velodyne or --sensor ouster, not livox"),
        (["udp://nowhere"], "is not an address"),
        (["missing_log"], "missing_log"),
        (["udp://127.0.0.1:0", "--sensor", "velodyne", "--timeout", "0.2"], "no packets of a Velodyne came"),
    ],
)
def test_what_is_wrong_is_a_sentence(automos, arguments, said):
    ended = automos("live", *arguments)
    assert ended.code == 2
    assert said in " ".join(ended.err.split())
    assert "Traceback" not in ended.err
