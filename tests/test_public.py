"""What `import automos` offers: names, their documents, and how they look at a prompt."""

import importlib
import pydoc
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from worlds import lane

import automos
from automos.settings import Settings

REFERENCE = Path(__file__).parents[1] / "docs" / "reference" / "python.md"


def test_every_public_name_is_there_and_documented():
    for name in set(automos.__all__) - {"__version__"}:
        assert getattr(automos, name).__doc__
        assert f".{name}\n" in REFERENCE.read_text() or name in REFERENCE.read_text().rpartition("members:")[2]
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        automos.nothing  # noqa: B018
    assert automos.label is importlib.import_module("automos.labeling").label
    assert automos.open_run is automos.load  # its name in 0.6


def test_dir_and_help_show_the_public_names_and_nothing_else():
    assert dir(automos) == sorted(automos.__all__)
    page = pydoc.render_doc(automos, renderer=pydoc.plaintext)
    assert "label(recording:" in page
    assert "import_module" not in page
    assert "TYPE_CHECKING" not in page


def test_the_package_is_typed_and_runs_as_a_module():
    assert (Path(automos.__file__).parent / "py.typed").exists()
    run = subprocess.run([sys.executable, "-m", "automos", "--version"], capture_output=True, text=True, check=True)
    assert run.stdout == f"{automos.__version__}\n"
    run = subprocess.run([sys.executable, "-m", "automos", "--help"], capture_output=True, text=True, check=True)
    assert "Usage: automos " in run.stdout


def test_a_list_of_arrays_is_a_recording():
    sequence = lane(8).sequence
    arrays, told = [np.asarray(scan.points) for scan in sequence], []
    result = automos.label(arrays, workers=1, progress=lambda *word: told.append(word))
    same = automos.label(automos.ArraySequence(arrays), workers=1)
    assert [result.labels(i).tolist() for i in range(8)] == [same.labels(i).tolist() for i in range(8)]
    assert {("odometry", 8, 8), ("candidates", 8, 8), ("instances", 8, 8), ("labels", 8, 8)} <= set(told)


@pytest.mark.parametrize(
    ("recording", "message"),
    [
        ("my_log", r"a path is opened first: automos.open_sequence\('my_log'\)"),
        (np.zeros((5, 3)), r"one array of shape \(5, 3\) is one scan: give a list"),
        (
            [np.zeros((5, 2))],
            r"list of \(N, 3\) arrays, metres: scan 0 must be \(N, 3 or 4\), got shape \(5, 2\)",
        ),
        (3, "a recording is a sequence or a list"),
        (memoryview(np.zeros((5, 3))), "a recording is a sequence or a list"),
        ([], "a list without scans is not a recording"),
    ],
    ids=["path", "one scan", "no points", "number", "memory", "nothing"],
)
def test_what_is_no_recording_is_told_what_would_be(recording, message):
    with pytest.raises(automos.InputError, match=message):
        automos.label(recording)


def test_what_is_shown_at_a_prompt_is_a_line():
    world = lane(8)
    result = automos.label(world.sequence, poses=world.poses, workers=1)
    n_moving = sum(found.verdict == "moving" for found in result.objects)
    told = f"<Result: 8 scans, {n_moving} of {len(result.objects)} objects move; 1 warning: .warnings>"
    assert repr(result) == told
    assert result.warnings[0].startswith("8 scans over 0.7 s are too few to decide what moves")
    shown = [world.sequence, world.sequence[0], result.trajectory, result.objects[0], result.points(0), Settings()]
    for thing in [*shown, automos.Workspace(), automos.Workspace("run")]:
        assert repr(thing).startswith(f"<{type(thing).__name__}")
        assert len(repr(thing)) < 200
