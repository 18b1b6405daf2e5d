"""Kills, files that may not grow, and races while one recording is labelled, merged, exported: reruns are the same."""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from worlds import lane, write_bins

from automos.core.claims import RESULTS, claim

STAGES = ("odometry", "candidates", "instances", "tracking", "labels")
resource = pytest.importorskip("resource", reason="this system limits no file's size")
pytestmark = pytest.mark.slow
COMMAND = (sys.executable, "-c", "from automos.cli import main; main()")
FILES = ("predictions/*.label", "poses.txt", "poses.tum", "tracks.json", "settings.yaml")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Return a small recording, and the bytes of its results."""
    folder = tmp_path_factory.mktemp("faults")
    write_bins(lane().sequence, folder / "log")
    start("label", folder / "log", "--out", folder / "run", "--workers", "1").communicate(timeout=500)
    return folder / "log", contents(folder / "run")


def start(*words, **options):
    return subprocess.Popen(
        [*COMMAND, *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options
    )


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for pattern in FILES for p in sorted(folder.glob(pattern))}


def label_to_its_end(recording, out):
    ended = start("label", recording, "--out", out, "--workers", "1")
    _, said = ended.communicate(timeout=500)
    assert ended.returncode == 0, said
    return contents(out)


def is_taken_for_results(out, recording):
    """Return whether a later command reads what lies in `out` as results."""
    read = start("export", out, recording, "--to", "ply", "--out", out.parent / "exported")
    read.communicate(timeout=500)
    return read.returncode == 0


def test_runs_killed_at_any_moment_go_on_to_the_same_bytes(log, tmp_path):
    recording, wanted = log
    began = time.monotonic()
    label_to_its_end(recording, tmp_path / "whole")
    lasts, rng = time.monotonic() - began, random.Random(0)
    for k in range(4):
        out, n_killed = tmp_path / f"run{k}", 0
        for _ in range(2):
            killed = start("label", recording, "--out", out, "--workers", "1")
            time.sleep(rng.uniform(0.3, 1.0) * lasts)
            killed.kill()
            killed.communicate()
            n_killed += killed.returncode == -signal.SIGKILL
            if out.exists() and not (out / "run.json").exists():
                assert not is_taken_for_results(out, recording)
        assert label_to_its_end(recording, out) == wanted
        assert not list(out.rglob("*.part")) or n_killed == 0


@pytest.mark.parametrize("n", [1, 20])
def test_what_others_put_into_a_run_stays_whatever_is_killed_in_it(log, tmp_path, n):
    """Results on another disk through links, notes among them, kills at any moment, other settings each time."""
    recording, wanted = log
    out, disk, rng = tmp_path / "run", tmp_path / "disk", random.Random(n)
    label_to_its_end(recording, out)
    claim(disk, RESULTS)  # a person says that this is for our results, too
    for name in ("stages", "predictions"):
        shutil.move(out / name, disk / name)
        (out / name).symlink_to(disk / name)
    notes = [out / "notes.txt", disk / "stages/notes/a.npz", disk / "predictions/notes.txt", disk / "thesis/a.tex"]
    for note in notes:
        note.parent.mkdir(parents=True, exist_ok=True)
        note.write_text("mine")
    for k in range(n):
        other = ("--set", f"tracking.max_misses={2 + k % 3}")
        killed = start("label", recording, "--out", out, "--workers", "1", *other)
        with contextlib.suppress(subprocess.TimeoutExpired):
            killed.communicate(timeout=rng.uniform(2.0, 12.0))
        killed.kill()
        killed.communicate()
        assert [note.read_text() for note in notes] == ["mine"] * len(notes)
    assert label_to_its_end(recording, out) == wanted
    assert [note.read_text() for note in notes] == ["mine"] * len(notes)
    assert len(list((disk / "stages").glob("*-*"))) == len(STAGES)


@pytest.mark.parametrize("size", [1_000, 20_000, 60_000, 200_000])
def test_where_files_may_not_grow_a_sentence_is_told_and_the_rerun_is_the_same(log, tmp_path, size):
    recording, wanted = log

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # writing fails, as on a disk that is full
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    full = start("label", recording, "--out", tmp_path / "run", "--workers", "1", preexec_fn=limit)
    _, said = full.communicate(timeout=500)
    assert full.returncode in (0, 2)
    if full.returncode == 2:
        assert said.count("error: ") == 1
        assert "Traceback" not in said
        assert not is_taken_for_results(tmp_path / "run", recording)
    assert label_to_its_end(recording, tmp_path / "run") == wanted


def test_of_two_that_write_into_one_folder_one_is_told_and_the_results_are_whole(log, tmp_path):
    recording, wanted = log
    both = [start("label", recording, "--out", tmp_path / "run", "--workers", "1") for _ in range(3)]
    ended = [(one.communicate(timeout=500)[1], one.returncode) for one in both]
    assert sorted({code for _, code in ended}) in ([0], [0, 2])
    assert all("another process writes into" in said for said, code in ended if code == 2)
    assert contents(tmp_path / "run") == wanted


def test_what_is_merged_or_exported_while_files_may_not_grow_leaves_nothing_half_written(log, tmp_path):
    recording, _ = log
    label_to_its_end(recording, tmp_path / "run")

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (3_000, 3_000))

    labels = tmp_path / "run" / "predictions"
    commands = [("export", "--to", kind) for kind in ("ply", "kitti_tracking", "semantickitti", "openlabel", "sustech")]
    for command, *options in [*commands, ("merge", labels), ("report",)]:
        out = tmp_path / f"{command}{options[-1] if command == 'export' else ''}"
        told = [tmp_path / "run", recording, *options, "--out", out if command != "report" else out / "r.html"]
        (out if command == "report" else tmp_path).mkdir(exist_ok=True)
        ended = start(command, *told, preexec_fn=limit)
        _, said = ended.communicate(timeout=500)
        assert ended.returncode in (0, 2), said
        assert "Traceback" not in said
        if ended.returncode == 2:
            assert said.count("error: ") == 1
            assert not (out / "run.json").exists()
            assert not list(out.rglob("*.part"))


@pytest.mark.parametrize("closed", [(0,), (1,), (2,), (0, 1, 2)], ids=str)
def test_a_run_without_standard_streams_gives_the_same_bytes(log, tmp_path, closed):
    """A job scheduler may close any of them; files opened then take their numbers, and nothing may be written there."""
    recording, wanted = log

    def close():
        for number in closed:
            os.close(number)

    words = ("label", str(recording), "--out", str(tmp_path / "run"), "--workers", "1")
    assert subprocess.run([*COMMAND, *words], preexec_fn=close, timeout=500, check=False).returncode == 0
    assert contents(tmp_path / "run") == wanted
