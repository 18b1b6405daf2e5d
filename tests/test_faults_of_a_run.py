"""What others put into a run stays, and closed streams change nothing; `fuzz/kills.py` has kills, full disks, races."""

import contextlib
import os
import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from worlds import lane, write_bins

from automos.core.claims import RESULTS, claim

STAGES = ("odometry", "candidates", "instances", "tracking", "labels")
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
