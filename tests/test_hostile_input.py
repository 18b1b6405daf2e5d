"""What is damaged, in the way, somebody else's or not finished is refused in a sentence that names it."""

import errno
import math
import os
import shutil
import struct
import subprocess
import sys
import tempfile

import numpy as np
import pytest
from typer.testing import CliRunner

from automos.cli import app
from automos.core import label_files, reading
from automos.core.atomic import held
from automos.core.errors import InputError, SettingsError
from automos.core.pose_files import read_poses
from automos.evaluation.predictions import find_predictions
from automos.fleet import work_folder
from automos.readers import find_recordings, open_sequence
from automos.readers.files import holds_tables
from automos.results.run_files import RunFiles
from automos.settings import load_settings, read_overrides

linux = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs a system with pipes and owners")


def write_scans(folder, n=3, suffix=".bin"):
    folder.mkdir(parents=True)
    for i in range(n):
        np.random.default_rng(i).normal(0, 9, (50, 4)).astype("<f4").tofile(folder / f"{i:06d}{suffix}")
    return folder


# ---------------------------------------------------------------------------------------------------- recordings
def test_recordings_of_all_kinds_in_a_folder_are_found(tmp_path):
    write_scans(tmp_path / "kitti_like" / "velodyne")
    write_scans(tmp_path / "plain")
    write_scans(tmp_path / "more" / "plain_too")
    assert [p.name for p in find_recordings(tmp_path)] == ["kitti_like", "plain"]
    assert [p.name for p in find_recordings(tmp_path, "kitti")] == ["kitti_like"]


@pytest.mark.parametrize("where", ["", "kitti_like"])
def test_scans_beside_a_recording_in_a_folder_are_not_left_out_in_silence(tmp_path, where):
    write_scans(tmp_path / "kitti_like" / "velodyne")
    np.zeros((5, 4), "<f4").tofile(tmp_path / where / "000000.bin")
    with pytest.raises(InputError, match="holds scans itself, and others in folders below"):
        find_recordings(tmp_path / where)


def test_scans_that_differ_in_their_suffix_alone_are_refused(tmp_path):
    folder = write_scans(tmp_path / "log")
    (folder / "000001.BIN").write_bytes((folder / "000001.bin").read_bytes())
    with pytest.raises(InputError, match=r"holds 000001\.\w+ and 000001\.\w+, whose labels would have one name"):
        open_sequence(folder)


@linux
def test_a_file_of_more_bytes_than_any_memory_is_told_by_name_and_a_label_file_is_not_read(tmp_path, monkeypatch):
    for name in ("000000.label", "times.txt"):
        (tmp_path / name).touch()
        os.truncate(tmp_path / name, 1 << 43)
    with pytest.raises(InputError, match=r"times\.txt has 8796093022208 bytes, more than there is memory for"):
        reading.read_bytes(tmp_path / "times.txt")
    monkeypatch.setattr(label_files, "read_bytes", None)
    with pytest.raises(InputError, match=r"000000\.label holds 2199023255552 labels, but its scan has 7 points"):
        label_files.read_labels(tmp_path / "000000.label", 7)


@linux
@pytest.mark.parametrize("name", ["times.txt", "poses.txt", "calib.txt", "000001.bin"])
def test_a_pipe_is_not_waited_for(tmp_path, name):
    folder = write_scans(tmp_path / "log")
    (folder / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 3)
    (folder / name).unlink(missing_ok=True)
    os.mkfifo(folder / name)
    with pytest.raises(InputError, match=f"{name} is "):
        _ = open_sequence(folder).reference_poses


@linux
def test_a_pipe_among_tables_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "000001.csv")
    assert not holds_tables(tmp_path)
    (tmp_path / "000002.csv").write_text("1,2,3\n4,5,6\n")
    assert holds_tables(tmp_path)
    with pytest.raises(InputError, match=r"000001\.csv is not a regular file"):
        open_sequence(tmp_path)


@pytest.mark.skipif(not os.path.ismount("/proc"), reason="needs the kernel's own files")
@pytest.mark.parametrize("name", ["times.txt", "poses.txt", "mounts.yaml", "000001.bin"])
@pytest.mark.parametrize("file", ["/proc/self/environ", "/proc/uptime"])
def test_a_link_to_a_file_of_the_kernel_is_not_read(tmp_path, name, file):
    folder = write_scans(tmp_path / "log")
    (folder / name).unlink(missing_ok=True)
    (folder / name).symlink_to(file)
    with pytest.raises(InputError, match=f"{name} is a pipe, a device or the like; only plain files are read"):
        _ = open_sequence(folder).reference_poses, open_sequence(folder)[1]


@pytest.mark.parametrize("name", ["times.txt", "poses.txt", "mounts.yaml"])
def test_a_link_to_nothing_is_not_passed_over(tmp_path, name):
    folder = write_scans(tmp_path / "log")
    (folder / name).unlink(missing_ok=True)
    (folder / name).symlink_to("nothing")
    with pytest.raises(InputError, match=name):
        _ = open_sequence(folder).reference_poses


@pytest.mark.parametrize(
    ("at", "form", "value"),
    [
        (107, "<I", 7),
        (96, "<I", 1000),
        (100, "<I", 2**32 - 1),
        (105, "<H", 0),
        (96, "<I", 10),
        (131, "<d", 0.0),
        (139, "<d", math.nan),
        (147, "<d", 1e300),
        (155, "<d", math.inf),
    ],
    ids=str,
)
def test_a_las_header_that_does_not_fit_its_file_is_told(tmp_path, at, form, value):
    laspy = pytest.importorskip("laspy")
    las = laspy.LasData(laspy.LasHeader(point_format=1, version="1.2"))
    las.x, las.y, las.z = np.random.default_rng(0).normal(0, 9, (3, 100))
    las.write(tmp_path / "a.las")
    content = bytearray((tmp_path / "a.las").read_bytes())
    struct.pack_into(form, content, at, value)
    (tmp_path / "a.las").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.las is "):
        open_sequence(tmp_path)[0]


def test_a_las_file_cut_between_two_points_is_told(tmp_path):
    laspy = pytest.importorskip("laspy")
    las = laspy.LasData(laspy.LasHeader(point_format=1, version="1.2"))
    las.x, las.y, las.z = np.random.default_rng(0).normal(0, 9, (3, 100))
    las.write(tmp_path / "a.las")
    (tmp_path / "a.las").write_bytes((tmp_path / "a.las").read_bytes()[: -28 * 40])
    with pytest.raises(InputError, match=r"a\.las is cut short or damaged: its header announces 100 points"):
        open_sequence(tmp_path)[0]


def test_coordinates_of_a_map_are_told_and_a_stray_point_is_not(tmp_path):
    folder = write_scans(tmp_path / "log", n=2)
    points = np.fromfile(folder / "000000.bin", "<f4").reshape(-1, 4)
    points[3, 0] = 5e18
    points.tofile(folder / "000000.bin")
    assert open_sequence(folder)[0].is_valid.sum() == 49
    (points + np.float32(1e6)).tofile(folder / "000001.bin")
    with pytest.raises(InputError, match=r"000001\.bin has coordinates of a map"):
        open_sequence(folder)[1]


def test_text_whose_lines_end_in_a_carriage_return_alone_has_all_its_points(tmp_path):
    (tmp_path / "a.xyz").write_bytes(b"1 2 3\r4 5 6\r7 8 9\r")
    assert len(open_sequence(tmp_path)[0]) == 3


def test_poses_that_are_not_on_earth_are_told(tmp_path):
    (tmp_path / "poses.txt").write_text("1 0 0 1e30 0 1 0 0 0 0 1 0\n")
    with pytest.raises(InputError, match=r"poses\.txt has a pose that is not on Earth"):
        read_poses(tmp_path / "poses.txt", 1)


# ------------------------------------------------------------------------------------------------------ settings
@pytest.mark.parametrize("text", ["&a [*a]", "a: &a {b: *a}", "{" * 5000, "x: 2020-99-99", "\x00"])
def test_settings_that_are_no_tree_are_told(tmp_path, text):
    (tmp_path / "s.yaml").write_text(text)
    with pytest.raises(SettingsError, match=r"s\.yaml"):
        load_settings("default", tmp_path / "s.yaml")


@pytest.mark.parametrize("item", ["odometry.max_range=.inf", "odometry.max_range=.nan", "odometry.max_range=1e30"])
def test_settings_beyond_all_bounds_are_told(item):
    with pytest.raises(SettingsError, match=r"odometry\.max_range"):
        load_settings("default", None, read_overrides([item]))


@pytest.mark.parametrize("value", [1e-300, 1e-7, -1e-7, 1e10, 1e30])
def test_no_setting_takes_numbers_from_which_nothing_can_be_computed(value):
    for key in ("odometry.overhead", "tracking.filter.process_variance", "candidates.ground.tolerance"):
        with pytest.raises(SettingsError, match=rf"setting {key} = "):
            load_settings("default", None, {key: value})
    with pytest.raises(SettingsError, match=r"numbers are 0, or between 1e-06 and 1e\+09 in size"):
        load_settings("default", None, {"odometry.overhead": value})


# ------------------------------------------------------------------------------------------------------- results
@linux
@pytest.mark.parametrize("name", ["settings.yaml", "poses.tum"])
@pytest.mark.parametrize("kind", ["pipe", "/dev/zero", "nothing"])
def test_a_run_whose_files_are_none_is_neither_waited_for_nor_copied_without_end(lane_run, tmp_path, name, kind):
    run = shutil.copytree(lane_run, tmp_path / "run")
    (run / name).unlink()
    os.mkfifo(run / name) if kind == "pipe" else (run / name).symlink_to(kind)
    commands = [("merge", run, lane_run.parent / "lane", lane_run / "predictions", "--out", tmp_path / "out")]
    commands += [("report", run)] * (name == "settings.yaml")
    for words in commands:
        told = CliRunner().invoke(app, [*map(str, words)])
        assert isinstance(told.exception, InputError)
        assert str(run / name) in str(told.exception)


def test_a_run_that_did_not_end_is_no_result(tmp_path):
    recording, run = write_scans(tmp_path / "log", n=1), tmp_path / "run"
    (run / "predictions").mkdir(parents=True)
    np.zeros(50, "<u4").tofile(run / "predictions" / "000000.label")
    assert find_predictions(run, "log", is_only=True) == run / "predictions"  # another program's
    (run / "stages").mkdir()
    for read in (lambda: find_predictions(run, "log", is_only=True), lambda: RunFiles(run, open_sequence(recording))):
        with pytest.raises(InputError, match=r"was not labelled to its end \(it holds no run.json\)"):
            read()
    for damaged in ("", "{", "[]", "{}", '{"stages": []}', '{"stages": {"labels": "../.."}}', "[" * 100_000):
        (run / "run.json").write_text(damaged)
        with pytest.raises(InputError, match=r"run\.json is missing or damaged"):
            find_predictions(run, "log", is_only=True)
    (run / "run.json").write_text('{"fingerprint": "key"}')
    assert find_predictions(run, "log", is_only=True) == run / "predictions"
    (tmp_path / "ledger").mkdir()  # the books of several: each is complete by a marker of its own
    with pytest.raises(InputError, match=r"it holds no complete.json"):
        find_predictions(run, "log", is_only=True)


@linux
def test_two_processes_do_not_write_into_one_folder(tmp_path):
    code = f"from pathlib import Path; from automos.core.atomic import held\nwith held(Path({str(tmp_path)!r})): pass"
    with held(tmp_path):
        other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "another process writes into" in other.stderr
    subprocess.run([sys.executable, "-c", code], check=True)


# --------------------------------------------------------------------------------------------------- work folder
@linux
def test_the_work_folder_is_the_users_alone_and_gone_at_the_end(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path))
    folder = work_folder.default_work()
    folder.mkdir(mode=0o755)
    with work_folder.work_folder(folder):
        assert folder.stat().st_mode & 0o777 == 0o700
        with work_folder.work_folder(folder):
            (folder / "copy").touch()
        assert (folder / "copy").exists()  # the outer one still needs it
    assert not folder.exists()


@linux
def test_a_work_folder_that_somebody_else_made_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path))
    folder = work_folder.default_work()
    (tmp_path / "theirs").mkdir()
    folder.symlink_to(tmp_path / "theirs")
    with pytest.raises(InputError, match="choose another place with --work"), work_folder.work_folder(folder):
        pass
    folder.unlink()
    folder.mkdir()
    monkeypatch.setattr(os, "getuid", lambda: folder.stat().st_uid + 1)
    monkeypatch.setattr(work_folder, "default_work", lambda: folder)
    with pytest.raises(InputError, match="made by another user"):
        work_folder.claim(folder)


@pytest.mark.parametrize("radius", ["0", "1e-300", "-1", "nan", "1e30"])
def test_a_radius_that_nothing_can_be_drawn_in_is_told(tmp_path, radius):
    told = CliRunner().invoke(app, ["compare", str(tmp_path), "--radius", radius])
    assert "--radius" in str(told.exception)
    assert isinstance(told.exception, InputError)


@pytest.mark.filterwarnings("error")
def test_a_nan_that_signals_is_a_nan_and_nothing_is_said_of_it(tmp_path):
    folder = write_scans(tmp_path / "log")
    points = np.fromfile(folder / "000001.bin", "<u4").reshape(-1, 4)
    points[3, :3] = 0x7F800001
    points.tofile(folder / "000001.bin")
    sequence = open_sequence(folder)
    assert [int(scan.is_valid.sum()) for scan in sequence] == [50, 49, 50]


@pytest.mark.parametrize("to", ["pcd", "ply", "laz", "instances", "panoptic", "cvat", "sustech"])
def test_an_export_may_be_written_anew(lane_run, tmp_path, to):
    words = ["export", str(lane_run), str(lane_run.parent / "lane"), "--to", to, "--out", str(tmp_path / "exported")]
    for _ in range(2):
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, result.exception


def test_of_what_cannot_be_read_in_a_folder_the_name_is_told(tmp_path):
    with pytest.raises(InputError, match="secret cannot be read: Permission denied"), reading.damage_reported(tmp_path):
        raise PermissionError(errno.EACCES, "Permission denied", str(tmp_path / "secret"))


def test_no_command_replaces_a_file_of_the_recording_or_writes_among_its_scans(lane_run, tmp_path):
    log = shutil.copytree(lane_run.parent / "lane", tmp_path / "log")
    run = shutil.copytree(lane_run, tmp_path / "run")
    fleet = shutil.copytree(log, tmp_path / "fleet" / "a").parent
    shutil.copytree(log, fleet / "b")
    scan, times = next(iter(sorted((log / "velodyne").iterdir()))), log / "times.txt"
    with_poses = shutil.copytree(log / "velodyne", tmp_path / "with_poses")
    (with_poses / "poses").mkdir()
    for words, told in (
        (["report", run, log, "--out", times], "is there, and automos did not write it"),
        (["evaluate", run, log, "--json", scan], "is there, and automos did not write it"),
        (["label", fleet, "--out", log], "holds the scans of a recording"),
        (["label", log, "--out", run / "predictions"], "automos did not make that folder"),
        (["label", log, "--out", with_poses], "automos did not make that folder"),
        (["export", run, log, "--to", "pcd", "--out", fleet / "a"], "automos did not make that folder"),
        (["export", run, log, "--to", "pcd", "--out", with_poses], "automos did not make that folder"),
        (["export", run, log, "--to", "panoptic", "--out", fleet / "a" / "labels"], "automos did not make that folder"),
        (["map", log, "--out", with_poses], "automos did not make that folder"),
        (["compare", log, "--out", fleet / "a"], "automos did not make that folder"),
    ):
        before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
        result = CliRunner().invoke(app, list(map(str, words)))
        assert isinstance(result.exception, InputError)
        assert told in str(result.exception)
        assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
