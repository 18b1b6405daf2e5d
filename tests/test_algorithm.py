"""`docs/algorithm.md` and the code name each other: every equation its functions, every function its equations."""

import ast
import inspect
import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "algorithm.md").read_text()
METHOD = [ROOT / "src" / "automos" / name for name in ("odometry", "evidence", "objects", "pipeline.py", "labeler.py")]


def functions_by_equation() -> dict[str, set[str]]:
    """Return the dotted names that the page lists for each equation: those of the next line of code."""
    found: dict[str, set[str]] = {}
    waiting: list[str] = []
    for line in PAGE.splitlines():
        if anchor := re.match(r'<a id="([\w-]+)"></a>', line):
            waiting.append(anchor[1])
        elif line.startswith("code: "):
            assert waiting, f"no equation before: {line}"
            found |= {name: set(re.findall(r"`([\w.]+)`", line)) for name in waiting}
            waiting = []
    assert waiting == [], "equations without code"
    return found


def equations_by_function() -> dict[str, set[str]]:
    """Return the equations that the docstrings of the method name, by dotted name of the function or class."""
    found = {}
    for path in METHOD:
        for file in [path] if path.is_file() else sorted(path.rglob("*.py")):
            module = ".".join(file.relative_to(ROOT / "src").with_suffix("").parts)
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.FunctionDef | ast.ClassDef):
                    named = re.search(r"^\s*Equations?: (.*)$", ast.get_docstring(node) or "", re.M)
                    if named:
                        found[f"{module}.{node.name}"] = set(re.findall(r"[\w-]+", named[1]))
    return found


ON_PAGE, IN_CODE = functions_by_equation(), equations_by_function()


@pytest.mark.parametrize("equation", ON_PAGE)
def test_functions_on_the_page_name_the_equation(equation):
    assert {name for name in ON_PAGE[equation] if equation not in IN_CODE.get(name, set())} == set()


@pytest.mark.parametrize("function", IN_CODE)
def test_equations_in_the_code_are_on_the_page(function):
    assert {name for name in IN_CODE[function] if function not in ON_PAGE.get(name, set())} == set()


def names_of(function: str) -> set[str]:
    """Return the parameters and fields of a function or class, and those of the classes in its annotations."""
    module, name = function.rsplit(".", 1)
    found = getattr(import_module(module), name)
    found = getattr(found, "py_func", found)
    return set(inspect.signature(found).parameters) | set(getattr(found, "__annotations__", {}))


def test_symbols_are_names_of_the_listed_functions():
    rows = re.findall(r"^\| \$(?:.*) \| .* \| .* \| (.*) \|$", PAGE, re.M)
    assert len(rows) > 20
    in_code = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    known = set().union(*(names_of(name) for listed in ON_PAGE.values() for name in listed))
    assert in_code - known == set()


def test_symbols_of_equations_are_in_the_notation():
    table = PAGE[PAGE.index("## 1 Notation") : PAGE.index("## 2 ")]
    explained = set(re.findall(r"\\?[a-zA-Z]+", " ".join(re.findall(r"^\| (.*?) \|", table, re.M))))
    formulas = re.findall(r"```math\n(.*?)```", PAGE, re.S)
    words = r"\\(?:text|operatorname|underbrace|begin|end|lVert|rVert|left|right)\b(?:\{[^}]*\})?"
    used = set()
    for formula in formulas:
        plain = re.sub(words, " ", formula)
        used |= set(re.findall(r"(?<![\\a-zA-Z])([a-zA-Z])(?![a-zA-Z])", plain))
        used |= {
            f"\\{greek}"
            for greek in re.findall(r"\\(tau|xi|sigma|mu|nu|kappa|epsilon|Delta|rho|theta|lambda|alpha|ell)\b", plain)
        }
    everyday = set("ijtNypo")  # indices, a number of scans, what is observed, a probability, an offset told beside
    assert used - explained - everyday == set()


def test_the_page_is_short():
    assert len(ON_PAGE) == PAGE.count("```math") <= 25
    assert len(PAGE.split()) <= 2500
