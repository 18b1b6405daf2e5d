"""Which recordings are meant by what a user writes."""

from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from automos.core.errors import InputError, MissingExtraError
from automos.fleet import sources
from automos.fleet.orders import Recording
from automos.fleet.sources import alone, describe, find_all, name_of, parse_shard, take_shard


def write_log(folder: Path) -> Path:
    folder.mkdir(parents=True)
    for i in range(2):
        np.ones((5, 4), np.float32).tofile(folder / f"{i:06d}.bin")
    return folder


def names_and_sources(found) -> list[tuple[str, str]]:
    return [(recording.name, recording.source) for recording in found]


def test_a_folder_of_folders_is_all_of_them_in_natural_order(tmp_path):
    logs = [write_log(tmp_path / name) for name in ("log2", "log10", "log1")]
    (tmp_path / "notes").mkdir()
    expected = [("log1", str(logs[2])), ("log2", str(logs[0])), ("log10", str(logs[1]))]
    assert names_and_sources(find_all(str(tmp_path))) == expected


def test_what_looks_like_a_recording_and_is_damaged_is_not_left_out_in_silence(tmp_path):
    log = write_log(tmp_path / "a")
    tables = tmp_path / "b" / "v1.0-mini"
    tables.mkdir(parents=True)
    for name in ("scene", "sample", "sample_data"):
        (tables / f"{name}.json").write_text("{")
    found = find_all(str(tmp_path))
    assert names_and_sources(found) == [("a", str(log)), ("b", str(tmp_path / "b"))]
    assert "scene.json is damaged" in describe(found[1])


@pytest.mark.parametrize("inner", ["velodyne", "sequences/00/velodyne", "other"])
def test_scans_of_the_folder_itself_are_not_left_out_in_silence(tmp_path, inner):
    log = write_log(tmp_path / "log")
    write_log(log / inner)
    if inner == "other":  # a plain log is taken for one, whatever lies in it; the reader tells
        assert names_and_sources(find_all(str(log))) == [("log", str(log))]
    else:
        with pytest.raises(InputError, match="holds scans itself, and others in folders below"):
            find_all(str(log))


def test_one_recording_is_one_and_gets_the_runs_folder_for_itself(tmp_path):
    log = write_log(tmp_path / "log")
    found = alone(find_all(str(log)), None)
    assert names_and_sources(found) == [("log", str(log))]
    assert found[0].target("out") == "out"
    assert find_all(str(log))[0].target("out") == "out/log"
    assert alone(find_all(str(log)), (0, 2))[0].target("s3://b/out/") == "s3://b/out/log"


def test_the_one_that_is_left_of_several_keeps_the_folder_of_its_results(tmp_path):
    write_log(tmp_path / "fleet" / "log")
    found = find_all(str(tmp_path / "fleet"))
    assert alone(found, None, str(tmp_path / "out"))[0].folder == ""
    (tmp_path / "out" / "log").mkdir(parents=True)
    (tmp_path / "out" / "log" / "complete.json").write_text("{}")
    assert alone(found, None, str(tmp_path / "out")) == found


def test_a_list_names_paths_beside_it_and_what_is_missing_is_found_out_later(tmp_path):
    write_log(tmp_path / "day1" / "log")
    write_log(tmp_path / "day2" / "log")
    (tmp_path / "fleet.txt").write_text("# two days\nday1/log\n\nday2   # all of it\nday3/log\n")
    found = find_all(str(tmp_path / "fleet.txt"))
    assert [recording.name for recording in found] == ["day1__log", "day2__log", "day3__log"]
    assert found[2].source == str(tmp_path / "day3" / "log")
    assert "does not exist" in describe(found[2])
    assert describe(found[0]).startswith("2 scans from ")


def test_what_cannot_be_opened_without_an_extra_does_not_end_the_list_of_a_dry_run(tmp_path, monkeypatch):
    def missing(*_):
        raise MissingExtraError("bags need rosbags: pip install 'automos-lidar[ros]'")

    monkeypatch.setattr(sources, "open_sequence", missing)
    assert "bags need rosbags" in describe(Recording("log", str(tmp_path / "log.bag")))


def test_a_name_in_a_list_is_not_cut_where_a_comment_could_begin(tmp_path):
    for name in ("drive", "drive#2"):
        write_log(tmp_path / name)
    (tmp_path / "fleet.txt").write_text("drive#2 # the second\n#drive\n")
    assert names_and_sources(find_all(str(tmp_path / "fleet.txt"))) == [("drive#2", str(tmp_path / "drive#2"))]


@pytest.mark.parametrize(("content", "word"), [("", "names no recordings"), ("# nothing\n", "names no recordings")])
def test_an_empty_list_is_told(tmp_path, content, word):
    (tmp_path / "fleet.txt").write_text(content)
    with pytest.raises(InputError, match=word):
        find_all(str(tmp_path / "fleet.txt"))


def test_a_list_that_names_the_root_of_all_folders_is_told(tmp_path, monkeypatch):
    nothing = Mock(side_effect=InputError("holds no recordings"))  # this machine may hold some near its root
    monkeypatch.setattr("automos.fleet.sources._in_folder", nothing)
    (tmp_path / "list.txt").write_text("/\n")
    with pytest.raises(InputError, match="is all of this machine"):
        find_all(str(tmp_path / "list.txt"), "kitti")  # /bin may hold what looks like points, valgrind.bin


def test_the_same_recording_twice_in_a_list_is_labelled_once(tmp_path):
    write_log(tmp_path / "log")
    (tmp_path / "fleet.txt").write_text("log\nlog\n")
    assert len(find_all(str(tmp_path / "fleet.txt"))) == 1


def test_a_folder_without_recordings_is_told_as_ever(tmp_path):
    (tmp_path / "inner").mkdir()
    with pytest.raises(InputError, match="holds no point files"):
        find_all(str(tmp_path))


def test_in_a_store_scans_side_by_side_are_a_recording_and_so_is_a_log():
    fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed: pip install '.[scale]'")
    files = fsspec.filesystem("memory")
    for path in (
        "kitti/sequences/00/velodyne/000000.bin",
        "kitti/sequences/00/labels/000000.label",
        "kitti/sequences/00/poses.txt",
        "kitti/sequences/01/velodyne/000000.bin",
        "logs/drive.mcap",
        "logs/plain/7.pcd",
        "logs/plain/8.pcd",
        "logs/plain/times.txt",
    ):
        files.pipe_file(f"/fleet/{path}", b"x")
    root = "memory://fleet"
    assert [recording.source for recording in find_all(root)] == [
        f"{root}/kitti/sequences/00",
        f"{root}/kitti/sequences/01",
        f"{root}/logs/drive.mcap",
        f"{root}/logs/plain",
    ]
    assert [recording.name for recording in find_all(root)] == ["00", "01", "drive", "plain"]
    assert find_all(f"{root}/logs/plain")[0].source == f"{root}/logs/plain"
    with pytest.raises(InputError, match="holds nothing"):
        find_all("memory://elsewhere")


@pytest.mark.parametrize(
    ("source", "name"),
    [
        ("fleet/", "fleet"), ("2026.11.25", "2026.11.25"), ("fleet.txt", "fleet"), (".", "here"), ("fleet/..", "here"),
        ("s3://user:word@bucket/logs/v1.2/?key=x", "v1.2"), ("s3://bucket", "bucket"),
    ],
)  # fmt: skip
def test_results_of_several_recordings_are_named_after_all_of_the_last_part(tmp_path, monkeypatch, source, name):
    (tmp_path / "here" / "fleet").mkdir(parents=True)
    (tmp_path / "here" / "fleet.txt").write_text("fleet\n")
    monkeypatch.chdir(tmp_path / "here")
    assert name_of(source) == name


@pytest.mark.parametrize("n", [1, 3, 16])
def test_shards_share_out_every_recording_once(tmp_path, n):
    for k in range(7):
        write_log(tmp_path / f"log{k}")
    found = find_all(str(tmp_path))
    shards = [take_shard(found, parse_shard(f"{i}/{n}")) for i in range(n)]
    assert sorted(recording.name for shard in shards for recording in shard) == [f"log{k}" for k in range(7)]
    assert max(map(len, shards)) - min(map(len, shards)) <= 1


@pytest.mark.parametrize("text", ["3", "3/3", "-1/3", "a/b", "1/0", "/"])
def test_a_shard_that_is_none_is_told(text):
    with pytest.raises(InputError, match="write i/n with i from 0"):
        parse_shard(text)


def test_a_url_is_shown_without_its_secrets():
    from automos.fleet.storage import shown

    assert shown("https://me:pass@host.org/logs/a.mcap?sig=secret") == "https://host.org/logs/a.mcap"
    assert shown("s3://bucket/logs") == "s3://bucket/logs"
    assert shown("logs/a?b") == "logs/a?b"
