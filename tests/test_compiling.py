"""The first run compiles in several processes; later ones find everything there."""

import importlib.util
import os
import subprocess
import sys
import time

import psutil
import pytest

from automos import compiling
from automos.compiling import ANEW, LINE, SHARES, compiling_beside
from automos.objects import object_points

AFTER = """
from automos import compiling

print(compiling.is_cold())
compiling.compile_all()
"""


@pytest.mark.slow
def test_the_shares_together_compile_all_that_labelling_needs(tmp_path):
    cache = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    for some in [SHARES] if sys.platform == "linux" else [(share,) for share in SHARES]:
        subprocess.run([sys.executable, "-m", "automos.compiling", *some], env=cache, check=True)
    there = set(tmp_path.rglob("*.nbc"))
    assert len(there) > 50
    run = subprocess.run([sys.executable, "-c", AFTER], env=cache, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False"]
    assert sorted(set(tmp_path.rglob("*.nbc")) - there) == []


@pytest.mark.parametrize(("is_cold", "cores", "starts"), [(True, 2, True), (True, 1, False), (False, 2, False)])
def test_other_processes_are_started_only_where_they_help(monkeypatch, is_cold, cores, starts):
    started, said = [], []

    class Process:
        def __init__(self, command, **options):
            started.append(command)

        def poll(self):
            return 0

    monkeypatch.setattr(compiling, "is_cold", lambda: is_cold)
    monkeypatch.setattr(compiling, "available_cores", lambda: cores)
    monkeypatch.setattr(compiling.subprocess, "Popen", Process)
    with compiling_beside(said.append, ("candidates", "objects")):
        assert [share for command in started for share in command[3:]] == (["candidates", "objects"] if starts else [])
    assert said == ([LINE] if is_cold else [])


@pytest.mark.skipif(sys.platform != "linux", reason="processes part on Linux only")
def test_processes_that_compile_end_with_the_one_that_started_them(tmp_path):
    cache = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    first = subprocess.Popen([sys.executable, "-m", "automos.compiling", "candidates", "objects"], env=cache)
    children = psutil.Process(first.pid).children
    end = time.monotonic() + 60
    while len(parts := children()) < 2 and time.monotonic() < end:
        time.sleep(0.1)
    first.terminate()
    assert first.wait(60) == 1
    assert [part for part in parts if part.is_running() and part.status() != psutil.STATUS_ZOMBIE] == []
    assert len(parts) == 2


def test_a_run_is_cold_as_long_as_numba_finds_nothing_of_this_source(monkeypatch, tmp_path):
    source = tmp_path / "small.py"
    source.write_text("import numba\n\n\n@numba.njit(cache=True)\ndef one_more(x):\n    return x + 1\n")

    def is_cold():  # in a process that starts now
        spec = importlib.util.spec_from_file_location("small", source)
        spec.loader.exec_module(module := importlib.util.module_from_spec(spec))
        monkeypatch.setattr(object_points, "_around", module.one_more)
        return compiling.is_cold()

    assert is_cold()
    assert object_points._around(1) == 2
    assert not is_cold()
    for kept in tmp_path.rglob("*.nb[ic]"):  # copied from elsewhere, with the times of then
        os.utime(kept, (0, 0))
    assert not is_cold()
    source.write_text(source.read_text().replace("x + 1", "x + 1 + 0"))
    assert is_cold()


def test_where_numba_does_not_compile_nothing_is_cold(monkeypatch):
    monkeypatch.setattr(object_points, "_around", lambda: None)
    assert not compiling.is_cold()


NOWHERE = """
from numba.core.caching import CacheImpl

CacheImpl._locator_classes = []  # as where neither the source's folder nor the user's home can be written
import numpy as np
from automos import compiling
from automos.core import geometry

with compiling.compiling_beside(print, ("candidates",)):
    print(geometry.transform(np.eye(4), np.ones((1, 3))).tolist())
"""


def test_where_nothing_can_be_kept_everything_works_and_is_compiled_anew():
    done = subprocess.run([sys.executable, "-c", NOWHERE], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [ANEW, "[[1.0, 1.0, 1.0]]"]
