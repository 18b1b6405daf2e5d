"""Nothing is replaced or deleted that this program did not write, whatever the command."""

import json
import os
import shutil
import sys
from typing import get_type_hints

import pytest
import typer
from typer.testing import CliRunner

import automos
from automos.cli import app
from automos.core.atomic import write_text
from automos.core.claims import EXPORT, MARK, METHODS, RESULTS, claim, claim_file, held_by, remove
from automos.core.errors import InputError, MissingExtraError
from automos.core.workspace import Workspace

links = pytest.mark.skipif(not hasattr(os, "symlink") or os.name == "nt", reason="needs links")

FOLDERS = {
    "label": "label LOG --out OUT --workers 1",
    "label of several": "label FLEET --out ABOVE --workers 1",
    "export": "export RUN LOG --to pcd --out OUT",
    "clean": "clean RUN LOG --out OUT",
    "dataset": "dataset RUN --recordings LOG --layout helimos --out OUT",
    "merge": "merge RUN LOG EDITS --out OUT",
    "compare": "compare LOG --method yoon --out OUT --workers 1",
    "map": "map LOG --method yoon --out OUT --workers 1",
    "segment": "segment LOG --out OUT",
    "train": "train --data LOG=RUN --out OUT",
    "reproduce": "reproduce table2 --out OUT",
    "live": "live LOG --speed 0 --out OUT",
    "demo": "demo --out OUT",
    "simulate": "simulate OUT --scenario canyon --sensor VLP-16 --scans 2 --workers 1",
    "simulate a recorder": "simulate OUT --scenario canyon --sensor VLP-16 --scans 2 --convention order=time",
    "review": "review OUT LOG --no-browser",
}
"""Words of the commands that write folders, by their name; OUT is the folder, or one in ABOVE."""
FILES = {
    "export": "export RUN LOG --to openlabel --out FILE.json",
    "export of a zip": "export RUN LOG --to semantickitti --out FILE.zip",
    "report": "report RUN LOG --out FILE.html",
    "view": "view RUN LOG --rrd FILE.rrd",
    "evaluate": "evaluate RUN LOG --json FILE.json",
    "export-network": "export-network NETWORK --out FILE.onnx",
}
"""Words of the commands that write one file."""
NOTHING = {"check", "drift", "formats", "ros2", "settings", "status"}
"""Commands that only print, or publish."""
NEEDS = {"train": "pytorch_lightning", "reproduce": "pytorch_lightning", "export-network": "onnxscript"}

THEIRS = {
    "stages/train/train.py": b"code", "stages/odometry-0123456789abcdef/all.npz": b"data",
    "predictions/lane.label": b"labels", "predictions/000000.label": b"labels", "confidences/000000.npy": b"numbers",
    "velodyne/000000.bin": b"0123456789abcdef", "labels/000000.label": b"0123", "octomap/predictions/000000.label": b"",
    "run.json": b'{"tool": "mine", "recording": {}, "points": {}, "versions": {}}', "simulation.json": b"{}",
    "map.json": b"{}", "compare.json": b"{}", "poses.txt": b"mine", "poses.tum": b"mine", "settings.yaml": b"mine",
    "tracks.json": b"{}", "map.ply": b"mine", "000000.pcd": b"mine", "best.pt": b"mine", "last.ckpt": b"mine",
    "street.png": b"mine", "table2.json": b"{}", "report.html": b"mine", "review.jsonl": b"mine",
}  # fmt: skip
"""A folder in which everything that we write is already there, and is somebody's."""


def test_every_command_is_listed():
    commands = set(typer.main.get_command(app).commands)
    listed = {words.split()[0] for words in (*FOLDERS.values(), *FILES.values())}
    assert commands == listed | NOTHING


READ = {
    "--settings", "--poses", "--calib", "--metadata", "--recordings", "--init", "--weights", "--recording",
    "--train", "--validation", "--test", "--extra", "--away-train", "--away-validation", "--away-test",
}  # fmt: skip
"""Options that take what is only read; `--work` is claimed place by place (`fleet/cache.py`, `work_folder.py`)."""


def test_every_option_that_takes_a_file_is_read_or_tried_on_a_strangers():
    tried: dict[str, set[str]] = {}
    for command, *words in map(str.split, (*FOLDERS.values(), *FILES.values())):
        tried.setdefault(command, set()).update(words)
    commands = typer.main.get_command(app).commands
    for group in app.registered_groups:
        for command in group.typer_instance.registered_commands:
            hints = {name: str(hint) for name, hint in get_type_hints(command.callback).items()}
            name = command.name or command.callback.__name__
            paths = {one.opts[0] for one in commands[name].params if "Path" in hints[one.name]} - READ - {"--work"}
            assert {path for path in paths if path[:2] == "--"} <= tried.get(name, set()), name


def fill(folder):
    for name, content in THEIRS.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def tree(folder):
    """Return everything below `folder`: contents of files, targets of links, None of folders."""
    return {
        path: os.readlink(path) if path.is_symlink() else path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


@pytest.fixture
def started(lane_run, tmp_path):
    """Return a function that runs a command on a folder or file of one of `theirs`, and what was raised."""
    log, run = shutil.copytree(lane_run.parent / "lane", tmp_path / "lane"), shutil.copytree(lane_run, tmp_path / "run")
    places = {"LOG": log, "RUN": run, "EDITS": run / "predictions", "FLEET": tmp_path / "fleet"}

    def start(command, words, place):
        pytest.importorskip(NEEDS.get(command, "numpy"))
        if "FLEET" in words.split():
            for name in ("out", "other"):
                shutil.copytree(log, places["FLEET"] / name)
        network = tmp_path / "lmnet.pt"
        shutil.copyfile(os.path.join(os.path.dirname(automos.__file__), "network", "lmnet.pt"), network)
        given = {**places, "OUT": place, "ABOVE": place.parent, "NETWORK": network}
        given |= {f"FILE{suffix}": place for suffix in (".json", ".zip", ".html", ".rrd", ".onnx")}
        return CliRunner().invoke(app, [str(given.get(word, word)) for word in words.split()])

    return start


def refused(done):
    """Return whether a command was refused in a sentence, or of several recordings that one."""
    return isinstance(done.exception, InputError) or "automos did not make that folder" in done.output


OFTEN = ("label", "export", "simulate", "live")
"""Commands that are tried on links, too, beside the slow tests: all claim their folder in one way."""


@pytest.mark.parametrize(
    ("command", "kind"),
    [
        *((command, "a folder") for command in FOLDERS),
        *(
            pytest.param(command, kind, marks=() if command in OFTEN else pytest.mark.slow)
            for command in FOLDERS
            for kind in ("a link", "a folder with a link")
        ),
    ],
)
def test_a_strangers_folder_stays_as_it_is(started, tmp_path, command, kind):
    theirs = fill(tmp_path / "theirs" / "out")
    place = theirs
    if kind != "a folder":
        place = tmp_path / "place" / "out"
        place.parent.mkdir()
        if kind == "a link":
            place.symlink_to(theirs)
        else:
            place.mkdir()
            (place / "stages").symlink_to(theirs)
    before = tree(theirs) | tree(place)
    done = started(command.split()[0], FOLDERS[command], place)
    assert refused(done), (done.exception, done.output)
    assert tree(theirs) | tree(place) == before


@links
@pytest.mark.parametrize("kind", ["a file", "a link", "a link to nowhere", "a folder", "a scan of the recording"])
@pytest.mark.parametrize("command", FILES)
def test_a_strangers_file_stays_as_it_is(started, tmp_path, command, kind):
    words = FILES[command]
    theirs = tmp_path / "theirs" / f"file{os.path.splitext(words)[1]}"
    theirs.parent.mkdir()
    if kind == "a link to nowhere":
        theirs.symlink_to("nowhere")
    elif kind == "a folder":
        theirs.mkdir()
        (theirs / theirs.name).write_bytes(b"mine")
    elif kind == "a link":
        (tmp_path / "theirs" / "thesis.tex").write_bytes(b"mine")
        theirs.symlink_to("thesis.tex")
    elif kind == "a scan of the recording":
        theirs = min((tmp_path / "lane" / "velodyne").glob("*.bin"))
        if "--to" in words:
            pytest.skip("an export adds its suffix to the name of anything else")
    else:
        theirs.write_bytes(b"mine")
    before = tree(tmp_path / "theirs") | tree(tmp_path / "lane")
    done = started(command.split()[0], words, theirs)
    after = tree(tmp_path / "theirs") | tree(tmp_path / "lane")
    assert {path: after.get(path) for path in before} == before
    if after == before:
        assert isinstance(done.exception, InputError), (done.exception, done.output)


@pytest.mark.parametrize("words", ["report RUN LOG", "export RUN LOG --to openlabel"])
def test_what_a_command_wrote_by_default_is_replaced(started, tmp_path, words):
    for _ in range(2):
        done = started("", words, tmp_path)
        assert done.exit_code == 0, done.exception


def test_a_strangers_report_in_a_run_stays(started, tmp_path):
    (tmp_path / "run" / "report.html").write_text("<title>mine</title>")
    assert refused(started("", "report RUN LOG", tmp_path))
    assert (tmp_path / "run" / "report.html").read_text() == "<title>mine</title>"


@pytest.mark.parametrize(
    "command", ["label", "segment", pytest.param("compare", marks=pytest.mark.slow), "simulate", "export"]
)
def test_a_command_may_be_repeated(started, tmp_path, command):
    for _ in range(2):
        done = started("", FOLDERS[command], tmp_path / "new")
        assert done.exit_code == 0, (done.exception, done.output)
    assert held_by(tmp_path / "new") is not None


LACKING = {
    "clean RUN LOG --as laz --out OUT": "laspy",
    "clean RUN LOG --as mcap --out OUT": "mcap rosbags",
    "map RUN --kind laz --out OUT": "lazrs",
    "train --data LOG=RUN --out OUT": "torch",
    "reproduce table2 --out OUT": "torch",
    "segment LOG --method lmnet --out OUT": "torch onnxruntime openvino",
    "simulate OUT --sensor VLP-16 --scans 2 --workers 1 --bag": "rosbags",
    "live LOG --speed 0 --foxglove --out OUT": "foxglove",
    "live LOG --speed 0 --view --out OUT": "rerun",
    "label LOG --ray local --out OUT": "ray",
    "export-network NETWORK --out OUT": "onnx onnxscript",
    "view RUN LOG --rrd OUT": "rerun",
}
"""Words of the commands that an optional package is for, and the modules that are not installed."""


@pytest.mark.parametrize("words", LACKING)
def test_what_cannot_begin_for_want_of_a_package_leaves_nothing(started, tmp_path, monkeypatch, words):
    if "lazrs" in LACKING[words]:
        pytest.importorskip("laspy")  # it looks for lazrs once, when it is imported: later tests need the answer
    for module in LACKING[words].split():
        monkeypatch.setitem(sys.modules, module, None)
    done = started("", words, tmp_path / "out")
    assert isinstance(done.exception, MissingExtraError), (done.exception, done.output)
    assert not (tmp_path / "out").exists()


# --------------------------------------------------------------------------------------------------- the mechanism
def test_a_folder_is_ours_if_it_is_new_or_empty_or_bears_our_mark_for_the_same(tmp_path):
    claim(tmp_path / "a" / "b", RESULTS)
    claim(tmp_path / "a" / "b", RESULTS)
    (tmp_path / "empty").mkdir()
    claim(tmp_path / "empty", METHODS)
    assert [held_by(tmp_path / name) for name in ("a/b", "a", "empty")] == [RESULTS, None, METHODS]
    with pytest.raises(InputError, match="b holds results that automos wrote: choose another --out"):
        claim(tmp_path / "a" / "b", EXPORT)
    claim(tmp_path / "a", METHODS)  # only what is ours is in it
    (tmp_path / "killed").mkdir()
    (tmp_path / "killed" / MARK).touch()  # before its first byte
    claim(tmp_path / "killed", RESULTS)
    assert held_by(tmp_path / "killed") == RESULTS


@pytest.mark.parametrize("mark", ["{}", "[]", '{"by": "somebody"}', "\xff"])
def test_a_mark_of_others_is_none_of_ours(tmp_path, mark):
    (tmp_path / MARK).write_text(mark, encoding="latin-1")
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(InputError, match=r"holds thesis\.tex, and automos did not make that folder"):
        claim(tmp_path, RESULTS)


def test_runs_without_a_mark_are_known_by_what_only_we_write(tmp_path):
    record = {"recording": {}, "points": {}, "versions": {"automos": "0.6.0"}, "seconds": {}}
    (tmp_path / "run.json").write_text(json.dumps(record))
    claim(tmp_path, RESULTS)
    (tmp_path / MARK).unlink()
    (tmp_path / "run.json").write_text(json.dumps({**record, "versions": {"mine": 1}}))
    with pytest.raises(InputError, match="automos did not make that folder"):
        claim(tmp_path, RESULTS)


def test_an_export_of_before_within_a_run_of_ours_is_replaced(tmp_path):
    claim(tmp_path, RESULTS)
    (tmp_path / "export" / "pcd").mkdir(parents=True)
    (tmp_path / "export" / "pcd" / "000000.pcd").touch()
    claim(tmp_path / "export" / "pcd", EXPORT)
    (tmp_path / "export" / "openlabel").mkdir()
    (tmp_path / "export" / "openlabel" / "a.json").write_text("{}")
    claim_file(tmp_path / "export" / "openlabel" / "a.json")


def test_a_file_is_ours_if_it_is_new_or_empty_or_has_our_sign(tmp_path):
    claim_file(tmp_path / "new.json")
    (tmp_path / "empty.json").touch()
    claim_file(tmp_path / "empty.json")
    (tmp_path / "ours.json").write_text('{"comment": "written by automos"}')
    claim_file(tmp_path / "ours.json")
    (tmp_path / "theirs.json").write_text('{"comment": "automos"}')
    with pytest.raises(InputError, match=r"theirs.json is there, and automos did not write it"):
        claim_file(tmp_path / "theirs.json")


@links
def test_what_a_folder_of_ours_links_to_is_not_ours(tmp_path):
    claim(tmp_path / "ours", RESULTS)
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "a.label").write_text("mine")
    (tmp_path / "ours" / "predictions").symlink_to(tmp_path / "theirs")
    for change in (lambda path: write_text(path, "ours"), remove):
        with pytest.raises(InputError, match="theirs, and automos did not make that folder"):
            change(tmp_path / "ours" / "predictions" / "a.label")
    assert (tmp_path / "theirs" / "a.label").read_text() == "mine"
    (tmp_path / "way").symlink_to(tmp_path / "ours")  # a link to what is ours as a whole
    write_text(tmp_path / "way" / "poses.txt", "ours")
    write_text(tmp_path / "way" / "poses.txt", "again")
    remove(tmp_path / "way" / "poses.txt")


def test_only_what_stages_hold_of_ours_is_removed_with_them(tmp_path):
    kept = Workspace(tmp_path / "run")
    for key in ("old", "new"):
        kept.stage("labels", key).save("000000", {})
    beside = tmp_path / "run" / "stages" / "labels-old" / "notes.txt"
    theirs = tmp_path / "run" / "stages" / "labels-old" / "theirs.npz"
    own = tmp_path / "run" / "stages" / "train" / "train.py"
    own.parent.mkdir()
    for path in (beside, theirs, own):
        path.write_text("mine")
    kept.keep_only({"labels": "new"})
    left = {path.relative_to(tmp_path / "run" / "stages").as_posix() for path in tmp_path.rglob("stages/*/*")}
    assert left == {"labels-new/000000.npz", "labels-old/notes.txt", "labels-old/theirs.npz", "train/train.py"}


@pytest.mark.parametrize(
    "command",
    ["label", "export", "clean", "dataset", "merge", "segment", pytest.param("map of a run", marks=pytest.mark.slow)],
)
def test_what_a_killed_command_left_half_written_is_removed_when_it_runs_again(started, tmp_path, command):
    words, out = FOLDERS.get(command, "map RUN --out OUT"), tmp_path / "out"
    assert started(command, words, out).exit_code == 0
    for folder in [out, *(path for path in out.rglob("*") if path.is_dir())]:
        (folder / ".000000.7972473c.part").write_bytes(b"half")
    assert started(command, words, out).exit_code == 0
    assert not list(out.rglob("*.part"))
