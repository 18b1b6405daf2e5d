"""Bags of ROS 1 as recorders leave them: killed, cut, compressed, with and without index."""

import struct
import sys
import tracemalloc

import numpy as np
import pytest
from bags import cloud, columns_of, write_bag
from street_log import assert_same_points, street_log

from automos.core.errors import InputError, MissingExtraError
from automos.readers import find_recordings, open_sequence
from automos.readers.bag_chunks import ChunkedFile, unpack


def messages_of(log):
    return [
        (int(t), float(scan.stamp), cloud(columns_of(scan))) for t, scan in zip(log.nanoseconds, log.scans, strict=True)
    ]


def index_at(raw):
    """Return where in a bag's header its index is said to be, and that."""
    at = raw.index(b"index_pos=") + 10
    return at, int.from_bytes(raw[at : at + 8], "little")


def records(raw, start, end):
    """Yield begin, op, begin of the data and end of each record in a part of a bag."""
    at = start
    while at < end:
        n = int.from_bytes(raw[at : at + 4], "little")
        head = raw[at + 4 : at + 4 + n]
        data = at + 8 + n
        after = data + int.from_bytes(raw[data - 4 : data], "little")
        yield at, head[head.index(b"op=") + 3], data, after
        at = after


def as_it_is_written(raw):
    """Return an uncompressed bag of which the recorder was killed: its last chunk has no size yet, and no index."""
    _, end = index_at(raw)
    chunks = [(at, data, after) for at, op, data, after in records(raw, 13, end) if op == 5]
    at, data, after = chunks[-1]
    head = bytearray(raw[at:data])
    head[head.index(b"size=") + 5 : head.index(b"size=") + 9] = bytes(4)
    head[-4:] = bytes(4)
    at_position, _ = index_at(raw)
    return raw[:at_position] + bytes(8) + raw[at_position + 8 : at] + bytes(head) + raw[data:after]


def test_a_bag_whose_recorder_was_killed_is_read(tmp_path):
    log = street_log()
    raw = write_bag(tmp_path / "whole.bag", {"/points": messages_of(log)}).read_bytes()
    at, end = index_at(raw)
    for name, content in (
        ("no_index.bag", raw[:at] + bytes(8) + raw[at + 8 : end]),
        ("drive.bag.active", as_it_is_written(raw)),
        ("cut.bag.active", as_it_is_written(raw)[:-100]),
    ):
        (tmp_path / name).write_bytes(content)
        sequence = open_sequence(tmp_path / name)
        is_cut = name.startswith("cut")
        assert len(sequence) == len(log.scans) - is_cut
        assert sequence.name == name.partition(".")[0]
        assert [f"{name} ends within a record" in warning for warning in sequence.warnings] == [True] * is_cut
        for got, true in zip(sequence, log.scans, strict=False):
            assert_same_points(got, true, atol=0)


def test_an_active_bag_in_a_folder_is_found(tmp_path):
    raw = write_bag(tmp_path / "a.bag", {"/points": messages_of(street_log())}).read_bytes()
    (tmp_path / "a.bag").unlink()
    (tmp_path / "drive.bag.active").write_bytes(as_it_is_written(raw))
    assert find_recordings(tmp_path) == [tmp_path / "drive.bag.active"]


@pytest.mark.parametrize("compress", [False, True])
def test_topics_that_their_first_chunk_names_alone_are_found(tmp_path, compress):
    log = street_log()
    path = write_bag(tmp_path / "log.bag", {"/points": messages_of(log), "/other": messages_of(log)[:2]}, compress)
    raw = path.read_bytes()
    at, end = index_at(raw)
    path.write_bytes(raw[:at] + bytes(8) + raw[at + 8 : end])
    for got, true in zip(open_sequence(path / "points"), log.scans, strict=True):
        assert_same_points(got, true, atol=0)
    assert len(open_sequence(path / "other")) == 2


def test_bags_of_other_versions_and_encrypted_ones_are_told(tmp_path):
    (tmp_path / "old.bag").write_bytes(b"#ROSBAG V1.2\n" + bytes(100))
    with pytest.raises(InputError, match=r"old.bag begins with b'#ROSBAG V1.2\\n', but .*; convert it: rosbag fix"):
        open_sequence(tmp_path / "old.bag")


def test_zeros_behind_a_bag_are_its_end_and_no_endless_loop(tmp_path):
    path = write_bag(tmp_path / "log.bag", {"/points": messages_of(street_log())})
    path.write_bytes(path.read_bytes() + bytes(10_000_000))
    assert len(open_sequence(path)) == len(street_log().scans)


def test_a_chunk_that_promises_more_than_it_holds_and_sizes_without_end_are_told(tmp_path):
    path = write_bag(tmp_path / "log.bag", {"/points": messages_of(street_log(4))}, compress=True)
    raw = bytearray(path.read_bytes())
    at = raw.index(b"size=", raw.index(b"compression=lz4") - 60)
    raw[at + 5 : at + 9] = struct.pack("<I", 2**32 - 1)
    path.write_bytes(raw)
    with pytest.raises(
        InputError, match=r"log.bag holds a chunk that \d+ bytes at byte \d+ unpack to 4294967295 bytes"
    ):
        [*open_sequence(path)]


@pytest.mark.parametrize("kind", ["bz2", "lz4", "zstd", "none"])
def test_no_more_is_unpacked_than_is_asked_for(kind):
    import bz2

    import lz4.frame
    import zstandard

    content = bytes(range(256)) * 40_000
    pack = {"bz2": bz2.compress, "lz4": lz4.frame.compress, "zstd": zstandard.compress, "none": bytes}[kind]
    packed = pack(content)
    tracemalloc.start()
    assert unpack(packed, kind, 1000) == content[:1000]
    assert tracemalloc.get_traced_memory()[1] < 8e6
    tracemalloc.stop()
    assert unpack(packed, kind, 10**9) == content
    if kind != "none":
        assert content.startswith(unpack(packed[: len(packed) // 2], kind, 10**9))
    with pytest.raises(ValueError, match="compression 'rar' is not known"):
        unpack(packed, "rar", 10)


@pytest.mark.parametrize(("kind", "module"), [("lz4", "lz4.frame"), ("zstd", "zstandard")])
def test_what_unpacks_a_bag_and_is_not_installed_is_named(monkeypatch, kind, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=rf"{module.partition('.')[0]} is not installed; run: pip install"):
        unpack(b"packed", kind, 10)


def test_opening_a_thousand_scans_reads_their_headers_and_few_of_them(monkeypatch, tmp_path):
    rng = np.random.default_rng(0)
    columns = {axis: rng.normal(size=20_000).astype("f4") for axis in "xyz"}
    messages = [(10**8 * k, 1.0 + 0.1 * k, cloud(columns, gap=0)) for k in range(1000)]
    path = write_bag(tmp_path / "log.bag", {"/points": messages})
    read = []
    original = ChunkedFile._bytes
    monkeypatch.setattr(ChunkedFile, "_bytes", lambda self, *of: read.append(of[-1]) or original(self, *of))
    sequence = open_sequence(path)
    assert sum(read) < 20 * 240_000 + 1000 * 5000
    assert sum(n > 200_000 for n in read) <= 20
    assert len(sequence) == 1000
