"""What surrounds the package says of it what is so: citation, container, metadata."""

import re
import tomllib
from pathlib import Path

import yaml

import automos

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_the_citation_is_of_this_version_and_of_the_paper_that_the_readme_cites():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert cited["version"] == automos.__version__
    paper = cited["preferred-citation"]
    assert paper["doi"] in (ROOT / "README.md").read_text()
    assert PROJECT["urls"]["Paper"].endswith(paper["doi"])


def test_the_container_is_made_of_files_and_extras_that_there_are():
    recipe = (ROOT / "Dockerfile").read_text()
    named = [word for line in re.findall(r"^COPY (.*)$", recipe, re.MULTILINE) for word in line.split()[:-1]]
    assert [name for name in named if not (ROOT / name).exists()] == []
    allowed = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    assert set(named) <= allowed
    needed = {PROJECT["readme"], *PROJECT["license-files"], "pyproject.toml", "src"}
    assert needed <= set(named)
    extras = re.findall(r'"\.\[([a-z,]+)\]"', recipe)
    assert extras
    assert {extra for found in extras for extra in found.split(",")} <= PROJECT["optional-dependencies"].keys()


def test_extras_name_this_distribution_and_extras_that_it_has():
    optional = PROJECT["optional-dependencies"]
    own = [re.match(r"automos[\w-]*\[(.*)\]$", need) for needs in optional.values() for need in needs]
    for found in filter(None, own):
        assert found[0].startswith(f"{PROJECT['name']}[")
        assert set(found[1].split(",")) <= optional.keys()
