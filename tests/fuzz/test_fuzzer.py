"""A short part of the fuzzer: inputs of every quick kind, damaged, are refused in a sentence or read whole."""

import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("resource", reason="this system limits no process's memory")
from damage_tables import change_array
from fuzzer import RARE, Reader, fuzz


def test_damaged_inputs_are_refused_in_a_sentence_or_read_whole():
    pytest.importorskip("rosbags")
    counts, faults = fuzz(46, seed=1, tell=False)
    assert faults == []
    assert sum(found["refused"] for found in counts.values()) > 12
    assert [kind for kind, found in counts.items() if not found and kind not in RARE] == []


@pytest.mark.slow
def test_the_fuzzer_tells_a_traceback_from_a_refusal(tmp_path):
    # a fuzzer that cannot fail would find nothing
    code = (
        "import child, io, sys\n"
        "child.read_recordings = lambda *a: 1 / 0\n"
        "sys.stdin = io.StringIO('bin 1 60\\nposes 1 60\\n')\n"
        "child.main()\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=Path(__file__).parent, capture_output=True, text=True, check=True
    )
    outcomes = [line.split('"')[1] for line in run.stdout.splitlines()[1:]]
    assert outcomes[0] == "traceback"
    assert outcomes[1] in ("refused", "accepted")


@pytest.mark.slow
def test_an_input_that_takes_too_much_processor_time_is_a_hang_and_one_that_waits_for_the_machine_is_not(monkeypatch):
    monkeypatch.setattr("fuzzer.PATIENCE", 0.02)
    reader = Reader()
    assert reader.read("label", 1)[0] == "hang"  # labelling takes longer than that on any machine
    monkeypatch.setattr("fuzzer.PATIENCE", 60)
    assert reader.read("settings", 1)[0] in ("refused", "accepted")  # in a process begun anew
    reader.end()


@pytest.mark.slow
def test_what_is_damaged_is_read_whole_before(tmp_path):
    code = (
        "import child, sys\n"
        "from pathlib import Path\n"
        "kinds = child.Kinds(Path(sys.argv[1]))\n"
        "for kind, folder in kinds._bases.items():\n"
        "    child.read_recordings(folder, child.MOST.get(kind, 70_000))\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "fuzz")], cwd=Path(__file__).parent, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr[-2000:]


def test_an_array_whose_header_was_damaged_before_is_damaged_further(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, np.zeros((5, 4), np.float32))
    content = bytearray(path.read_bytes())
    content[45:47] = b"\x01\x00"
    path.write_bytes(content)
    for seed in range(5):
        change_array(path, random.Random(seed))
    assert path.read_bytes() != content
