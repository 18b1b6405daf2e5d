"""What README shows: its Python is that of an example that runs, and its commands run."""

import re
import shlex
import sys
from pathlib import Path

import pytest
from worlds import lane, write_bins

from automos import cli

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", README, re.DOTALL)
PYTHON = [text for kind, text in BLOCKS if kind == "python"]
COMMANDS = [
    words[words.index("automos") :]
    for kind, text in BLOCKS
    if kind == "sh"
    for line in text.splitlines()
    for part in line.split("&&")
    if "automos" in (words := shlex.split(part, comments=True))
]


@pytest.mark.parametrize("block", PYTHON)
def test_a_block_of_python_is_part_of_an_example(block):
    shown, imports = block.split("\n\n", 1)[1], block.split("\n\n", 1)[0].split("\n")
    examples = [file.read_text() for file in (ROOT / "examples").glob("*.py")]  # test_examples.py runs them
    assert any(shown in example and set(imports) <= set(example.splitlines()) for example in examples)


def test_there_are_blocks_of_both_kinds():
    assert PYTHON
    assert {"demo", "label", "report", "review", "export", "compare", "map"} <= {words[1] for words in COMMANDS}


def test_the_commands_that_label_and_look_run_as_they_are_written(tmp_path, monkeypatch):
    write_bins(lane(12).sequence, tmp_path / "my_log")
    monkeypatch.chdir(tmp_path)
    wanted = {("label", "my_log/"), ("report", "automos_runs/my_log"), ("map", "automos_runs/my_log")}
    shown = [words for words in COMMANDS if tuple(words[1:3]) in wanted and len(words) == 3]
    assert {tuple(words[1:3]) for words in shown} == wanted
    for words in shown:
        monkeypatch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as ended:
            cli.main()
        assert not ended.value.code, words
    assert len(list((tmp_path / "automos_runs/my_log/predictions").iterdir())) == 12
    assert (tmp_path / "automos_runs/my_log/report.html").exists()
