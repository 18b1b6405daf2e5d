"""What a hint tells the user to type installs this AutoMOS, not another project of the same name."""

import json
import re
from pathlib import Path

import pytest

from automos.core import extras
from automos.core.errors import MissingExtraError
from automos.core.extras import DISTRIBUTION, import_extra, pip_install

ROOT = Path(__file__).parents[2]


class Installed:
    """A distribution that pip installed from `url`."""

    def __init__(self, url):
        self.url = url

    def read_text(self, name):
        return json.dumps({"url": self.url}) if self.url and name == "direct_url.json" else None


@pytest.fixture
def installed(monkeypatch, tmp_path):
    """Return a function that makes this copy one that was installed into site-packages from a URL."""
    monkeypatch.setattr(extras, "__file__", str(tmp_path / "lib" / "automos" / "extras.py"))
    return lambda url: monkeypatch.setattr(extras, "distribution", lambda name: Installed(url))


def test_a_checkout_is_installed_from_where_it_is(monkeypatch, tmp_path):
    monkeypatch.chdir(ROOT)
    assert pip_install("view") == "pip install '.[view]'"
    monkeypatch.chdir(tmp_path)
    assert pip_install("view") == f"pip install '{ROOT}[view]'"


def test_a_copy_installed_from_a_folder_or_wheel_is_installed_from_it_again(installed, tmp_path):
    place = tmp_path / "a wheel.whl"
    place.touch()
    installed(place.as_uri())
    assert pip_install("las") == f"pip install '{place}[las]'"


def test_where_it_came_from_is_gone_or_an_index_the_distribution_is_named(installed, tmp_path):
    for url in ((tmp_path / "gone").as_uri(), None, "https://example.org/automos.whl"):
        installed(url)
        assert pip_install("las") == f"pip install '{DISTRIBUTION}[las]'"


def test_no_text_tells_to_install_the_project_that_has_the_short_name_on_the_index():
    files = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "pyproject.toml"]
    files += [*(ROOT / "docs").rglob("*.md"), *(ROOT / "src").rglob("*.py"), *(ROOT / "tests").rglob("*.py")]
    names = re.compile(r"pip install[^`\n&]*[ '\"]automos(?![-\w/])|automos\[[a-z,-]+\]")
    strays = [f"{path.relative_to(ROOT)}: {found}" for path in files for found in names.findall(path.read_text())]
    assert strays == []


def test_a_missing_package_is_told_with_the_command_that_installs_it():
    with pytest.raises(MissingExtraError, match=r"^nothing_of_the_kind is not .* pip install '.*\[ros\]'$"):
        import_extra("nothing_of_the_kind.inner", "ros")
