import os
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from bags import cloud, columns_of, write_bag
from street_log import assert_same_points, street_log

from automos.core.errors import InputError, MissingExtraError
from automos.readers import bag_messages, open_recordings, open_sequence


def messages_of(log, **options):
    return [
        (int(t), float(scan.stamp), cloud(columns_of(scan), **options))
        for t, scan in zip(log.nanoseconds, log.scans, strict=True)
    ]


def number(n_scans, stamps=None, recorded=None, name="x"):
    """Return messages whose only point says which one it is."""
    stamps = 5.0 + np.arange(n_scans) if stamps is None else stamps
    recorded = 10**9 * np.arange(n_scans) if recorded is None else recorded
    return [
        (int(recorded[i]), float(stamps[i]), cloud({axis: np.array([i + 1], "f4") for axis in (name, "y", "z")}))
        for i in range(n_scans)
    ]


@pytest.mark.parametrize("name", ["log.bag", "log", "log.db3", "log.mcap"])
def test_every_kind_of_bag_gives_the_clouds_of_its_only_such_topic(tmp_path, name):
    log = street_log()
    write_bag(tmp_path / "bags" / name, {"/points": messages_of(log)})
    sequence = open_sequence(tmp_path / "bags" / name)
    assert (sequence.name, len(sequence)) == ("log", 12)
    np.testing.assert_allclose(sequence.stamps, log.stamps, atol=1e-6)
    for got, true in zip(sequence, log.scans, strict=True):
        assert_same_points(got, true, atol=0)
    assert [s.name for s in open_recordings(tmp_path / "bags")] == ["log"]


@pytest.mark.parametrize("name", ["run.v2.bag", "run.v2.mcap", "2021.04.01"])
def test_a_recording_is_called_what_its_bag_is_but_for_the_kind(tmp_path, name):
    path = write_bag(tmp_path / name, {"/p": number(2)}) if name[-1] != "1" else tmp_path / name
    if name[-1] == "1":
        write_bag(tmp_path / "log", {"/p": number(2)}).rename(path)
    assert open_sequence(path).name == name.removesuffix(".bag").removesuffix(".mcap")


def test_the_files_of_a_bag_may_be_called_by_any_bytes(tmp_path):
    bag = write_bag(tmp_path / "log", {"/p": number(2)})
    data = next(file for file in bag.iterdir() if file.suffix in (".db3", ".mcap"))
    other = bag / (os.fsdecode(b"name\xff") + data.suffix)
    try:
        data.rename(other)
    except OSError:
        pytest.skip("this file system takes names in UTF-8 only")
    assert len(open_sequence(bag)) == 2
    assert open_sequence(bag).fingerprint() == open_sequence(bag).fingerprint()


def test_the_address_of_a_topic_opens_it_again(tmp_path):
    write_bag(tmp_path / "log.mcap", {"/front/points": number(3), "/rear/points": number(4)})
    rear = open_sequence(tmp_path / "log.mcap" / "rear" / "points")
    assert rear.address == tmp_path / "log.mcap" / "rear" / "points"
    assert len(open_sequence(rear.address)) == len(rear) == 4


@pytest.mark.parametrize("name", ["log.bag", "log", "log.mcap"])
def test_bags_may_be_compressed(tmp_path, name):
    log = street_log()
    sequence = open_sequence(write_bag(tmp_path / name, {"/points": messages_of(log)}, compress=True))
    for got, true in zip(sequence, log.scans, strict=True):
        assert_same_points(got, true, atol=0)


def test_an_mcap_file_of_another_kind_than_ros_is_told(tmp_path):
    writer = pytest.importorskip("mcap.writer").Writer(str(tmp_path / "log.mcap"))
    writer.start()
    schema = writer.register_schema("foxglove.PointCloud", "protobuf", b"")
    channel = writer.register_channel("/points", "protobuf", schema)
    writer.add_message(channel, 0, b"123", 0)
    writer.finish()
    with pytest.raises(InputError, match=r"log.mcap cannot be read as a ROS bag \(it ends within a field\)"):
        _ = open_sequence(tmp_path / "log.mcap")[0]


def test_a_bag_that_is_compressed_as_a_whole_is_to_be_unpacked(tmp_path):
    bag = write_bag(tmp_path / "log", {"/points": messages_of(street_log())})
    file = next(bag.glob("*.mcap"))
    file.rename(f"{file}.zstd")
    with pytest.raises(InputError, match=rf"{file.name}.zstd is compressed as a whole.* unpack it \(zstd -d "):
        open_sequence(bag)


@pytest.mark.parametrize("options", [{"big_endian": True}, {"gap": 0}, {"height": 2, "row_padding": 7}])
def test_clouds_may_be_big_endian_packed_or_padded(tmp_path, options):
    scan = street_log().scans[0]
    columns = {name: column[: len(scan) // 2 * 2] for name, column in columns_of(scan).items()}
    write_bag(tmp_path / "log.mcap", {"/points": [(0, 1.0, cloud(columns, **options))]})
    got = open_sequence(tmp_path / "log.mcap")[0]
    np.testing.assert_array_equal(got.points, np.column_stack([columns[axis] for axis in "xyz"]))
    np.testing.assert_array_equal(got.ring, columns["ring"])


def test_organised_clouds_keep_their_points_without_return_and_empty_ones_stay_empty(tmp_path):
    columns = {axis: np.zeros(8, "f4") for axis in "xyz"}
    columns["x"][::2] = [1, 2, 3, 4]
    empty = {axis: np.zeros(0, "f4") for axis in "xyz"}
    write_bag(tmp_path / "log.bag", {"/p": [(0, 1.0, cloud(columns, height=2)), (1, 2.0, cloud(empty))]})
    full, none = open_sequence(tmp_path / "log.bag")
    assert full.points[:, 0].tolist() == [1, 0, 2, 0, 3, 0, 4, 0]
    assert full.is_valid.tolist() == [True, False] * 4
    assert len(none) == 0


def test_a_bag_of_several_lidars_lists_them_and_takes_the_one_that_is_named(tmp_path):
    path = write_bag(tmp_path / "log.mcap", {"/rear/points": number(2), "/front/points": number(3)})
    with pytest.raises(InputError, match=r"2 topics .*/front/points, /rear/points\); give one, as .*mcap/front/points"):
        open_sequence(path)
    sequence = open_sequence(path / "front" / "points")
    assert (len(sequence), sequence.name) == (3, "log_front_points")
    assert len(open_sequence(f"{path}/rear/points")) == 2
    with pytest.raises(InputError, match=r"no topic /left/points of point clouds; it has: /front/points, /rear/points"):
        open_sequence(path / "left" / "points")
    assert sequence.fingerprint() != open_sequence(path / "rear" / "points").fingerprint()


def test_messages_recorded_at_the_same_time_are_told_apart(tmp_path):
    path = write_bag(tmp_path / "log.mcap", {"/p": number(4, recorded=np.array([7, 7, 7, 9]))})
    sequence = open_sequence(path)
    assert [scan.points[0, 0] for scan in sequence] == [1, 2, 3, 4]
    assert sequence[-1].points[0, 0] == 4
    with pytest.raises(IndexError):
        sequence[4]


def test_threads_and_processes_may_read_the_same_sequence(tmp_path):
    path = write_bag(tmp_path / "log.db3", {"/p": number(20)})
    sequence = pickle.loads(pickle.dumps(open_sequence(path)))
    with ThreadPoolExecutor(2) as pool:
        assert [scan.points[0, 0] for scan in pool.map(sequence.__getitem__, range(20))] == list(range(1, 21))


def test_headers_without_stamps_give_way_to_the_times_of_recording(tmp_path):
    path = write_bag(tmp_path / "log.mcap", {"/p": number(3, stamps=np.zeros(3))})
    np.testing.assert_allclose(open_sequence(path).stamps, [0, 1, 2])
    assert "3 of 3 headers have no stamp; the times of recording are taken" in open_sequence(path).warnings[0]


@pytest.mark.parametrize("unset", [[0], [0, 1], [2], [4]])
def test_headers_of_which_some_have_no_stamp_give_way_to_the_times_of_recording(tmp_path, unset):
    stamps = 1.7e9 + np.arange(5.0)
    stamps[unset] = 0.0
    sequence = open_sequence(write_bag(tmp_path / "log.mcap", {"/p": number(5, stamps=stamps)}))
    np.testing.assert_allclose(sequence.stamps, [0, 1, 2, 3, 4])
    assert [int(scan.points[0, 0]) for scan in sequence] == [1, 2, 3, 4, 5]
    (warning,) = sequence.warnings
    assert f"{len(unset)} of 5 headers have no stamp; the times of recording are taken for all scans" in warning


def test_a_clock_that_begins_at_zero_is_taken(tmp_path):
    path = write_bag(tmp_path / "log.mcap", {"/p": number(3, stamps=[0.0, 0.1, 0.2], recorded=[10, 20, 30])})
    assert open_sequence(path).stamps.tolist() == [0.0, 0.1, 0.2]
    assert open_sequence(path).warnings == []


def test_messages_out_of_the_order_of_time_are_put_in_order(tmp_path):
    stamps = [1.0, 1.1, 1.3, 1.2, 1.4]
    sequence = open_sequence(write_bag(tmp_path / "log.mcap", {"/p": number(5, stamps=stamps)}))
    assert [int(scan.points[0, 0]) for scan in sequence] == [1, 2, 4, 3, 5]
    np.testing.assert_allclose(sequence.stamps, [1.0, 1.1, 1.2, 1.3, 1.4])
    (warning,) = sequence.warnings
    assert "scan 000003 is 0.10 s before the one that comes ahead of it, 000002" in warning


def test_messages_that_were_lost_are_told(tmp_path):
    path = write_bag(tmp_path / "log", {"/p": number(4)})
    assert open_sequence(path).warnings == []
    text = (path / "metadata.yaml").read_text()
    (path / "metadata.yaml").write_text(text.replace("message_count: 4", "message_count: 5"))
    (warning,) = open_sequence(path).warnings
    assert "holds 4 of the 5 messages that its bag counts; it was cut or damaged" in warning


def test_messages_recorded_twice_are_recognised(tmp_path):
    messages = number(4, stamps=[1.0, 1.1, 1.1, 1.2])
    messages[2] = (messages[2][0], 1.1, messages[1][2])
    sequence = open_sequence(write_bag(tmp_path / "log.mcap", {"/p": messages}))
    np.testing.assert_array_equal(sequence.repeats, [False, False, True, False])
    assert (np.diff(sequence.stamps) > 0).all()
    assert "1 scans have the time of the one before them (first: 000002)" in sequence.warnings[0]


def test_what_cannot_be_read_is_told_in_one_sentence(tmp_path):
    path = write_bag(tmp_path / "named.mcap", {"/p": number(2, name="easting")})
    with pytest.raises(InputError, match=r"named.mcap/p has no column x; its columns are: easting, y, z"):
        open_sequence(path)[0]
    path = write_bag(tmp_path / "silent.bag", {"/p": []})
    with pytest.raises(InputError, match=r"silent.bag has no"):
        open_sequence(path)
    short = cloud({axis: np.zeros(8, "f4") for axis in "xyz"})
    short.data = short.data[:-1]
    path = write_bag(tmp_path / "short.mcap", {"/p": [(0, 1.0, short)]})
    with pytest.raises(InputError, match=r"short.mcap/p, scan 0 is cut short"):
        open_sequence(path)[0]
    beyond = cloud({axis: np.zeros(8, "f4") for axis in "xyz"})
    beyond.fields[2] = ("z", beyond.point_step - 2, 7)
    path = write_bag(tmp_path / "beyond.mcap", {"/p": [(0, 1.0, beyond)]})
    with pytest.raises(InputError, match="'z' at byte"):
        open_sequence(path)[0]


@pytest.mark.parametrize(
    ("field", "message"),
    [
        (("ring", 5, 4), "fields 'x' and 'ring' in the same bytes"),
        (("time", 3, 7), "fields 'time' and 'x' in the same bytes"),
        (("rgb", 26, 4), "fields 'intensity' and 'rgb' in the same bytes"),
        (("x", 10, 7), "x, y or z twice"),
    ],
)
def test_fields_in_the_same_bytes_and_coordinates_that_are_there_twice_are_told(tmp_path, field, message):
    parts = cloud({name: np.zeros(8, "f4") for name in ("x", "y", "z", "intensity")})  # at bytes 3, 10, 17 and 24
    parts.fields.append(field)
    path = write_bag(tmp_path / "log.mcap", {"/p": [(0, 1.0, parts)]})
    with pytest.raises(InputError, match=rf"log\.mcap/p, scan 0 has {message}"):
        open_sequence(path)[0]


def test_two_names_of_one_colour_may_share_its_bytes(tmp_path):
    parts = cloud({name: np.ones(8, "f4") for name in ("x", "y", "z", "rgb")})
    parts.fields.append(("rgba", parts.fields[3][1], 6))
    assert len(open_sequence(write_bag(tmp_path / "log.mcap", {"/p": [(0, 1.0, parts)]}))[0]) == 8


@pytest.mark.parametrize("name", ["log.bag", "log.db3", "log.mcap"])
def test_an_empty_bag_and_what_is_none_are_told(tmp_path, name):
    path = tmp_path / name
    path.touch()
    with pytest.raises(InputError, match=rf"{name} is empty: nothing was recorded, or copied"):
        open_sequence(path)
    path.write_bytes(b"<html>not found</html>")
    with pytest.raises(
        InputError, match=rf"{name} is not a bag: it begins with '<html>not found<', bags with '#ROSBAG"
    ):
        open_sequence(path)


@pytest.mark.parametrize("share", [0.5, 0.95])
@pytest.mark.parametrize("compress", [False, True])
@pytest.mark.parametrize("name", ["log.bag", "log.mcap"])
def test_of_bags_that_were_cut_what_is_whole_is_read(tmp_path, name, compress, share):
    log = street_log()
    path = write_bag(tmp_path / name, {"/points": messages_of(log)}, compress=compress)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    sequence = open_sequence(path)
    assert len(log.scans) * share - 2 <= len(sequence) <= len(log.scans)
    for got, true in zip(sequence, log.scans, strict=False):
        assert_same_points(got, true, atol=0)
    assert any(f"{name} ends within a record" in warning for warning in sequence.warnings)


@pytest.mark.parametrize("share", [0.5, 0.95])
def test_a_database_that_was_cut_is_told(tmp_path, share):
    path = write_bag(tmp_path / "log.db3", {"/points": messages_of(street_log())})
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(InputError, match=r"log.db3 (cannot be read as a ROS bag|is damaged)"):
        [*open_sequence(path)]


def test_a_bag_without_clouds_lists_what_it_has(tmp_path):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(tmp_path / "log", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=types)
    with pytest.raises(
        InputError,
        match=r"no topic of type sensor_msgs/msg/PointCloud2, .*; its topics are: /imu \(sensor_msgs/msg/Imu\)",
    ):
        open_sequence(tmp_path / "log")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of this kind are Unix's")
def test_a_pipe_in_a_bags_folder_is_refused_not_waited_for(tmp_path):
    bag = write_bag(tmp_path / "log", {"/points": messages_of(street_log(4))})
    (storage,) = bag.glob("*.mcap")
    storage.unlink()
    os.mkfifo(storage)
    with pytest.raises(InputError, match="is a pipe"):
        open_sequence(bag)


def test_a_bag_without_the_extra_names_the_command_to_install_it(tmp_path, monkeypatch):
    path = write_bag(tmp_path / "log.mcap", {"/p": number(1)})
    bag_messages._types.cache_clear()
    monkeypatch.setitem(__import__("sys").modules, "rosbags.typesys", None)
    with pytest.raises(MissingExtraError, match=r"pip install '.*\[ros\]'"):
        open_sequence(path)


def test_clouds_of_which_the_second_half_is_empty_in_all_are_no_repeats(tmp_path):
    def rows(k):  # upside down: the beams of the lower half look at the sky
        return {axis: np.concatenate([np.full(64, k + 1.0), np.zeros(192)]).astype("f4") for axis in "xyz"}

    messages = [(k, 5.0 + 0.1 * k, cloud(rows(k), height=16)) for k in range(4)]
    for name in ("log.bag", "log.mcap"):
        assert not open_sequence(write_bag(tmp_path / name, {"/p": messages})).repeats.any()


@pytest.mark.parametrize("name", ["log.bag", "log.mcap"])
@pytest.mark.parametrize("frame", ["l", "lidar", "os_sensor"])
def test_clouds_without_points_are_no_repeats_of_each_other(tmp_path, name, frame):
    none = cloud({axis: np.zeros(0, "f4") for axis in "xyz"})
    one = cloud({axis: np.ones(1, "f4") for axis in "xyz"})
    messages = [(k, 5.0 + 0.1 * k, parts) for k, parts in enumerate([one, one, none, none])]
    sequence = open_sequence(write_bag(tmp_path / name, {"/p": messages}, frames={"/p": frame}))
    assert sequence.repeats.tolist() == [False, True, False, False]
