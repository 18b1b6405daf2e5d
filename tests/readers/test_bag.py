"""Bags in several files: the parts of one drive are one recording, and two drives remain two."""

import pickle
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from bags import cloud, write_bag

from automos.core.errors import InputError
from automos.readers import find_recordings, open_recordings, open_sequence


def numbered(first, last, start=100.0, step=0.1):
    """Return messages whose only point says which one it is."""
    return [
        (round(1e9 * (start + step * i)), start + step * i, cloud({axis: np.array([i + 1], "f4") for axis in "xyz"}))
        for i in range(first, last)
    ]


def which(sequence):
    return [int(scan.points[0, 0]) for scan in sequence]


def write_parts(folder, names, bounds, topic="/points", **options):
    for name, (first, last, *start) in zip(names, bounds, strict=True):
        write_bag(folder / name, {topic: numbered(first, last, *start)}, **options)
    return folder


@pytest.mark.parametrize("suffix", [".bag", ".db3", ".mcap"])
@pytest.mark.parametrize("compress", [False, True])
def test_parts_of_a_split_recording_are_one(tmp_path, suffix, compress):
    if compress and suffix == ".db3":
        pytest.skip("such a recorder writes metadata.yaml")
    names = [f"run_{k}{suffix}" for k in range(11)]  # 10 comes before 2 by name
    folder = write_parts(tmp_path, names, [(4 * k, 4 * k + 4) for k in range(11)], compress=compress)
    (sequence,) = open_recordings(folder)
    assert which(sequence) == list(range(1, 45))
    assert (sequence.name, sequence.warnings) == ("run_0", [])
    np.testing.assert_allclose(np.diff(sequence.stamps), 0.1, atol=1e-6)
    copy = open_sequence(pickle.loads(pickle.dumps(sequence)).address)
    assert which(copy) == which(sequence)
    assert copy.fingerprint() == sequence.fingerprint()


def test_parts_are_put_together_by_what_they_hold_not_by_their_names(tmp_path):
    names = ["c.bag", "2021-03-29-06-40-01_1.bag", "a.bag"]
    folder = write_parts(tmp_path, names, [(0, 3), (3, 9), (9, 10)])
    assert which(open_sequence(folder)) == list(range(1, 11))
    assert which(open_sequence(folder / "2021-03-29-06-40-01_1.bag")) == list(range(4, 10))  # a file is a file


def test_the_last_part_may_be_the_one_that_its_recorder_was_killed_at(tmp_path):
    write_parts(tmp_path, ["log_0.bag", "log_1.bag"], [(0, 5), (5, 9)])
    raw = (tmp_path / "log_1.bag").read_bytes()
    at = raw.index(b"index_pos=") + 10
    end = int.from_bytes(raw[at : at + 8], "little")
    (tmp_path / "log_1.bag.active").write_bytes(raw[:at] + bytes(8) + raw[at + 8 : end])
    (tmp_path / "log_1.bag").unlink()
    assert which(open_sequence(tmp_path)) == list(range(1, 10))


@pytest.mark.parametrize("compress", ["MESSAGE", "FILE"])
def test_what_ros_2_compresses_by_message_is_read_and_by_file_is_told(tmp_path, compress):
    from bags import _message
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    writer = Writer(tmp_path / "log", version=8, storage_plugin=StoragePlugin.SQLITE3)
    writer.set_compression(CompressionMode[compress], CompressionFormat.ZSTD)
    with writer:
        link = writer.add_connection("/points", "sensor_msgs/msg/PointCloud2", typestore=types)
        for at, stamp, parts in numbered(0, 5):
            message = _message(types, stamp, parts, False)
            writer.write(link, at, types.serialize_cdr(message, message.__msgtype__))
    if compress == "MESSAGE":
        assert which(open_sequence(tmp_path / "log")) == [1, 2, 3, 4, 5]
        next((tmp_path / "log").glob("*.db3")).rename(tmp_path / "alone.db3")  # without what says that it is compressed
        assert which(open_sequence(tmp_path / "alone.db3")) == [1, 2, 3, 4, 5]
    else:
        with pytest.raises(InputError, match=r"compressed as a whole.* unpack it \(zstd -d log.db3.zstd\)"):
            open_sequence(tmp_path / "log")


@pytest.mark.parametrize("suffix", [".bag", ".db3", ".mcap"])
@pytest.mark.parametrize("pause", [5.0, 3600.0])
def test_two_drives_in_one_folder_remain_two_each_of_all_its_parts(tmp_path, suffix, pause):
    names = [f"drive_{k}{suffix}" for k in range(4)]
    folder = write_parts(tmp_path, names, [(0, 5), (5, 9), (0, 4, 101.0 + pause), (4, 6, 101.0 + pause)])
    first, second = open_recordings(folder)
    assert (first.name, second.name) == ("drive_0", "drive_2")
    assert (which(first), which(second)) == (list(range(1, 10)), list(range(1, 7)))
    with pytest.raises(InputError, match=r"holds 2 recordings"):
        open_sequence(folder)


def test_other_lidars_and_other_vehicles_are_other_recordings(tmp_path):
    write_parts(tmp_path, ["a.bag", "b.bag"], [(0, 5), (5, 9)])
    write_parts(tmp_path, ["c.bag"], [(5, 9)], topic="/rear/points")  # goes on as b does, of another LiDAR
    write_parts(tmp_path, ["d.bag"], [(0, 9)])  # at the same time
    recordings = open_recordings(tmp_path)
    assert [(one.name, len(one)) for one in recordings] == [("a", 9), ("c", 4), ("d", 9)]


def test_parts_of_several_lidars_go_on_together_and_a_topic_is_named_below_the_first(tmp_path):
    for k in range(2):
        topics = {"/front/points": numbered(3 * k, 3 * k + 3), "/rear/points": numbered(3 * k, 3 * k + 3)}
        write_bag(tmp_path / f"log_{k}.mcap", topics)
    (path,) = find_recordings(tmp_path)
    assert path == tmp_path / "log_0.mcap+"
    with pytest.raises(InputError, match=r"2 topics of point clouds .*; give one, as .*log_0.mcap\+/front/points"):
        open_sequence(tmp_path)
    assert which(open_sequence(path / "rear" / "points")) == list(range(1, 7))
    merged = open_sequence(f"{path}/front/points+rear/points")
    assert [scan.points[:, 0].tolist() for scan in merged] == [[k, k] for k in range(1, 7)]


def test_a_damaged_part_is_told_by_itself(tmp_path):
    write_parts(tmp_path, ["a.bag", "b.bag", "c.bag"], [(0, 5), (5, 30), (30, 32)])
    (tmp_path / "b.bag").write_bytes(b"lost")
    assert [path.name for path in find_recordings(tmp_path)] == ["a.bag", "b.bag", "c.bag"]
    with pytest.raises(InputError, match=r"b.bag is not a bag"):
        open_sequence(tmp_path / "b.bag")


def test_the_folder_of_a_split_bag_of_ros_2_is_one_whatever_its_metadata_say_of_files(tmp_path):
    parts = write_parts(tmp_path / "parts", ["drive_0.db3", "drive_1.db3"], [(0, 5), (5, 9)])
    bag = write_bag(tmp_path / "drive", {"/points": numbered(0, 9)})
    next(bag.glob("*.mcap")).unlink()
    for part in parts.iterdir():
        part.rename(bag / part.name)
    text = (bag / "metadata.yaml").read_text()
    assert which(open_sequence(bag)) == list(range(1, 10))
    (bag / "metadata.yaml").write_text(text.replace("storage_identifier: mcap", 'storage_identifier: ""'))
    assert which(open_sequence(bag)) == list(range(1, 10))
    (bag / "metadata.yaml").write_text("no yaml: [")
    sequence = open_sequence(bag)
    assert (which(sequence), sequence.warnings, sequence.name) == (list(range(1, 10)), [], "drive")


def test_several_databases_that_are_no_bags_are_each_told(tmp_path):
    for name in ("log_0.db3", "log_1.db3"):
        with closing(sqlite3.connect(tmp_path / name)) as database:
            database.execute("CREATE TABLE messages (id INTEGER)")
            database.commit()
    assert [path.name for path in find_recordings(tmp_path)] == ["log_0.db3", "log_1.db3"]
    with pytest.raises(InputError, match=r"log_0.db3 cannot be read as a ROS bag \(no such table: topics\)"):
        open_recordings(tmp_path)
