"""Docstrings of what users call: numpydoc with types and shapes, and examples that run."""

import doctest
import importlib
import inspect
import re
import shutil

import pytest

import automos
from automos.evaluation import moving
from automos.evaluation import report as scores

SHOWN = {name: getattr(automos, name) for name in automos.__all__ if name != "__version__"}
SHOWN |= {"evaluate_recordings": scores.evaluate_recordings, "count": moving.count}
EXAMPLES = [
    "label",
    "Labeler",
    "open_sequence",
    "open_recordings",
    "ArraySequence",
    "Scan",
    "load_settings",
    "Workspace",
    "load",
    "export_run",
    "write_report",
    "evaluate_recordings",
    "count",
]
SECTIONS = ("Parameters", "Attributes", "Returns", "Yields", "Raises")


@pytest.fixture
def my_log(lane_run, tmp_path, monkeypatch):
    """Work in a folder that holds a recording my_log and its results, as after `automos label my_log`."""
    shutil.copytree(lane_run.parent / "lane", tmp_path / "my_log")
    shutil.copytree(lane_run, tmp_path / "automos_runs" / "my_log")
    monkeypatch.chdir(tmp_path)
    run = tmp_path / "automos_runs" / "my_log" / "run.json"
    run.write_text(run.read_text().replace(str(lane_run.parent / "lane"), str(tmp_path / "my_log")))


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_example_of_what_users_call_runs(name, my_log):
    called = SHOWN[name]
    module = importlib.import_module(called.__module__)
    tests = [test for test in doctest.DocTestFinder(recurse=False).find(called, name, module) if test.examples]
    assert len(tests) == 1
    failed, tried = doctest.DocTestRunner().run(tests[0])
    assert (failed, tried > 1) == (0, True)


def items_of(text: str) -> list[tuple[str, str, str]]:
    """Return section, line and next line of every item in the sections of a docstring that name values or errors."""
    lines, section, found = [*inspect.cleandoc(text).splitlines(), ""], "", []
    for before, line, after in zip(["", *lines], lines, lines[1:], strict=False):
        if re.fullmatch("-{3,}", line):
            section = before
        elif re.fullmatch("-{3,}", after):
            section = ""
        elif section in SECTIONS and line and not line.startswith(" "):
            found.append((section, line, after))
    return found


@pytest.mark.parametrize("name", SHOWN)
def test_a_public_docstring_gives_every_value_a_type_and_a_description(name):
    shown = SHOWN[name]
    texts = [shown.__doc__]
    if inspect.isclass(shown):
        texts += [method.__doc__ for key, method in vars(shown).items() if inspect.isfunction(method) and key[0] != "_"]
    for section, line, after in (item for text in filter(None, texts) for item in items_of(text)):
        assert after.startswith("    "), f"{line}: the description stands on the next line"
        assert section in ("Returns", "Yields", "Raises") or re.match(r"\w+(, \w+)* : \S", line), f"{line}: no type"


@pytest.mark.parametrize("name", [name for name, shown in SHOWN.items() if inspect.isfunction(shown)])
def test_a_public_function_documents_all_its_parameters(name):
    named = {word for _, line, _ in items_of(SHOWN[name].__doc__) for word in line.partition(" : ")[0].split(", ")}
    assert set(inspect.signature(SHOWN[name]).parameters) <= named
