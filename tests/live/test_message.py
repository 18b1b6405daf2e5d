"""The message: every byte where the documentation says, and nothing believed of what arrives."""

import socket
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

from automos.core.errors import InputError
from automos.labeler import LabelledScan
from automos.live import message
from automos.live.message import LARGEST, OBJECT, Sender, decode, encode
from automos.online.labelled_scan import OBJECT_FIELDS

EXAMPLE = Path(__file__).parents[2] / "examples" / "live_receiver.py"


def labelled(n=1000, noisy=False):
    rng = np.random.default_rng(0)
    labels = np.where(np.arange(n) < 200, 251, 9).astype(np.uint8)
    if noisy:
        labels = rng.integers(0, 255, n).astype(np.uint8)
    objects = np.zeros(2, OBJECT_FIELDS)
    objects["track"], objects["yaw"], objects["center"] = [7, 9], [0.5, -1.5], [[1, 2, 3], [4, 5, 6]]
    objects["size"], objects["velocity"] = [4.5, 1.8, 1.5], [[10, 0, 0], [0, -2, 0.5]]
    pose = np.eye(4)
    pose[:3, 3] = [100.0, -20.0, 1.5]
    return LabelledScan(41, 12.25, pose, labels, np.full(n, -1, np.int32), np.ones(n, np.float32), objects)


def test_what_is_sent_comes_back():
    scan = labelled()
    message = decode(encode(scan))
    assert (message.index, message.stamp) == (41, 12.25)
    np.testing.assert_array_equal(message.pose, scan.pose)
    np.testing.assert_array_equal(message.labels, scan.labels)
    for name in OBJECT.names:
        np.testing.assert_array_equal(message.objects[name], scan.objects[name].astype(message.objects[name].dtype))


def test_every_byte_is_where_the_documentation_says():
    data = encode(labelled())
    assert data[:4] == b"AMOS"
    assert struct.unpack_from("<HHIIII", data, 4) == (1, 2, 41, 1000, 200, len(data) - 128 - 2 * 44)
    assert struct.unpack_from("<d", data, 24) == (12.25,)
    assert struct.unpack_from("<12d", data, 32) == (1, 0, 0, 100, 0, 1, 0, -20, 0, 0, 1, 1.5)
    assert struct.unpack_from("<i10f", data, 128 + 44) == (9, 4, 5, 6, 4.5, np.float32(1.8), 1.5, -1.5, 0, -2, 0.5)
    assert zlib.decompress(data[128 + 88 :]) == labelled().labels.tobytes()


def test_labels_that_do_not_fit_into_a_datagram_are_left_out():
    data = encode(labelled(200_000, noisy=True))
    assert len(data) <= LARGEST
    message = decode(data)
    assert message.labels is None
    assert len(message.objects) == 2


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: b"", "are not a message"),
        (lambda d: b"XXXX" + d[4:], "are not a message"),
        (lambda d: d[:4] + b"\x02\x00" + d[6:], "of version 2, 1 is read"),
        (lambda d: d[:-1], "bytes, .* of which came"),
        (lambda d: d[:-8] + b"\xff" * 8, "damaged|holds the labels of"),
        (lambda d: d[:12] + struct.pack("<I", 5) + d[16:], "announces 5 points, but holds"),
    ],
)
def test_what_is_no_message_is_told(change, said):
    with pytest.raises(InputError, match=said):
        decode(change(encode(labelled())))


def test_nobody_need_listen():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with Sender("127.0.0.1", port) as sender:
        for _ in range(20):
            sender.send(labelled())
    assert sender.n_sent + sender.n_failed == 20
    assert bool(sender.summary()) == (sender.n_failed > 0)


def test_messages_that_could_not_be_sent_are_reported_at_the_end(monkeypatch):
    with Sender("127.0.0.1", 9) as sender:
        assert sender.summary() == ""
        monkeypatch.setattr(message, "encode", lambda scan: bytes(70_000))  # no datagram is that long
        sender.send(labelled())
    assert sender.summary().startswith("1 of 1 messages could not be sent")


def test_the_receiver_of_the_example_reads_it_without_automos():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-I", "-u", EXAMPLE, str(port)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert "listening" in process.stdout.readline()
    with Sender("127.0.0.1", port) as sender:
        sender.send(labelled())
    printed, _ = process.communicate(timeout=20)
    assert process.returncode == 0
    assert "scan 41 at 12.250 s: 200 of 1000 points move" in printed
    assert "object 7 at (1.0, 2.0, 3.0) m, 10.0 m/s" in printed
