"""The docs build without a warning, and what they say of commands and settings is what the code has."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from pkgutil import resolve_name

import pytest
import typer

from automos import cli
from automos.settings import Settings, keys_of

ROOT = Path(__file__).parents[1]
COMMANDS = typer.main.get_command(cli.app).commands
GENERATED = {ROOT / "docs" / "reference" / f"{name}.md" for name in ("commands", "settings", "benchmarks")}
OF_OTHERS = {"src/dataset.py"}
"""Files of other projects, which pages name."""


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


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_command_on_a_page_is_there_with_its_options(page):
    blocks = re.findall(r"```sh\n(.*?)```", page.read_text().replace("\\\n", " "), re.DOTALL)
    for line in re.split(r"\n| && | --ros-args", "\n".join(blocks)):
        for name, rest in re.findall(r"(?:^|[ /'])automos ([a-z][\w-]*)([^#]*)", line.partition("# ")[0]):
            known = {name for parameter in COMMANDS[name].params for name in parameter.opts + parameter.secondary_opts}
            assert set(re.findall(r"\s(--[a-z][\w-]*)", rest)) <= known | {"--help"}, line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_name_in_the_package_on_a_page_is_there(page):
    for name in re.findall(r"`(automos(?:\.\w+)+(?::\w+)?)", page.read_text()):
        assert resolve_name(name.replace(":", ".")) is not None, name


def anchors_of(page: Path) -> set[str]:
    """Return what a link may name behind `#`: headings as they are written in addresses, and names given to them."""
    found = set(re.findall(r'<a id="([\w-]+)">', page.read_text()))
    for heading in re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE):
        named = re.search(r"\{ #([\w-]+) \}", heading)
        found.add(named[1] if named else re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading).strip().lower()))
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_link_leads_to_a_page_and_to_a_heading_of_it(page):
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    for path, _, anchor in (link.partition("#") for link in re.findall(r"\]\(([^)\s]+)\)", text)):
        target = (page.parent / path).resolve() if path else page
        if not path.startswith("http") and target not in GENERATED:
            assert target.exists(), path
            assert not anchor or anchor in anchors_of(target), f"{path}#{anchor}"


def test_a_file_of_ours_that_a_page_or_a_docstring_names_is_there():
    ours = [f"/{file.relative_to(ROOT)}" for file in ROOT.rglob("*.py")]
    strays = []
    for text in [*PAGES, *(file for folder in ("src", "benchmarks") for file in (ROOT / folder).rglob("*.py"))]:
        for name in re.findall(r"`([\w/-]+\.py)`", text.read_text()):
            if name not in OF_OTHERS and not any(file.endswith(f"/{name}") for file in ours):
                strays.append(f"{text.name}: {name}")
    assert strays == []
