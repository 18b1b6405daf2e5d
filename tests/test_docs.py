"""The docs build without a warning, and what they say of commands and settings is what the code has."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

from automos.settings import Settings, keys_of

ROOT = Path(__file__).parents[1]


def test_the_site_builds_without_a_warning(tmp_path):
    for package in ("mkdocs", "material", "mkdocstrings"):
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"{package} is not installed: pip install '.[docs]'")
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    run = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    settings = (tmp_path / "site" / "reference" / "settings" / "index.html").read_text()
    for key in keys_of(Settings):
        group, _, name = key.rpartition(".")
        is_group = any(other.startswith(f"{key}.") for other in keys_of(Settings))
        assert is_group or (f">{group}<" in settings and f"<code>{name}</code>" in settings), key
    commands = (tmp_path / "site" / "reference" / "commands" / "index.html").read_text()
    assert all(f"automos {name}" in commands for name in ("label", "report", "review", "view", "merge"))


def test_pictures_of_the_docs_are_small():
    large = {path.name: path.stat().st_size for path in (ROOT / "docs" / "images").glob("*.png")}
    large.pop("demo.png")  # the README's, made by the demo at full size
    assert {name: size for name, size in large.items() if size > 300_000} == {}


PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md", *(ROOT / "docs").rglob("*.md")])
PRIVATE = re.compile(r"\b(told|tells?|see-through|stretch(es)?|torn|leaps?|thrice|folds? onto|whoever|for want of)\b")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_uses_the_terms_of_the_field(page):
    """Reported, window, mixed pixel, free-space observation, align: tables name what is stored under older names."""
    lines = page.read_text().splitlines()
    found = [line for line in lines if PRIVATE.search(line) and not line.startswith(("|", "`python"))]
    assert found == []
