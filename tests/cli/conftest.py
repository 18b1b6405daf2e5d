"""The command line in the process of the tests: a Python started anew takes a second before it does anything."""

import sys
from dataclasses import dataclass

import pytest

from automos.cli import main


@dataclass
class Ended:
    """How a command ended."""

    code: int
    out: str
    err: str


@pytest.fixture
def automos(monkeypatch, capsys, tmp_path):
    """Return a function that runs the command line in an empty folder."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")

    def run(*words) -> Ended:
        monkeypatch.setattr(sys, "argv", ["automos", *map(str, words)])
        with pytest.raises(SystemExit) as leaving:
            main()
        said = capsys.readouterr()
        return Ended(leaving.value.code or 0, said.out, said.err)

    return run
