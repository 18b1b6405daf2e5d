"""A library that does not come back from a damaged file costs a sentence, not the process, or at worst both."""

import hashlib
import itertools
import os
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from forks import in_a_fork

from automos.core.errors import InputError
from automos.readers import foreign
from automos.readers.foreign import limited


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(foreign, "PATIENCE", 0.2)
    monkeypatch.setattr(foreign, "TICK", 0.05)


def spin():
    for _ in itertools.count():
        pass


def spin_and_swallow_errors():
    while True:
        try:
            spin()
        except Exception:
            continue


def compiled(seconds):
    """Keep a core busy in compiled code, which nothing interrupts."""
    end = time.process_time() + seconds
    began = time.process_time()
    hashlib.pbkdf2_hmac("sha256", b"", b"", rounds := 200_000)
    per_round = (time.process_time() - began) / rounds
    hashlib.pbkdf2_hmac("sha256", b"", b"", max(int((end - time.process_time()) / per_round), 1))


@pytest.mark.parametrize("library", [spin, spin_and_swallow_errors])
def test_a_loop_without_end_is_told_as_damage(impatient, tmp_path, library):
    began = time.monotonic()
    with pytest.raises(InputError, match=r"log\.laz keeps its reader busy without end"), limited(tmp_path / "log.laz"):
        library()
    assert time.monotonic() - began < 20.0
    with limited(tmp_path / "next.laz"):
        assert sum(range(1000)) == 499500  # the next call is not the last one's heir


def test_a_call_that_comes_back_just_too_late_is_told_and_nothing_is_left_of_it(impatient, tmp_path):
    with pytest.raises(InputError, match="without end"), limited(tmp_path / "slow"):
        compiled(3.0)
    for _ in range(100_000):
        pass


def test_a_call_that_waits_for_its_turn_is_not_told_as_busy(impatient, tmp_path):
    with limited(tmp_path / "whole"):
        time.sleep(1.0)


def test_threads_have_time_of_their_own(impatient, tmp_path):
    found = []

    def wait_for(library):
        try:
            with limited(tmp_path / library.__name__):
                library()
        except InputError as error:
            found.append(str(error))

    threads = [threading.Thread(target=wait_for, args=(library,)) for library in (spin, time.time, spin)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=30)
    assert len(found) == 2
    assert all("spin keeps" in sentence for sentence in found)


def test_a_larger_file_has_more_time(impatient, tmp_path, monkeypatch):
    monkeypatch.setattr(foreign, "SLOWEST", 1e4)
    (tmp_path / "large").write_bytes(bytes(20_000))
    with limited(tmp_path / "large"):
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            pass


def test_within_the_block_no_more_memory_is_to_be_had_than_the_machine_has(tmp_path):
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_DATA)
    total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    with limited(tmp_path / "bomb"), pytest.raises(MemoryError):
        np.empty(2 * total, np.uint8)
    assert resource.getrlimit(resource.RLIMIT_DATA) == before


def test_under_the_command_line_what_never_comes_back_ends_with_a_sentence_and_code_2(tmp_path):
    code = (
        "import hashlib\n"
        "from pathlib import Path\n"
        "from automos.readers import foreign\n"
        "foreign.PATIENCE, foreign.GRACE, foreign.TICK = 0.2, 0.3, 0.05\n"
        "with foreign.limited(Path('log.pcap')):\n"
        "    hashlib.pbkdf2_hmac('sha256', b'', b'', 10**9)\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "AUTOMOS_COMMAND": "1"},
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert run.returncode == 2
    assert run.stderr == "error: log.pcap keeps its reader busy without end; it is damaged: copy it again\n"


def test_the_limit_costs_nothing_that_could_be_felt(tmp_path):
    took = []
    for _ in range(200):
        began = time.perf_counter()
        with limited(tmp_path / "log.laz"):
            pass
        took.append(time.perf_counter() - began)
    assert min(took) < 1e-3  # beside other work on the same machine


def test_a_fork_does_not_wait_for_a_thread_that_it_does_not_have(tmp_path):
    def read():
        with limited(tmp_path / "log.mcap"):
            pass

    with foreign._gate:  # as the watcher holds it for a moment every second
        in_a_fork(read)


def test_a_fork_within_a_call_has_limits_of_its_own(tmp_path):
    def read():
        foreign.PATIENCE, foreign.TICK = 0.2, 0.05  # of the fork alone
        with pytest.raises(InputError, match="without end"), limited(tmp_path / "log.mcap"):
            spin()

    with limited(tmp_path / "outer"):
        in_a_fork(read)
