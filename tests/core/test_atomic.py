import errno
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from automos.core.atomic import atomic_path, remove_parts, write_npy, write_raw, write_text
from automos.core.errors import InputError


def full_disk(*_args, **_kwargs):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def write_half(file, then):
    """Write a part of `file`, then do `then`."""
    with atomic_path(file) as temporary:
        temporary.write_text("half")
        then()


def raiser(error):
    def fail():
        raise error

    return fail


@pytest.fixture
def file(tmp_path):
    """Return a file that was there before."""
    (tmp_path / "a.txt").write_text("old")
    return tmp_path / "a.txt"


def test_a_file_is_replaced_only_when_it_is_whole(file):
    with atomic_path(file) as temporary:
        temporary.write_text("ne")
        assert file.read_text() == "old"
        temporary.write_text("new")
    assert file.read_text() == "new"
    assert [path.name for path in file.parent.iterdir()] == ["a.txt"]


def test_the_temporary_file_lies_beside_the_file_and_is_hidden(file):
    with atomic_path(file) as temporary:
        assert temporary.parent == file.parent  # a rename is atomic within a file system only
        assert temporary.name.startswith(".")
        temporary.write_text("")


def test_a_device_a_pipe_a_stream_or_a_folder_is_not_replaced_by_a_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "null").symlink_to("/dev/null")
    (tmp_path / "stdout").symlink_to("/proc/self/fd/1")
    for name in ("pipe", "folder", "null", "stdout"):
        with pytest.raises(InputError, match=f"{name} is a folder, a device or the like: give the name of a file"):
            write_text(tmp_path / name, "scores")
    assert {path.name for path in tmp_path.iterdir() if not path.is_file()} >= {"pipe", "folder"}
    assert (tmp_path / "null").is_symlink()


@pytest.mark.parametrize("error", [ValueError("a bug"), KeyboardInterrupt()], ids=["bug", "Ctrl-C"])
def test_whatever_ends_the_block_early_leaves_the_old_file_and_nothing_else(file, error):
    with pytest.raises(type(error)):
        write_half(file, raiser(error))
    assert file.read_text() == "old"
    assert [path.name for path in file.parent.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("where", ["writing", "moving"])
def test_a_full_disk_is_one_sentence_and_leaves_the_old_file_and_nothing_else(file, monkeypatch, where):
    if where == "moving":
        monkeypatch.setattr(os, "replace", full_disk)
    with pytest.raises(InputError, match=r"a\.txt could not be written \(No space left on device\)") as caught:
        write_half(file, full_disk if where == "writing" else int)
    assert "\n" not in str(caught.value)
    assert file.read_text() == "old"
    assert [path.name for path in file.parent.iterdir()] == ["a.txt"]


def test_a_folder_that_is_not_there_is_one_sentence(tmp_path):
    with pytest.raises(InputError, match="could not be written"):
        write_text(tmp_path / "nowhere" / "a.txt", "text")


def test_text_is_written_whole(file):
    write_text(file, "grün\n")
    assert file.read_text(encoding="utf-8") == "grün\n"


def test_halves_of_files_that_a_killed_process_left_are_removed_and_nothing_else(file):
    with atomic_path(file) as temporary:
        temporary.write_text("new")
    temporary.write_text("half")  # as SIGKILL leaves it
    remove_parts(file.parent)
    assert [path.name for path in file.parent.iterdir()] == ["a.txt"]


def test_texts_are_utf_8_whatever_the_system_speaks(tmp_path):
    text = "Überfahrt · 3 m/s ❚❚"
    code = f"from automos.core.atomic import write_text; from pathlib import Path; write_text(Path('a.txt'), {text!a})"
    plain = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "utf-8"}
    subprocess.run([sys.executable, "-X", "utf8=0", "-c", code], cwd=tmp_path, env=plain, check=True)
    assert (tmp_path / "a.txt").read_text(encoding="utf-8") == text


@pytest.mark.parametrize("name", ["", ".", "..", "/"])
def test_what_has_no_name_of_a_file_is_told(name):
    with pytest.raises(InputError, match="give the name of a file"):
        write_text(Path(name), "text")


@pytest.mark.parametrize("write", [write_raw, write_npy])
@pytest.mark.parametrize("n", [6, 2100])
def test_numbers_that_a_full_disk_takes_in_part_are_told_and_not_there(tmp_path, write, n):
    resource = pytest.importorskip("resource")
    numbers = np.arange(n, dtype=np.uint32)
    write(tmp_path / "a", numbers)
    size = (tmp_path / "a").stat().st_size
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size - 3, before[1]))  # no file may have more bytes
    try:
        with pytest.raises(InputError, match="b could not be written"):
            write(tmp_path / "b", numbers)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_numbers_are_written_as_they_lie_in_memory(tmp_path):
    rows = np.arange(12.0, dtype=np.float32).reshape(4, 3)[:, ::-1]
    write_raw(tmp_path / "a.bin", rows)
    write_npy(tmp_path / "a.npy", rows)
    write_raw(tmp_path / "none.bin", rows[:0])
    assert np.fromfile(tmp_path / "a.bin", np.float32).tolist() == rows.ravel().tolist()
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), rows)
    assert (tmp_path / "none.bin").stat().st_size == 0


def test_two_who_write_one_file_at_a_time_do_not_write_into_each_other(file):
    with (
        atomic_path(file) as one,
        atomic_path(file) as other,
    ):  # two threads, or containers whose processes have one number
        one.write_text("one, which is longer")
        other.write_text("other")
    assert file.read_text() == "one, which is longer"
