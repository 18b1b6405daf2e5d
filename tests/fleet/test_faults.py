"""Everything that fails on shared machines, while thirty recordings are labelled: nothing is lost, nothing is wrong."""

import os
import random
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from automos.fleet.label import Resources, label_fleet
from automos.fleet.local_pool import LocalPool
from automos.fleet.publishing import MARKER
from automos.fleet.sources import find_all
from automos.fleet.status import read_status

pytestmark = pytest.mark.slow


def label(fleet, out, work, executor):
    resources = Resources(work=work)
    return label_fleet(
        find_all(str(fleet.folder)), str(out), fleet.settings, resources, executor=lambda resources: executor
    )


def test_workers_killed_at_random_cost_time_and_no_label(make_fleet, tmp_path):
    fleet, pool, rng, killed, is_over = make_fleet(30), LocalPool(2, 2), random.Random(0), [], threading.Event()

    def kill() -> None:
        while not is_over.wait(rng.uniform(0.0, 0.5)):
            n_done = len(list((tmp_path / "out").glob(f"*/{MARKER}")))
            if pool.pids and n_done >= 3 * len(killed):
                killed.append(rng.choice(pool.pids))
                os.kill(killed[-1], 9)

    killer = threading.Thread(target=kill)
    killer.start()
    outcome = label(fleet, tmp_path / "out", tmp_path / "work", pool)
    is_over.set()
    killer.join()
    assert len(killed) >= 5
    assert sorted([*outcome.labelled, *outcome.failed]) == fleet.names
    assert fleet.differences(tmp_path / "out") == sorted(outcome.failed)
    for name, reason in outcome.failed.items():
        assert reason.startswith("its worker was killed (SIGKILL")
        assert not (tmp_path / "out" / name / MARKER).exists()
    assert sorted([*label(fleet, tmp_path / "out", tmp_path / "work", LocalPool(2, 2)).labelled]) == sorted(
        outcome.failed
    )
    assert fleet.differences(tmp_path / "out") == []


def test_a_run_killed_whole_goes_on_where_it_stopped(make_fleet, tmp_path):
    fleet = make_fleet(30)
    command = [sys.executable, "-c", "from automos.cli import main; main()", "label", str(fleet.folder)]
    command += ["--out", str(tmp_path / "out"), "--workers", "2", "--work", str(tmp_path / "work")]
    run = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    while len(list((tmp_path / "out").glob(f"*/{MARKER}"))) < 5:
        assert run.poll() is None
        time.sleep(0.1)
    run.kill()
    run.wait()
    assert 5 <= len(list((tmp_path / "out").glob(f"*/{MARKER}"))) < 30
    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "30 of 30 recordings labelled (" in again.stdout
    assert fleet.differences(tmp_path / "out") == []


@pytest.fixture
def small_disk(tmp_path):
    """Return a folder on a file system of two megabytes, and a function that makes it large."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(disk)]
    try:
        done = subprocess.run(mount, capture_output=True, check=False).returncode
    except OSError:
        done = 1
    if done:
        pytest.skip("mounting a small disk needs more rights")
    grow = ["mount", "-o", "remount,size=500m", str(disk)]
    yield disk, lambda: subprocess.run(grow, check=True)
    subprocess.run(["umount", "--lazy", str(disk)], check=True)


def test_on_a_disk_that_fills_up_what_is_labelled_is_right_and_the_rest_is_told(make_fleet, small_disk, tmp_path):
    fleet, (disk, grow) = make_fleet(6), small_disk
    outcome = label(fleet, disk / "out", tmp_path / "work", LocalPool(2, 2))
    assert outcome.failed
    assert sorted([*outcome.labelled, *outcome.failed]) == fleet.names
    for reason in outcome.failed.values():
        assert "No space left on device" in reason or "could not be written" in reason, reason
    assert set(fleet.differences(disk / "out")) <= set(outcome.failed)
    assert {path.parent.name for path in (disk / "out").glob(f"*/{MARKER}")} == set(outcome.labelled)
    grow()
    assert sorted(label(fleet, disk / "out", tmp_path / "work", LocalPool(2, 2)).labelled) == sorted(outcome.failed)
    assert fleet.differences(disk / "out") == []
    assert read_status(str(disk / "out")).count("done") == 6


def test_every_recording_that_is_not_labelled_is_listed_and_the_code_is_3(make_fleet, tmp_path):
    fleet, logs = make_fleet(3), tmp_path / "logs"
    logs.mkdir()
    for name in fleet.names:
        (logs / name).symlink_to(fleet.folder / name)
    (logs / "cut").mkdir()
    for path in sorted((fleet.folder / "log00").iterdir()):
        Path(logs / "cut" / path.name).write_bytes(path.read_bytes()[:-5])
    command = [sys.executable, "-c", "from automos.cli import main; main()", "label", str(logs), "--out", str(tmp_path)]
    ended = subprocess.run([*command, "--workers", "2"], capture_output=True, text=True, check=False)
    assert ended.returncode == 3
    assert "3 of 4 recordings labelled" in ended.stdout
    assert [line[:17] for line in ended.stdout.splitlines()[1:]] == ["3 of them with wa", "not labelled: cut"]
