"""The commands about formats, as a user types them."""

import shutil

import pytest
from rich.console import Console
from typer.testing import CliRunner
from worlds import lane, write_bins

from automos.cli import app
from automos.core.errors import InputError
from automos.core.extras import pip_install
from automos.readers import CODECS, FORMATS
from automos.writers import EXPORTS


def run(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture(scope="module")
def labelled(tmp_path_factory):
    """Return a results folder and the recording it was made from."""
    root = tmp_path_factory.mktemp("labelled")
    write_bins(lane().sequence, root / "lane")
    done = run("label", root / "lane", "--out", root / "run", "--workers", 1)
    assert done.exit_code == 0, done.output
    return root / "run", root / "lane"


def test_formats_lists_all_that_is_read_and_written_and_what_each_needs(monkeypatch):
    monkeypatch.setattr("automos.cli.formats.output", Console(width=200, markup=False))
    done = run("formats")
    assert done.exit_code == 0, done.output
    words = set(done.output.split())
    assert {*FORMATS, *CODECS, *EXPORTS} <= words
    assert {"arrow", "ros", "las", "e57"} <= words
    assert pip_install("EXTRA") in done.output


def test_export_says_where_it_wrote(labelled, tmp_path):
    done = run("export", *labelled, "--to", "pcd", "--out", tmp_path / "points")
    assert done.exit_code == 0, done.output
    assert str(tmp_path / "points") in done.output
    assert len(list((tmp_path / "points").glob("*.pcd"))) == 12


def test_a_recording_that_is_where_it_was_is_found(labelled, tmp_path):
    done = run("export", labelled[0], "--to", "instances", "--out", tmp_path / "tracks")
    assert done.exit_code == 0, done.output
    assert len(list((tmp_path / "tracks").glob("*.npy"))) == 12


@pytest.mark.parametrize("format", ["panoptic", "cvat", "openlabel", "segments"])
def test_every_kind_of_result_of_a_real_run_can_be_exported(labelled, tmp_path, format):
    done = run("export", *labelled, "--to", format, "--out", tmp_path / "out.json")
    assert done.exit_code == 0, done.output
    assert (tmp_path / "out.json").exists()


def test_an_unknown_format_is_told(labelled):
    done = run("export", *labelled, "--to", "excel")
    assert isinstance(done.exception, InputError)
    assert "unknown format 'excel'" in str(done.exception)


@pytest.mark.parametrize("place", ["", "labels", "deep/labels"])
@pytest.mark.parametrize(
    "words",
    ["export RUN LOG --to pcd", "export RUN LOG --to panoptic", "merge RUN LOG EDITS", "map LOG", "compare LOG"],
)
def test_nothing_that_came_with_a_recording_is_written_over(labelled, tmp_path, words, place):
    folder = shutil.copytree(labelled[1], tmp_path / "lane")
    (folder / place).mkdir(parents=True, exist_ok=True)
    (folder / place / "000000.label").write_bytes(b"made by hand")
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    places = {"RUN": labelled[0], "LOG": folder, "EDITS": labelled[0] / "predictions"}
    done = run(*(places.get(word, word) for word in words.split()), "--out", folder / place)
    assert isinstance(done.exception, InputError)
    assert str(done.exception).endswith(
        (
            "automos did not make that folder: choose another --out",
            "the folder of the recording lane: choose another --out",
        )
    )
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_a_second_export_into_a_folder_of_its_own_within_the_recording_replaces_the_first(labelled, tmp_path):
    folder = shutil.copytree(labelled[1], tmp_path / "lane")
    words = ("export", labelled[0], folder, "--to", "instances", "--out", folder / "ids")
    assert run(*words).exit_code == 0
    assert run(*words).exit_code == 0


@pytest.mark.parametrize("words", ["label LOG", "segment LOG", "live LOG --speed 0", "merge RUN LOG EDITS"])
@pytest.mark.parametrize("place", ["", "velodyne"])
def test_no_results_are_written_into_another_recording(labelled, tmp_path, words, place):
    other = write_bins(lane(2).sequence, tmp_path / "other" / place)
    places = {"RUN": labelled[0], "LOG": labelled[1], "EDITS": labelled[0] / "predictions"}
    done = run(*(places.get(word, word) for word in words.split()), "--out", tmp_path / "other")
    assert "automos did not make that folder: choose another --out" in str(done.exception)
    assert sorted(path.name for path in other.iterdir()) == ["000000.bin", "000001.bin"]
    assert len(list((tmp_path / "other").iterdir())) == (1 if place else 2)


@pytest.mark.parametrize(
    "words", ["export RUN LOG --to openlabel", "export RUN LOG --to pcd", "merge RUN LOG EDITS", "label LOG", "map LOG"]
)
def test_a_link_to_itself_as_the_place_for_results_is_told(labelled, tmp_path, words):
    (tmp_path / "loop").symlink_to("loop")
    places = {"RUN": labelled[0], "LOG": labelled[1], "EDITS": labelled[0] / "predictions"}
    done = run(*(places.get(word, word) for word in words.split()), "--out", tmp_path / "loop")
    assert isinstance(done.exception, (InputError, OSError))
    assert "loop" in str(done.exception)


def test_exports_are_not_written_over_the_labels_of_a_run(labelled, tmp_path):
    run_folder = shutil.copytree(labelled[0], tmp_path / "run")
    before = {path: path.read_bytes() for path in run_folder.rglob("*.label")}
    done = run("export", *labelled, "--to", "panoptic", "--out", run_folder / "predictions")
    assert "automos did not make that folder: choose another --out" in str(done.exception)
    assert {path: path.read_bytes() for path in run_folder.rglob("*.label")} == before


@pytest.mark.slow
def test_results_and_maps_may_lie_below_the_recording_and_be_written_again(labelled, tmp_path):
    folder = shutil.copytree(labelled[1], tmp_path / "lane")
    shutil.copytree(labelled[0], folder / "run")
    for _ in range(2):
        for words in (
            ("export", folder / "run", folder, "--to", "panoptic"),
            ("map", folder, "--method", "yoon", "--out", folder / "map", "--workers", 1),
        ):
            done = run(*words)
            assert done.exit_code == 0, done.output
