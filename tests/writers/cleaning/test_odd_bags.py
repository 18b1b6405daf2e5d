"""Bags as recorders leave them, without movers: in parts, without end, compressed, miscounted, in a map's frame."""

import sqlite3
from types import SimpleNamespace

import numpy as np
import pytest
from bags import _message, cloud, columns_of, write_bag
from labelled import labelled
from street_log import street_log

from automos.core.errors import InputError
from automos.core.geometry import transform
from automos.readers import open_sequence
from automos.readers.bag_messages import PACKETS, Topic
from automos.writers.cleaning.bags import require_rewritable
from automos.writers.cleaning.clean import Choice, clean

pytest.importorskip("rosbags")
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation


def clouds(first=0, last=4):
    scans = street_log(12).scans[first:last]
    return [(round(1e9 * scan.stamp), float(scan.stamp), cloud(columns_of(scan), gap=0)) for scan in scans]


def assert_cut(recording, tmp_path, n=4, topic=""):
    """Clean what moves from a recording, and require of each scan what is left of it; return what was written."""
    run = labelled(tmp_path / "run", recording / topic)
    assert len(run.sequence) == n
    written, points, left_out = clean(run, tmp_path / "out", choice=Choice.NOT_MOVING)
    again = open_sequence(written / topic)
    assert len(again) == n
    for index in range(n):
        scan = run.scan(index)
        np.testing.assert_allclose(again[index].points, scan.points[np.arange(len(scan)) % 5 != 0], atol=1e-3)
    np.testing.assert_array_equal(again.stamps, run.sequence.stamps)
    assert points == sum(len(run.scan(index)) for index in range(n))
    assert left_out == sum(-(-len(run.scan(index)) // 5) for index in range(n))
    return written


@pytest.mark.parametrize("suffix", [".bag", ".db3", ".mcap"])
def test_parts_of_a_drive_are_written_as_such(tmp_path, suffix):
    folder = tmp_path / "in"
    for k in range(2):
        write_bag(folder / f"run_{k}{suffix}", {"/points": clouds(2 * k, 2 * k + 2), "/rear": clouds(2 * k, 2 * k + 2)})
    run = labelled(tmp_path / "run", folder / f"run_0{suffix}+" / "points")
    written, *_ = clean(run, tmp_path / "out", choice=Choice.NOT_MOVING)
    assert written == tmp_path / "out" / f"run_0{suffix}+"
    assert sorted(path.name for path in written.parent.glob("run*")) == [f"run_{k}{suffix}" for k in range(2)]
    sizes = [len(scan) for scan in street_log(12).scans[:4]]
    assert [len(scan) for scan in open_sequence(written / "points")] == [n - -(-n // 5) for n in sizes]
    assert [len(scan) for scan in open_sequence(written / "rear")] == sizes


def unfinished(raw):
    """Return a ROS 1 bag whose recorder was killed before it wrote the index at its end."""
    at = raw.index(b"index_pos=") + 10
    return raw[:at] + bytes(8) + raw[at + 8 : int.from_bytes(raw[at : at + 8], "little")]


@pytest.mark.parametrize("n_lost", [0, 1000])
def test_what_a_killed_recorder_of_ros_1_left_is_a_whole_bag(tmp_path, n_lost):
    raw = unfinished(write_bag(tmp_path / "a.bag", {"/points": clouds(), "/rear": clouds(0, 2)}).read_bytes())
    path = tmp_path / "log.bag.active"
    path.write_bytes(raw[: len(raw) - n_lost])
    n_whole = len(open_sequence(path / "rear"))
    written = assert_cut(path, tmp_path, topic="points")
    assert written.name == "log.bag.active"
    with Reader1(written) as reader:  # which takes those with an index alone
        assert {c.topic: c.msgcount for c in reader.connections} == {"/points": 4, "/rear": n_whole}


def test_a_bag_of_ros_1_keeps_what_its_connections_say(tmp_path):
    types, path = get_typestore(Stores.ROS1_NOETIC), tmp_path / "log.bag"
    with Writer1(path) as writer:
        kind = "sensor_msgs/msg/PointCloud2"
        links = [
            writer.add_connection("/points", kind, typestore=types, callerid=f"/node{k}", latching=k) for k in range(2)
        ]
        for k, (at, stamp, parts) in enumerate(clouds()):
            writer.write(links[k % 2], at, types.serialize_ros1(_message(types, stamp, parts, True), kind))
    with Reader1(path) as before, Reader1(assert_cut(path, tmp_path)) as after:
        assert [(*c[1:6], c.ext) for c in before.connections] == [(*c[1:6], c.ext) for c in after.connections]


def test_messages_that_lie_in_the_journal_alone_are_written(tmp_path):
    path = write_bag(tmp_path / "log.db3", {"/points": clouds()})
    whole = sqlite3.connect(path)
    whole.execute("PRAGMA journal_mode = WAL")
    ((last, topic, at, data),) = whole.execute("SELECT * FROM messages ORDER BY id DESC LIMIT 1")
    whole.execute("DELETE FROM messages WHERE id = ?", [last])
    whole.commit()
    whole.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    whole.execute("INSERT INTO messages VALUES (?, ?, ?, ?)", [last, topic, at, data])
    whole.commit()
    try:
        assert (tmp_path / "log.db3-wal").stat().st_size > 0
        written = assert_cut(path, tmp_path)
    finally:
        whole.close()
    assert [p.name for p in written.parent.glob("log*")] == ["log.db3"]


def test_messages_that_were_compressed_each_are_so_again_and_what_lies_beside_is_kept(tmp_path):
    types, kind = get_typestore(Stores.ROS2_HUMBLE), "sensor_msgs/msg/PointCloud2"
    writer = Writer2(tmp_path / "log", version=8, storage_plugin=StoragePlugin.SQLITE3)
    writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with writer:
        link = writer.add_connection("/points", kind, typestore=types)
        for at, stamp, parts in clouds():
            writer.write(link, at, types.serialize_cdr(_message(types, stamp, parts, False), kind))
    (tmp_path / "log" / "notes.txt").write_text("rain")
    written = assert_cut(tmp_path / "log", tmp_path)
    assert (written / "metadata.yaml").read_bytes() == (tmp_path / "log" / "metadata.yaml").read_bytes()
    assert (written / "notes.txt").read_text() == "rain"
    (base,) = written.glob("*.db3")
    assert all(
        row[0].startswith(b"\x28\xb5\x2f\xfd") for row in sqlite3.connect(base).execute("SELECT data FROM messages")
    )


@pytest.mark.parametrize("name", ["log.bag", "log.db3", "log.mcap"])
def test_points_that_headers_do_not_count_are_cut_with_the_others(tmp_path, name):
    messages = clouds()
    for _, _, parts in messages:
        parts.width = parts.width // 2
        parts.row_step = parts.width * parts.point_step
    sequence = open_sequence(write_bag(tmp_path / name, {"/points": messages}))
    assert len(sequence[0]) == len(street_log(12).scans[0])
    again = open_sequence(assert_cut(tmp_path / name, tmp_path))
    assert again.warnings == []  # what is written counts them


@pytest.mark.parametrize("name", ["log.bag", "log.mcap"])
def test_clouds_in_a_maps_frame_stay_in_it_with_the_odometry_that_takes_them_back(tmp_path, name):
    log, is_ros1 = street_log(12), name.endswith(".bag")
    types = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    make, folder = types.types, tmp_path / "log"
    writer = Writer1(tmp_path / name) if is_ros1 else Writer2(folder, version=8, storage_plugin=StoragePlugin.MCAP)
    serialize = types.serialize_ros1 if is_ros1 else types.serialize_cdr
    offset = np.eye(4)
    offset[:3, 3] = 100.0, -50.0, 2.0
    with writer:
        kinds = {"/cloud": "sensor_msgs/msg/PointCloud2", "/odometry": "nav_msgs/msg/Odometry"}
        links = {topic: writer.add_connection(topic, kind, typestore=types) for topic, kind in kinds.items()}
        for scan, T in zip(log.scans, offset @ log.poses, strict=True):
            at, moved = round(1e9 * scan.stamp), transform(T, scan.points).astype("f4")
            columns = columns_of(scan) | {axis: moved[:, k] for k, axis in enumerate("xyz")}
            message = _message(types, float(scan.stamp), cloud(columns), is_ros1, "map")
            place = make["geometry_msgs/msg/Pose"](
                make["geometry_msgs/msg/Point"](*T[:3, 3].tolist()),
                make["geometry_msgs/msg/Quaternion"](*Rotation.from_matrix(T[:3, :3]).as_quat().tolist()),
            )
            zero = make["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
            odometry = make["nav_msgs/msg/Odometry"](
                message.header,
                "body",
                make["geometry_msgs/msg/PoseWithCovariance"](place, np.zeros(36)),
                make["geometry_msgs/msg/TwistWithCovariance"](
                    make["geometry_msgs/msg/Twist"](zero, zero), np.zeros(36)
                ),
            )
            for topic, each in (("/cloud", message), ("/odometry", odometry)):
                writer.write(links[topic], at, serialize(each, each.__msgtype__))
    path = tmp_path / name if is_ros1 else folder
    again = open_sequence(assert_cut(path, tmp_path, len(log.scans)))
    assert again.is_compensated
    np.testing.assert_allclose(again.reference_poses, log.poses, atol=1e-6)


@pytest.mark.parametrize(
    ("kind", "encoding", "match"),
    [
        (PACKETS[0], "cdr", "/p holds a sensor's packets, of which no single points can be left out: give --as bin"),
        ("foxglove.PointCloud", "json", r"/p holds foxglove.PointCloud \(json\), which is not written again"),
        ("sensor_msgs/msg/PointCloud", "ros1", r"/p holds sensor_msgs/msg/PointCloud \(ros1\), which is not"),
    ],
)
def test_messages_that_are_not_cut_are_told(kind, encoding, match):
    with pytest.raises(InputError, match=match):
        require_rewritable(SimpleNamespace(topic=Topic("/p", kind, encoding), is_joined=False))


def test_parts_of_turns_are_not_cut_and_that_is_told():
    joined = SimpleNamespace(topic=Topic("/p", "sensor_msgs/msg/PointCloud2", "cdr"), is_joined=True)
    with pytest.raises(InputError, match="/p holds parts of a turn, which are not written again as such: give --as"):
        require_rewritable(joined)


def test_an_mcap_without_end_is_refused_as_such_and_written_as_another_kind(tmp_path):
    path = write_bag(tmp_path / "log.mcap", {"/points": clouds()})
    path.write_bytes(path.read_bytes()[:-100])
    run = labelled(tmp_path / "run", path)
    with pytest.raises(InputError, match=r"has no end, .*: give --as bin, pcd or laz"):
        clean(run, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    written, *_ = clean(run, tmp_path / "out", "bin")
    assert len(open_sequence(written)) == len(run.sequence)


@pytest.mark.parametrize("name", ["log.bag", "log.db3", "log.mcap"])
def test_messages_that_changed_since_they_were_labelled_are_told(tmp_path, name):
    run = labelled(tmp_path / "run", write_bag(tmp_path / name, {"/points": clouds()}))
    (tmp_path / name).unlink()
    write_bag(tmp_path / name, {"/points": clouds(0, 3)})
    with pytest.raises(InputError, match=f"{name} "):
        clean(run, tmp_path / "out")
    assert not (tmp_path / "out" / name).exists()
