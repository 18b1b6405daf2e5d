import errno
import os
import shutil
import zipfile

import numpy as np
import pytest

from automos.core.errors import InputError
from automos.core.stages import fingerprint
from automos.core.workspace import RUN_FILE, Workspace

ARRAYS = {"a": np.arange(6).reshape(2, 3), "b": np.array("text"), "c": np.zeros((0, 3), np.float32)}


@pytest.fixture(params=["memory", "folder"])
def workspace(request, tmp_path):
    """Return a workspace of each kind."""
    return Workspace(tmp_path / "run" if request.param == "folder" else None)


def assert_same(loaded, saved):
    assert loaded.keys() == saved.keys()
    for name, array in saved.items():
        np.testing.assert_array_equal(loaded[name], array)
        assert loaded[name].dtype == array.dtype


def test_what_is_saved_is_loaded(workspace):
    stage = workspace.stage("labels", "k")
    stage.save("000001", ARRAYS)
    assert_same(stage.load("000001"), ARRAYS)
    assert_same(workspace.stage("labels", "k").load("000001"), ARRAYS)


def test_a_stage_knows_what_was_saved(workspace):
    stage = workspace.stage("labels", "k")
    stage.save("b", ARRAYS)
    assert stage.has("b")
    assert not stage.has("a")


def test_results_of_other_stages_and_other_fingerprints_are_not_seen(workspace):
    workspace.stage("labels", "k").save("a", ARRAYS)
    assert not workspace.stage("labels", "other").has("a")
    assert not workspace.stage("tracks", "k").has("a")


def test_saving_again_replaces(workspace):
    stage = workspace.stage("labels", "k")
    stage.save("a", ARRAYS)
    stage.save("a", {"a": np.ones(2)})
    assert_same(stage.load("a"), {"a": np.ones(2)})


@pytest.mark.parametrize("name", ["a" * 231, "\N{SNOWMAN}" * 77, "a/b", "../a", ".", "", "a\0b", "\udcff"], ids=ascii)
def test_a_name_that_no_file_can_have_is_told_before_anything_is_kept(tmp_path, name):
    Workspace().require_names([name, "b"], 2)  # in memory any will do
    with pytest.raises(InputError, match=r"a scan is named .* results are files of that name"):
        Workspace(tmp_path / "run").require_names(["b", name], 2)
    Workspace(tmp_path / "run").require_names(["a" * 230, "\N{SNOWMAN}" * 76, "..b", "a b"], 4)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["a", "a"], "two scans are named 'a'"),
        *((names, "a text for each scan") for names in (["a"], [1, 2], "ab", None)),
    ],
)
def test_names_that_tell_no_scan_from_another_are_told(workspace, names, message):
    with pytest.raises(InputError, match=message):
        workspace.require_names(names, 2)


def test_a_folder_is_made_only_when_a_stage_is_asked_for(tmp_path):
    workspace = Workspace(tmp_path / "run")
    assert workspace.read_run() == {}
    workspace.keep_only({})
    assert not (tmp_path / "run").exists()


def test_only_the_stages_of_the_present_run_are_kept(tmp_path):
    workspace = Workspace(tmp_path)
    for name, key in (("odometry", "1"), ("labels", "1"), ("labels", "2")):
        workspace.stage(name, key).save("a", ARRAYS)
    workspace.keep_only({"odometry": "1", "labels": "2"})
    assert sorted(path.name for path in (tmp_path / "stages").iterdir()) == ["labels-2", "odometry-1"]
    assert workspace.stage("labels", "2").has("a")


@pytest.mark.parametrize("function", ["numpy.savez", "os.replace"])
def test_a_full_disk_leaves_what_was_saved_and_nothing_half_written(tmp_path, monkeypatch, function):
    stage = Workspace(tmp_path).stage("labels", "k")
    stage.save("a", ARRAYS)

    def fill(file, *args, **kwargs):
        if function == "numpy.savez":
            file.write(b"half of it")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(function, fill)
    for name in ("a", "b"):
        with pytest.raises(InputError, match="No space left on device"):
            stage.save(name, {"a": np.ones(3)})
    assert_same(stage.load("a"), ARRAYS)
    assert not stage.has("b")
    assert [path.name for path in (tmp_path / "stages" / "labels-k").iterdir()] == ["a.npz"]


def test_halves_of_files_that_a_killed_run_left_are_removed(tmp_path):
    workspace = Workspace(tmp_path)
    workspace.stage("labels", "k").save("a", ARRAYS)
    folder = tmp_path / "stages" / "labels-k"
    (folder / ".b.npz.0123abcd.part").write_bytes(b"half")
    workspace.keep_only({"labels": "k"})
    assert [path.name for path in folder.iterdir()] == ["a.npz"]


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut", b"no archive at all"], ids=["empty", "cut", "other"])
def test_a_damaged_file_of_a_stage_is_told_with_what_to_delete(tmp_path, content):
    stage = Workspace(tmp_path).stage("labels", "k")
    stage.save("a", ARRAYS)
    (tmp_path / "stages" / "labels-k" / "a.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.npz is damaged .*: delete .*labels-k and repeat") as error:
        stage.load("a")
    assert "\n" not in str(error.value)


def test_an_array_that_a_file_of_a_stage_does_not_hold_is_told(tmp_path):
    stage = Workspace(tmp_path).stage("labels", "k")
    stage.save("a", {"b": ARRAYS["b"]})
    for load in (lambda: stage.load("a")["a"], lambda: stage.load("a", "a")):
        with pytest.raises(InputError, match=r"a\.npz is damaged .*: delete .*labels-k and repeat"):
            load()


@pytest.mark.parametrize("change", ["another value", "another scan's", "another stage's", "none of ours"])
def test_a_whole_file_that_is_not_what_was_saved_there_is_told(tmp_path, change):
    stage, folder = Workspace(tmp_path).stage("labels", "k"), tmp_path / "stages" / "labels-k"
    for name in ("a", "b"):
        stage.save(name, ARRAYS)
    if change == "another value":
        with zipfile.ZipFile(folder / "a.npz") as archive:
            seal = archive.comment
        np.savez(folder / "a.npz", **{**ARRAYS, "a": ARRAYS["a"] + 1})
        with zipfile.ZipFile(folder / "a.npz", "a") as archive:
            archive.comment = seal
    elif change == "none of ours":
        np.savez(folder / "a.npz", **ARRAYS)
    else:
        Workspace(tmp_path).stage("tracks", "k").save("a", ARRAYS)
        other = folder / "b.npz" if change == "another scan's" else tmp_path / "stages" / "tracks-k" / "a.npz"
        shutil.copyfile(other, folder / "a.npz")
    with pytest.raises(InputError, match=r"a\.npz is damaged .*: delete .*labels-k and repeat"):
        stage.load("a")
    assert_same(stage.load("b"), ARRAYS)


def test_an_array_whose_header_is_no_text_is_told(tmp_path):
    # numpy's own parser of it ends with an error of Python's tokens
    stage = Workspace(tmp_path).stage("labels", "k")
    stage.save("a", ARRAYS)
    path = tmp_path / "stages" / "labels-k" / "a.npz"
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data.replace(b"), }", b"\x00(, "))
    with pytest.raises(InputError, match=r"a\.npz is damaged"):
        stage.load("a")


@pytest.mark.parametrize("place", ["run", "run/inside"])
def test_a_place_that_is_a_file_is_told(tmp_path, place):
    (tmp_path / "run").write_text("I am a file")
    with pytest.raises(InputError, match="choose another --out"):
        Workspace(tmp_path / place).stage("labels", "k")


@pytest.mark.parametrize(
    "text",
    ["", "{", "[1]", "null", "3", "\xff", '{"odometry": {"wall": NaN}}', '{"odometry": {"wall": 1e400}}'],
    ids=["empty", "cut", "list", "null", "3", "?", "nan", "beyond"],
)
def test_a_damaged_run_file_counts_as_none(tmp_path, text):
    (tmp_path / RUN_FILE).write_bytes(text.encode("latin-1"))
    assert Workspace(tmp_path).read_run() == {}


def test_a_run_file_is_read(tmp_path):
    (tmp_path / RUN_FILE).write_text('{"fingerprint": "k"}')
    assert Workspace(tmp_path).read_run() == {"fingerprint": "k"}


@pytest.mark.parametrize(
    ("one", "other"),
    [(("a", "b"), ("ab",)), (("a",), ("b",)), ((1, None), (None, 1)), (({"a": 1.0},), ({"a": 1.0001},))],
)
def test_fingerprints_differ_where_their_parts_do(one, other):
    assert fingerprint(*one) == fingerprint(*one)
    assert fingerprint(*one) != fingerprint(*other)
    assert len(fingerprint(*one)) == 16


def test_fingerprints_do_not_depend_on_the_order_of_keys():
    assert fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})
