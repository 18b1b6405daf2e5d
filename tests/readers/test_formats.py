import subprocess
import sys
from pathlib import Path

import pytest

from automos.readers import CODECS, FORMATS, load_format
from automos.writers import EXPORTS

EXTRAS = ("pyarrow", "rosbags", "laspy", "lazrs", "velodyne_decoder")


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_declares_what_it_looks_like_and_what_it_needs(name, tmp_path):
    declared = load_format(name)
    assert declared.layout
    assert declared.find(tmp_path) == []
    assert declared.find(tmp_path / "nowhere") == []


def test_all_readers_and_writers_can_be_asked_without_any_optional_package(tmp_path):
    program = (
        f"import sys; sys.modules.update(dict.fromkeys({EXTRAS!r}))\n"
        "from pathlib import Path\nfrom automos.readers import FORMATS, load_format\n"
        "from automos.writers import EXPORTS, load_export\n[load_export(name) for name in EXPORTS]\n"
        f"print(sum(len(load_format(name).find(Path({str(tmp_path)!r}))) for name in FORMATS))"
    )
    run = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert run.stdout.strip() == "0"


def test_every_extra_that_a_reader_names_is_one_of_the_package():
    tomllib = pytest.importorskip("tomllib")
    root = Path(__file__).parents[2]
    extras = tomllib.loads((root / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert {load_format(name).needs for name in FORMATS} - {None} <= set(extras)


def test_the_page_about_formats_names_them_all():
    page = (Path(__file__).parents[2] / "docs" / "formats.md").read_text()
    assert [name for name in (*FORMATS, *CODECS, *EXPORTS) if f"`{name}`" not in page] == []
