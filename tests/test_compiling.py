"""The first run compiles in two processes; later ones find everything there."""

import os
import subprocess
import sys

import pytest

from automos import compiling
from automos.compiling import LINE, compiling_beside

FRESH = """
import sys
from automos import compiling

print(compiling.is_cold())
compiling.compile_all(knows_poses=True)
print(compiling.is_cold())
"""


def test_once_compiled_it_is_not_cold_any_more_and_what_labels_is_in_the_cache(tmp_path):
    cache = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    run = subprocess.run([sys.executable, "-c", FRESH], env=cache, capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["True", "False"]
    kept = {path.name.partition("-")[0] for path in tmp_path.rglob("*.nbi")}
    assert {"free_space_vote.look_through", "segments._segment", "boxes._fit", "completion._fill"} <= kept


@pytest.mark.parametrize(("is_cold", "cores", "starts"), [(True, 2, True), (True, 1, False), (False, 2, False)])
def test_a_second_process_is_started_only_where_it_helps(monkeypatch, is_cold, cores, starts):
    started, said = [], []

    class Process:
        def __init__(self, command, **options):
            started.append(command)

        def poll(self):
            return 0

    monkeypatch.setattr(compiling, "is_cold", lambda: is_cold)
    monkeypatch.setattr(compiling, "available_cores", lambda: cores)
    monkeypatch.setattr(compiling.subprocess, "Popen", Process)
    with compiling_beside(said.append, knows_poses=True):
        assert bool(started) == starts
    assert said == ([LINE] if is_cold else [])
