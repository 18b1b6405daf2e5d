"""What the docs say of who reads our exports holds: there is a test of that format by that program."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from automos.writers import EXPORTS

HERE = Path(__file__).parent
PROGRAMS = {
    "NumPy": "np.",
    "zipfile": "zipfile.",
    "pypcd4": "pypcd4.",
    "plyfile": "plyfile.",
    "laspy": "laspy.",
    "pyarrow": "pyarrow.",
    "rosbags": "rosbags.",
    "mcap-ros2-support": "mcap_ros2.",
    "TrackEval": "trackeval.",
    "nuscenes-devkit": "nuscenes.",
    "vcd": "vcd.",
    "datumaro": "datumaro.",
    "own arithmetic": "sustech",
    "supervisely": "supervisely.",
    "segments-ai": "segments.",
    "av2": "av2.",
    "h5py": "h5py.",
    "dufomap": "pcdpy3.",
    "t4-devkit": "sanity.",
    "nvidia-ncore": "v4.",
}
"""What a test that uses a program says, by what the docs call it."""


def claims():
    """Return pairs of a format and a program that reads it, as the table in docs/formats.md has them."""
    text = (HERE.parents[1] / "docs" / "formats.md").read_text()
    rows = text.split("read back in the tests by |\n", 1)[1].split("\n\n", 1)[0].splitlines()[1:]
    found = []
    for row in rows:
        formats, *_, told = (cell.strip() for cell in row.strip("|").split("|"))
        for format in formats.replace("`", "").split(", "):
            named = re.finditer(rf"\b({'|'.join(PROGRAMS)})\b(?: \(`(\w+)`\))?", told)
            found += [(format, match[1]) for match in named if match[2] in (None, format)]
    return found


@cache
def sources():
    """Return the source of every function of these tests."""
    found = []
    for path in sorted(HERE.glob("test_*.py")):
        text = path.read_text()
        found += [
            ast.get_source_segment(text, node) for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)
        ]
    return found


def test_the_table_names_a_reader_of_every_format():
    assert {format for format, _ in claims()} == set(EXPORTS)


@pytest.mark.parametrize(("format", "program"), claims())
def test_a_program_that_the_docs_name_reads_the_format_in_a_test(format, program):
    assert [text for text in sources() if f'"{format}"' in text and PROGRAMS[program] in text]
