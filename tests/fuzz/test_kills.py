"""A short part of the kills: whatever ends a command, nothing is lost, and run again it gives the same bytes."""

import os
import random
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("resource", reason="this system limits no file's size")
if not hasattr(os, "fork"):
    pytest.skip("this system has no forks", allow_module_level=True)
from kills import try_fault


@pytest.mark.slow
def test_commands_that_are_disturbed_lose_nothing_and_give_the_same_bytes_again():
    # in a process of its own: kernels that other tests loaded do not survive a fork
    script = Path(__file__).parent / "kills.py"
    run = subprocess.run([sys.executable, script, "--faults", "9"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.startswith("9 faults (")


@pytest.mark.parametrize(
    ("does", "said"),
    [
        (lambda out: (out / "thesis.tex").unlink(missing_ok=True), "somebody's files are not what they were"),
        (lambda out: (out.parent / "theirs" / "thesis.tex").write_text("ours"), "somebody's files are not"),
        (lambda out: os._exit(7), r"exit codes [7]"),
        (lambda out: None, r"run again it gives other bytes: ['/labels']"),
    ],
    ids=["deleted", "replaced", "crash", "nothing written"],
)
def test_what_a_command_does_wrong_is_told(does, said, tmp_path):
    def start(name, out, before=None):
        process = os.fork()
        if not process:
            does(out)
            os._exit(0)
        return process

    (tmp_path / "log").mkdir()
    (tmp_path / "said").touch()
    ground = SimpleNamespace(root=tmp_path, log=tmp_path / "log", start=start, wanted={"export": {"/labels": b"9"}})
    assert said in try_fault(ground, "export", "link", random.Random(0), tmp_path / "work")
