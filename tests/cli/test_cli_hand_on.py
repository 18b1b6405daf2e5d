"""The commands that hand results on: data sets of many runs, recordings without movers."""

import numpy as np
import pytest
from worlds import lane, write_bins

from automos.labeling import label_recording
from automos.readers import open_sequence
from automos.settings import load_settings


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return the results of a small street, whose recording has a blank and an umlaut in its name."""
    root = tmp_path_factory.mktemp("lane")
    recording = write_bins(lane().sequence, root / "Gasse süd 1")
    label_recording(open_sequence(recording), root / "run", load_settings("default"), workers=1)
    return root / "run"


def test_a_data_set_is_made_told_of_and_made_once(automos, run, tmp_path):
    words = ("dataset", run, "--out", tmp_path / "set", "--layout", "helimos", "--split", "valid=Gasse süd 1")
    for _ in range(2):
        done = automos(*words)
        assert done.code == 0, done.err
        assert "Gasse süd 1: sequence 50, valid, 12 scans" in done.out
        assert "no recording is in train" in done.out
    assert len(list((tmp_path / "set" / "Gasse süd 1" / "velodyne").glob("*.bin"))) == 12


def test_mistakes_are_sentences(automos, run, tmp_path):
    out = ("--out", tmp_path / "set", "--layout", "helimos")
    for words, sentence in (
        (("dataset", run, *out, "--split", "valid"), "write SPLIT=NAME"),
        (("dataset", run, *out, "--residuals", "8-"), "write numbers from 1 to 999"),
        (("dataset", run, run, *out), "given twice"),
        (("dataset", run, *out, "--recordings", run, "--recordings", run), "give one for each"),
        (("clean", run, "--out", tmp_path / "clean", "--keep-unsure", "--only-movers"), "exclude each other"),
        (("clean", run, "--out", tmp_path / "clean", "--as", "ply"), "there are bin, pcd, laz, mcap"),
        (("clean", run, "--out", run), "choose another --out"),
    ):
        done = automos(*words)
        assert done.code == 2
        assert sentence in " ".join(done.err.split())
    assert not (tmp_path / "set").exists()
    assert not (tmp_path / "clean").exists()


def test_movers_alone_and_all_else_are_the_recording(automos, run, tmp_path):
    recording = run.parent / "Gasse süd 1"
    for option in ("--keep-unsure", "--only-movers"):
        done = automos("clean", run, "--out", tmp_path / option, option)
        assert done.code == 0, done.err
        assert "points left out" in done.out
    n_moving = 0
    for path in sorted(recording.rglob("*.bin")):
        rest, movers = (np.fromfile(tmp_path / o / path.relative_to(recording), np.float32).reshape(-1, 4)
                        for o in ("--keep-unsure", "--only-movers"))  # fmt: skip
        whole = np.fromfile(path, np.float32).reshape(-1, 4)
        assert sorted(map(bytes, [*rest, *movers])) == sorted(map(bytes, whole))
        n_moving += len(movers)
    assert n_moving > 0
