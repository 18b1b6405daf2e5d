"""Copies of what lies in a store: whole or not there, bounded, shared, and the same recording whenever fetched."""

import sys
import threading
import time
from pathlib import Path

import pytest

from automos.core.errors import InputError
from automos.fleet.cache import Cache, _take

fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed: pip install '.[scale]'")

MB = 10**6


@pytest.fixture
def store():
    """Return the files of a store in memory with three recordings of a megabyte in two files each."""
    files = fsspec.filesystem("memory")
    if files.exists("/bucket"):
        files.rm("/bucket", recursive=True)
    for name in "abc":
        for i in range(2):
            files.pipe_file(f"/bucket/{name}/{i:06d}.bin", name.encode() * (MB // 2))
    return files


def copies(folder: Path) -> set[str]:
    return {path.parent.name + "/" + path.name for path in folder.glob("*/*/*.bin") if path.stat().st_size == MB // 2}


def test_a_copy_is_what_lies_in_the_store_under_the_same_names(store, tmp_path):
    cache = Cache(tmp_path, 10 * MB)
    with cache.copy_of("memory://bucket/a") as path:
        assert path.name == "a"
        assert (path / "000001.bin").read_bytes() == b"a" * (MB // 2)
    with cache.copy_of("memory://bucket/a/000000.bin") as path:
        assert path.name == "000000.bin"
        assert path.read_bytes() == b"a" * (MB // 2)


def test_what_is_here_is_not_fetched_again_and_what_changed_is(store, tmp_path, monkeypatch):
    from automos.fleet import storage

    fetched, get = [], storage.Store.get
    monkeypatch.setattr(storage.Store, "get", lambda self, path, local: fetched.append(path) or get(self, path, local))
    cache = Cache(tmp_path, 10 * MB)
    for _ in range(2):
        with cache.copy_of("memory://bucket/a"):
            pass
    assert len(fetched) == 2
    before = cache.stamp_of("memory://bucket/a")
    store.pipe_file("/bucket/a/000001.bin", b"x" * 7)
    assert cache.stamp_of("memory://bucket/a") != before
    with cache.copy_of("memory://bucket/a") as path:
        assert (path / "000001.bin").read_bytes() == b"x" * 7
    assert len(fetched) == 4


def test_a_recording_fetched_twice_has_the_same_fingerprint(store, tmp_path):
    times = []
    for k in range(2):
        with Cache(tmp_path / str(k), 10 * MB).copy_of("memory://bucket/a") as path:
            times.append([file.stat().st_mtime_ns for file in sorted(path.iterdir())])
        time.sleep(0.05)
    assert times[0] == times[1]


def test_copies_unused_for_longest_make_room(store, tmp_path):
    cache = Cache(tmp_path, int(2.5 * MB))
    for name in "abac":
        with cache.copy_of(f"memory://bucket/{name}"):
            pass
        time.sleep(0.02)
    assert copies(tmp_path) == {"a/000000.bin", "a/000001.bin", "c/000000.bin", "c/000001.bin"}


def test_a_copy_that_is_read_stays_and_who_needs_its_room_waits(store, tmp_path):
    cache = Cache(tmp_path, int(1.5 * MB))
    got = []

    def other() -> None:
        with Cache(tmp_path, int(1.5 * MB)).copy_of("memory://bucket/b") as path:
            got.append(path.name)

    with cache.copy_of("memory://bucket/a") as path:
        waiting = threading.Thread(target=other)
        waiting.start()
        time.sleep(0.7)
        assert got == []
        assert len(list(path.iterdir())) == 2
    waiting.join(timeout=10)
    assert got == ["b"]
    assert copies(tmp_path) == {"b/000000.bin", "b/000001.bin"}


def test_several_read_one_copy_at_a_time(store, tmp_path):
    cache = Cache(tmp_path, int(1.5 * MB))
    with cache.copy_of("memory://bucket/a") as one, Cache(tmp_path, MB * 2).copy_of("memory://bucket/a") as other:
        assert one == other


def test_a_copy_cut_off_half_way_does_not_count(store, tmp_path, monkeypatch):
    from automos.fleet import storage

    get = storage.Store.get

    def cut(self, path, local):
        get(self, path, local)
        if path.endswith("1.bin"):
            raise OSError("the connection is gone")

    with monkeypatch.context() as broken:
        broken.setattr(storage.Store, "get", cut)
        with pytest.raises(OSError, match="the connection"), Cache(tmp_path, 3 * MB).copy_of("memory://bucket/a"):
            pass
    with Cache(tmp_path, 3 * MB).copy_of("memory://bucket/a") as path:
        assert [file.stat().st_size for file in sorted(path.iterdir())] == [MB // 2] * 2


def test_what_is_larger_than_the_cache_or_not_there_is_told(store, tmp_path):
    with (
        pytest.raises(InputError, match="give more with --cache"),
        Cache(tmp_path, MB // 2).copy_of("memory://bucket/a"),
    ):
        pass
    with pytest.raises(InputError, match="holds nothing"), Cache(tmp_path, MB).copy_of("memory://bucket/z"):
        pass


def test_where_files_cannot_be_locked_that_is_told(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)
    with (tmp_path / "lock").open("w") as lock, pytest.raises(InputError, match="copy the recordings to a disk"):
        _take(lock, wait=False)
