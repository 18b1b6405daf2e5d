"""Bags without movers: the points of one topic are cut, and every other byte is what it was."""

import numpy as np
import pytest
from bags import cloud, columns_of, write_bag
from labelled import labelled, moving
from street_log import street_log

from automos.core.errors import InputError
from automos.readers.bag_messages import with_rows
from automos.readers.point_cloud2 import read_columns
from automos.writers.cleaning.clean import Choice, clean

pytest.importorskip("rosbags")
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

JOINTS = [("base", "lidar", [1.0, 2.0, 3.0], [0.0, 0.0, 0.0, 1.0])]
"""What /tf_static says."""


def messages(scans, **options):
    return [
        (1_000_000_000 + 100_000_000 * k, 1.0 + 0.1 * k, cloud(columns_of(scan), **options))
        for k, scan in enumerate(scans)
    ]


def contents(bag):
    """Return (topic, type, time, bytes) of every message, in their order, and what decodes them."""
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        found = [(c.topic, c.msgtype, t, bytes(raw)) for c, t, raw in reader.messages()]
        clouds = [reader.deserialize(raw, kind) for _, kind, _, raw in found if kind.endswith("PointCloud2")]
        about = [(c.topic, c.msgtype, c.msgdef.data, c.digest, c.msgcount) for c in reader.connections]
    return found, clouds, about


def clouds_of(bag, topic="/points"):
    found, clouds, _ = contents(bag)
    topics = [row[0] for row in found if row[1].endswith("PointCloud2")]
    return [each for each, name in zip(clouds, topics, strict=True) if name == topic]


@pytest.mark.parametrize("name", ["log 7 Straße.bag", "log", "log.db3", "log.mcap"])
def test_only_the_points_of_the_topic_change(tmp_path, name):
    scans = street_log(12).scans[:4]
    topics = {"/points": messages(scans), "/rear/points": messages(scans[::-1])}
    bag = write_bag(tmp_path / "in" / name, topics, joints=() if name.endswith(".bag") else JOINTS)
    run = labelled(tmp_path / "run", bag / "points")
    written, points, left_out = clean(run, tmp_path / "out", choice=Choice.NOT_MOVING)
    assert written == tmp_path / "out" / name
    assert (points, left_out) == (sum(map(len, scans)), sum(-(-len(scan) // 5) for scan in scans))
    before, _, about = contents(bag)
    after, _, same = contents(written)
    assert about == same
    assert [row[:3] for row in before] == [row[:3] for row in after]
    changed = [k for k, (one, other) in enumerate(zip(before, after, strict=True)) if one[3] != other[3]]
    assert [before[k][0] for k in changed] == ["/points"] * 4
    for index, (was, now) in enumerate(zip(clouds_of(bag), clouds_of(written), strict=True)):
        for same in ("header", "fields", "point_step", "is_dense", "is_bigendian"):
            assert repr(getattr(now, same)) == repr(getattr(was, same))
        assert (now.height, now.row_step) == (1, now.width * now.point_step)
        rows = was.data.reshape(-1, was.point_step)[~moving(run, index)]
        np.testing.assert_array_equal(now.data.reshape(-1, now.point_step), rows)


@pytest.mark.parametrize("name", ["log.bag", "log.mcap"])
@pytest.mark.parametrize("options", [{"height": 2, "row_padding": 5}, {"big_endian": True}, {"gap": 0}])
def test_organised_padded_and_big_endian_clouds_are_cut_alike(tmp_path, name, options):
    (scan,) = street_log(12).scans[:1]
    columns = {key: column[:40] for key, column in columns_of(scan).items()}
    bag = write_bag(tmp_path / name, {"/points": [(1, 1.0, cloud(columns, **options))] * 2})
    run = labelled(tmp_path / "run", bag)
    written, *_ = clean(run, tmp_path / "out", choice=Choice.MOVING)
    now = contents(written)[1][0]
    got = read_columns(now, "it")
    assert set(got) == set(columns)
    for key, column in columns.items():
        np.testing.assert_array_equal(got[key], column[::5])


def test_scans_recorded_at_one_time_and_out_of_order_are_not_mixed_up(tmp_path):
    scans = street_log(12).scans[:3]
    times = [7, 7, 5]
    topics = {
        "/points": [(t, 3.0 - k, cloud(columns_of(s))) for k, (t, s) in enumerate(zip(times, scans, strict=True))]
    }
    for name in ("log.bag", "log.db3", "log.mcap"):
        bag = write_bag(tmp_path / name, topics)
        run = labelled(tmp_path / f"run {name}", bag)
        written, *_ = clean(run, tmp_path / f"out {name}", choice=Choice.NOT_MOVING)
        for was, now in zip(contents(bag)[1], contents(written)[1], strict=True):
            kept = np.arange(was.width) % 5 != 0
            np.testing.assert_array_equal(
                now.data.reshape(-1, now.point_step), was.data.reshape(-1, was.point_step)[kept]
            )


def test_a_message_with_another_number_of_points_is_refused_not_cut(tmp_path):
    (scan,) = street_log(12).scans[:1]
    bag = write_bag(tmp_path / "log.mcap", {"/points": [(1, 1.0, cloud(columns_of(scan)))]})
    ((_, kind, _, raw),) = contents(bag)[0]
    with pytest.raises(InputError, match="labels"):
        with_rows(raw, kind, True, np.ones(3, bool))
    for end in range(12, len(raw), 997):
        with pytest.raises(InputError):
            with_rows(raw[:end], kind, True, np.ones(len(scan), bool))


def test_a_bag_of_another_kind_is_asked_for_in_a_sentence(tmp_path):
    bag = write_bag(tmp_path / "log.mcap", {"/points": messages(street_log(12).scans[:2])})
    run = labelled(tmp_path / "run", bag)
    with pytest.raises(InputError, match="there are bin, pcd, laz, mcap"):
        clean(run, tmp_path / "out", "ply")
    assert not (tmp_path / "out").exists()
