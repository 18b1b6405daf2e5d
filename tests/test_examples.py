import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

SAYS = {"label_arrays": r"[1-9]\d* moving", "label_folder": r"[1-9]\d* of \d+ points are moving"}
EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_runs_and_says_what_it_did(example, tmp_path):
    source = Path(__file__).parents[1] / "src"
    path = os.pathsep.join([str(source), os.environ.get("PYTHONPATH", "")])
    run = subprocess.run(
        [sys.executable, example],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert re.search(SAYS.get(example.stem, r"\S"), run.stdout)


def test_what_examples_should_say_is_of_examples_that_are_there():
    assert set(SAYS) <= {path.stem for path in EXAMPLES}
