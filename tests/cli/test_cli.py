"""The command line as a user meets it: what goes wrong is one sentence, exit code 2, and nothing half-written."""

import errno
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from worlds import World, iou_of_moving, lane, write_bins

from automos import __version__, cli, labeling
from automos.cli import main
from automos.cli.options import output
from automos.core.claims import MARK
from automos.core.label_files import to_mos
from automos.core.labels import Label
from automos.core.pose_writers import write_kitti, write_tum
from automos.settings import load_settings


@pytest.fixture(scope="module")
def world() -> World:
    """Return a lane of eight scans."""
    return lane(8)


@pytest.fixture
def log(world, tmp_path) -> Path:
    """Return a folder of .bin files."""
    return write_bins(world.sequence, tmp_path / "log")


@pytest.fixture
def poses(world, tmp_path) -> Path:
    """Return the log's poses as a file."""
    write_kitti(tmp_path / "poses.txt", world.poses)
    return tmp_path / "poses.txt"


def is_one_sentence(text: str) -> bool:
    return text.startswith("error: ") and text.count("\n") == 1 and "Traceback" not in text


def files_in(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


# ------------------------------------------------------------------------------------------------------- bad input
def make_empty(log, poses):
    for path in log.iterdir():
        path.unlink()


def cut_a_scan(log, poses):
    scan = log / "000004.bin"
    scan.write_bytes(scan.read_bytes()[:-3])


def mix_formats(log, poses):
    np.save(log / "000009.npy", np.ones((5, 4), np.float32))


def lose_a_pose(log, poses):
    poses.write_text("".join(poses.read_text().splitlines(keepends=True)[:-1]))


def scale_a_pose(log, poses):
    lines = poses.read_text().splitlines()
    lines[3] = " ".join(str(1.2 * float(word)) for word in lines[3].split())
    poses.write_text("\n".join(lines))


def lose_the_poses(log, poses):
    poses.unlink()


def write_words(log, poses):
    poses.write_text("these are not poses\n")


def lose_the_log(log, poses):
    make_empty(log, poses)
    log.rmdir()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lose_the_log, "log does not exist; check the path"),
        (make_empty, "log is empty; give a folder that holds scans"),
        (cut_a_scan, "000004.bin has"),
        (mix_formats, "log mixes formats: 8 .bin, 1 .npy"),
        (lose_a_pose, "poses.txt holds 7 poses for 8 scans"),
        (scale_a_pose, "poses.txt, line 4: not a rigid transform"),
        (lose_the_poses, "poses.txt does not exist; check the path"),
        (write_words, "poses.txt, line 1: could not convert string to float: 'these'"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_bad_input_is_one_sentence_and_leaves_nothing(automos, log, poses, tmp_path, spoil, message):
    spoil(log, poses)
    ended = automos("label", log, "--out", tmp_path / "out", "--poses", poses)
    assert ended.code == 2
    assert is_one_sentence(ended.err)
    assert message in ended.err
    assert ended.out == ""
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "words",
    [
        "simulate s3://bucket/x",
        "simulate file:///x --scans 2",
        "demo --out gs://bucket/x",
        "merge a b c --out file:///x",
        "evaluate a b --json s3://bucket/scores.json",
        "label a --work s3://bucket/x",
        "live a --out s3://bucket/x",
        "reproduce table2 --train s3://bucket/x",
    ],
)
def test_an_address_where_a_path_is_needed_is_told_and_no_folder_of_its_name_is_made(automos, words):
    ended = automos(*words.split())
    address = next(word for word in words.split() if "://" in word)
    assert ended.code == 2
    assert is_one_sentence(ended.err)
    assert re.search(address.replace("///", "//") + " is an address", ended.err)
    assert list(Path.cwd().iterdir()) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--set", "tracking.max_miss=3"], "no setting 'tracking.max_miss': did you mean 'tracking.max_misses'?"),
        (["--set", "tracking.max_misses=-1"], "setting tracking.max_misses = -1 is not possible"),
        (["--set", "tracking.max_misses=few"], "setting tracking.max_misses = 'few' is not possible"),
        (["--set", "tracking.max_misses"], "--set tracking.max_misses has no value"),
        (["--set", "tracking.max_misses="], "setting tracking.max_misses = None is not possible"),
        (["--set", "instances.hdbscan.epsilons=[1, 2"], "'[1, 2' is not a value"),
        (["--preset", "papre"], "no preset 'papre': choose one of paper, default"),
        (["--settings", "mine.yaml"], "settings file mine.yaml could not be read"),
        (["--format", "kiti"], "unknown format 'kiti'; did you mean 'kitti'?"),
        (["--format", "pcd"], "holds no scans for format 'pcd'"),
        (["--calib", "calib.txt", "--poses", "../poses.txt"], "calib.txt does not exist"),
        (["--calib", "calib.txt"], "give that with --poses, or neither"),
    ],
)
def test_a_bad_option_is_one_sentence_and_leaves_nothing(automos, log, poses, tmp_path, options, message):
    ended = automos("label", log, "--out", tmp_path / "out", *options)
    assert ended.code == 2
    assert is_one_sentence(ended.err)
    assert message in ended.err
    assert not (tmp_path / "out").exists()
    assert files_in(tmp_path / "here") == []


@pytest.mark.parametrize(
    "words",
    [
        "label LOG --out http://me:secret@[x",
        "live udp://[::1 --sensor velodyne",
        "live LOG --speed 0 --send udp://[::1",
    ],
)
def test_an_address_that_is_none_is_told_without_what_may_be_secret_in_it(automos, log, words):
    ended = automos(*words.replace("LOG", str(log)).split())
    assert (ended.code, ended.err.count("error: ")) == (2, 1)
    assert "is not an address (Invalid IPv6 URL): write scheme://host/path" in ended.err
    assert "secret" not in ended.err


@pytest.mark.parametrize("name", ["[/bold]", "[red]", "a{b}c", "Straße 1", "100%"])
def test_any_name_of_a_folder_is_told_as_it_is(automos, tmp_path, name):
    ended = automos("label", tmp_path / name)
    assert ended.code == 2
    assert is_one_sentence(ended.err)
    assert f"{name} does not exist" in ended.err


def test_an_error_that_names_all_columns_is_cut_to_what_can_be_read(automos, tmp_path):
    (tmp_path / "wide").mkdir()
    (tmp_path / "wide" / "000000.csv").write_text(",".join(f"c{i}" for i in range(20_000)) + "\n")
    ended = automos("label", tmp_path / "wide", "--out", tmp_path / "run")
    assert ended.code == 2
    assert "has no column x, y, z; its columns are: c0, c1" in ended.err
    assert "c19999" in ended.err
    assert len(ended.err) < 3000


def under_a_limit(kind, megabytes, code, *words):
    resource = pytest.importorskip("resource", reason="Windows limits no process so")
    limit, n_bytes = getattr(resource, kind), megabytes << 20
    return subprocess.run(
        [sys.executable, "-c", f"{code}\nfrom automos.cli import main; main()", *words],
        preexec_fn=lambda: resource.setrlimit(limit, (n_bytes, n_bytes)),
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["RLIMIT_AS", "RLIMIT_DATA"])
def test_too_little_memory_for_compiled_code_is_one_sentence(log, kind):
    ended = under_a_limit(kind, 600, "", "label", log)
    assert ended.returncode == 2
    assert "may have 600 MB of memory and needs 800" in ended.stderr


@pytest.mark.parametrize("kind", [pytest.param("RLIMIT_AS", marks=pytest.mark.slow), "RLIMIT_DATA"])
def test_the_least_memory_that_is_asked_for_is_enough(log, tmp_path, kind):
    ended = under_a_limit(kind, 800, "", "label", log, "--out", tmp_path / "run", "--workers", "1")
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "run" / "run.json").exists()


def test_under_a_limit_a_crash_of_compiled_code_is_one_sentence_and_a_code_is_passed_on(log):
    crash = "import os, automos.cli as cli; cli.share_heap = os.abort"
    ended = under_a_limit("RLIMIT_DATA", 900, crash, "label", log)
    assert ended.returncode == 2
    assert "there was not enough memory for this, and compiled code ended the process (SIGABRT)" in ended.stderr
    ended = under_a_limit(
        "RLIMIT_DATA", 900, "import sys, automos.cli as c; c.share_heap = lambda: sys.exit(7)", "label"
    )
    assert (ended.returncode, ended.stderr) == (7, "")


def test_under_a_limit_one_process_waits_for_another_however_many_commands_it_runs():
    code = (
        "import os, sys, automos.cli as cli\ncli.share_heap = lambda: sys.exit(0)\n"
        "for _ in range(3):\n    try:\n        cli.main()\n    except SystemExit:\n"
        "        print(os.getpid(), flush=True)"
    )
    ended = under_a_limit("RLIMIT_DATA", 900, code, "--version")
    assert len(ended.stdout.split()) == 3, ended.stderr
    assert len(set(ended.stdout.split())) == 1


def test_under_a_limit_an_interruption_is_passed_on():
    resource = pytest.importorskip("resource", reason="Windows limits no process so")
    code = (
        "import time, automos.cli as cli\nfrom automos.cli import main\n"
        "def wait():\n    print('here', flush=True)\n    try:\n        time.sleep(60)\n"
        "    except KeyboardInterrupt:\n        time.sleep(1)\n        print('once', flush=True)\n        raise\n"
        "cli.share_heap = wait\nmain()"
    )
    running = subprocess.Popen(
        [sys.executable, "-c", code, "label"], stdout=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_DATA, (1 << 30, 1 << 30)),
    )  # fmt: skip
    assert running.stdout.readline() == "here\n"
    running.send_signal(signal.SIGINT)
    assert running.communicate(timeout=30)[0] == "once\n"


def test_a_file_is_no_recording(automos, log):
    ended = automos("label", log / "000000.bin")
    assert (ended.code, is_one_sentence(ended.err)) == (2, True)
    assert "is a file; give the folder" in ended.err


def test_an_out_that_is_a_file_is_refused_and_left_alone(automos, log, tmp_path):
    (tmp_path / "out").write_text("mine")
    ended = automos("label", log, "--out", tmp_path / "out")
    assert (ended.code, is_one_sentence(ended.err)) == (2, True)
    assert "is a file: choose another --out" in ended.err
    assert (tmp_path / "out").read_text() == "mine"


def test_labels_of_another_program_are_refused_and_left_alone(automos, log, tmp_path):
    (tmp_path / "out" / "predictions").mkdir(parents=True)
    (tmp_path / "out" / "predictions" / "000000.label").write_text("by hand")
    ended = automos("label", log, "--out", tmp_path / "out")
    assert (ended.code, is_one_sentence(ended.err)) == (2, True)
    assert "automos did not make that folder: choose another --out" in ended.err
    assert [path.read_text() for path in files_in(tmp_path / "out")] == ["by hand"]


@pytest.mark.parametrize("function", ["numpy.savez", "os.replace"])
def test_a_full_disk_is_one_sentence_and_the_same_command_goes_on_later(
    automos, log, poses, tmp_path, monkeypatch, function
):
    module = {"numpy.savez": np, "os.replace": os}[function]
    work, calls = getattr(module, function.split(".")[1]), []

    def fill_up(*args, **kwargs):
        calls.append(1)
        if len(calls) > 12:  # in the middle of a stage
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return work(*args, **kwargs)

    options = ["label", log, "--out", tmp_path / "out", "--poses", poses, "--preset", "paper", "--workers", 1]
    with monkeypatch.context() as patch:
        patch.setattr(function, fill_up)
        ended = automos(*options)
    assert ended.code == 2
    assert is_one_sentence(ended.err[ended.err.rindex("error: ") :])  # below the progress bars
    assert "could not be written (No space left on device): free some space" in ended.err
    assert not (tmp_path / "out" / "predictions").exists()
    assert [path for path in files_in(tmp_path / "out") if path.suffix != ".npz"] == [tmp_path / "out" / MARK]
    assert automos(*options).code == 0
    assert len(files_in(tmp_path / "out" / "predictions")) == 8


def test_labels_of_the_wrong_length_cannot_be_scored(automos, log, tmp_path):
    for folder, change in (("labels", 0), ("predictions", -1)):
        (log / folder).mkdir()
        for scan in sorted(log.glob("*.bin")):
            np.full(scan.stat().st_size // 16 + change, 9, np.uint32).tofile(log / folder / f"{scan.stem}.label")
    ended = automos("evaluate", log / "predictions", log)
    assert (ended.code, is_one_sentence(ended.err)) == (2, True)
    assert "000000.label" in ended.err
    assert ended.out == ""


@pytest.mark.parametrize("place", [(labeling, "Steps"), (cli, "app")], ids=["at work", "before the command"])
def test_ctrl_c_says_that_the_same_command_goes_on(automos, log, monkeypatch, place):
    def interrupt(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(*place, interrupt)
    before = signal.getsignal(signal.SIGINT)
    try:
        ended = automos("label", log)
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended.code == 130
    assert "the same command goes on from here" in ended.err
    assert "Traceback" not in ended.err


def test_debug_shows_where_an_error_came_from(automos, monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "argv", ["automos", "--debug", "label", str(tmp_path / "nowhere")])
    with pytest.raises(Exception, match="does not exist"):
        main()


# ------------------------------------------------------------------------------------------------------- odd input
def labels_in(out: Path) -> list[np.ndarray]:
    return [to_mos(np.fromfile(path, np.uint32)) for path in sorted((out / "predictions").iterdir())]


def spoil_points(points: np.ndarray) -> np.ndarray:
    points = points.copy()
    points[3, :3], points[5, 0], points[8, 2] = np.nan, np.inf, -np.inf
    points[10:12, :3] = 0.0
    return points


def test_points_that_are_no_measurement_get_label_0_and_the_rest_is_labelled(automos, log, poses, tmp_path):
    options = ["--poses", poses, "--preset", "paper", "--workers", 1]
    for scan in log.iterdir():
        spoil_points(np.fromfile(scan, np.float32).reshape(-1, 4)).tofile(scan)
    ended = automos("label", log, "--out", tmp_path / "out", *options)
    assert ended.code == 0
    for labels in labels_in(tmp_path / "out"):
        assert np.flatnonzero(labels == Label.UNLABELED).tolist() == [3, 5, 8, 10, 11]
    assert "40 unlabeled" in ended.out


def test_confidences_are_written_on_demand_and_what_is_unsure_is_left_out(automos, log, poses, tmp_path):
    options = ["--poses", poses, "--preset", "paper", "--workers", 1, "--unsure", 0.8, "--confidence"]
    assert automos("label", log, "--out", tmp_path / "out", *options).code == 0
    sure = [np.load(file) for file in sorted((tmp_path / "out" / "confidences").iterdir())]
    assert len(sure) == 8
    for labels, confidence in zip(labels_in(tmp_path / "out"), sure, strict=True):
        np.testing.assert_array_equal(labels == Label.UNLABELED, confidence < 0.8)
    assert automos("label", log, "--out", tmp_path / "out", *options[:-3], "--moving", "now").code == 0
    assert not list((tmp_path / "out" / "confidences").iterdir())
    assert all((labels != Label.UNLABELED).all() for labels in labels_in(tmp_path / "out"))


@pytest.mark.parametrize("preset", [pytest.param("paper", marks=pytest.mark.slow), "default"])
@pytest.mark.parametrize(
    "numbers",
    [[], [0], [0, 1], [0, 1, 2], range(8)],
    ids=["an empty scan alone", "one scan", "two scans", "three scans", "all, an empty one in the middle"],
)
def test_few_scans_and_empty_scans_are_labelled(automos, world, tmp_path, preset, numbers):
    log = write_bins(world.sequence, tmp_path / "log")
    for i, scan in enumerate(sorted(log.iterdir())):
        if i not in numbers and i > 0:
            scan.unlink()
    if len(numbers) in (0, 8):
        (log / ("000004.bin" if numbers else "000000.bin")).write_bytes(b"")
    ended = automos("label", log, "--out", tmp_path / "out", "--preset", preset, "--workers", 1)
    assert ended.code == 0, ended.err
    sizes = [scan.stat().st_size // 16 for scan in sorted(log.iterdir())]
    assert [len(labels) for labels in labels_in(tmp_path / "out")] == sizes
    assert all((labels != Label.UNLABELED).all() for labels in labels_in(tmp_path / "out"))


def test_a_world_in_which_nothing_moves_is_a_success_without_a_moving_label(automos, world, poses, tmp_path):
    still = [world.sequence[0]] * 8
    for i, scan in enumerate(still):
        rows = np.zeros((len(scan), 4), np.float32)
        rows[:, :3] = scan.points
        (tmp_path / "log").mkdir(exist_ok=True)
        rows.tofile(tmp_path / "log" / f"{i:06d}.bin")
    ended = automos("label", tmp_path / "log", "--out", tmp_path / "out", "--workers", 1)
    assert ended.code == 0
    assert "0 moving (0.00 %) on 0 objects" in ended.out
    assert all((labels == Label.STATIC).all() for labels in labels_in(tmp_path / "out"))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_what_cannot_be_told_is_still_a_mistake():
    with open("/dev/full", "w") as full:
        ended = subprocess.run([sys.executable, "-m", "automos", "settings", "--preset", "x"], stderr=full, check=False)
    assert ended.returncode == 2
    with open("/dev/full", "w") as full:
        said = subprocess.run([sys.executable, "-m", "automos", "settings"], stdout=full, stderr=-1, text=True)
    assert (said.returncode, said.stderr.strip()) == (2, "error: the system: No space left on device; free some space")


@pytest.mark.parametrize("words", [["label", ""], ["label", "log", "--out", ""], ["label", "log", "--out="]])
def test_an_empty_word_is_neither_the_working_folder_nor_the_default(monkeypatch, capsys, words):
    monkeypatch.setattr(sys, "argv", ["automos", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "a word of the command is empty" in " ".join(capsys.readouterr().err.split())


def test_a_command_that_is_started_without_streams_has_them(monkeypatch, automos):
    for name in ("stdin", "stdout", "stderr"):
        monkeypatch.setattr(sys, name, None)
    assert automos("--version").code == 0
    assert all(os.get_inheritable(stream.fileno()) for stream in (sys.stdin, sys.stdout, sys.stderr))


# ------------------------------------------------------------------------------------------------------- good input
def test_without_an_out_results_go_to_a_folder_of_the_recordings_name(automos, log, poses, tmp_path):
    ended = automos("label", log, "--poses", poses, "--preset", "paper", "--workers", 1)
    assert ended.code == 0
    assert "8 scans" in ended.out
    assert len(labels_in(tmp_path / "here" / "automos_runs" / "log")) == 8


def test_another_recording_of_the_same_name_does_not_replace_the_results_of_the_first(automos, world, poses, tmp_path):
    options = ["--poses", poses, "--preset", "paper", "--workers", 1]
    for drive in ("day1", "day2"):
        write_bins(world.sequence, tmp_path / drive / "log")
    assert automos("label", tmp_path / "day1" / "log", *options).code == 0
    files = {path: path.read_bytes() for path in files_in(tmp_path / "here")}
    ended = automos("label", tmp_path / "day2" / "log", *options)
    assert (ended.code, is_one_sentence(ended.err)) == (2, True)
    assert "automos_runs/log holds the results of" in ended.err
    assert {path: path.read_bytes() for path in files_in(tmp_path / "here")} == files
    assert automos("label", tmp_path / "day2" / "log", "--out", "automos_runs/log", *options).code == 0
    (tmp_path / "day1").rename(tmp_path / "day3")
    (tmp_path / "day2").rename(tmp_path / "day4")
    assert automos("label", tmp_path / "day4" / "log", *options).code == 0  # moved


def test_a_long_recording_that_cannot_be_labelled_is_one_sentence_as_a_short_one_is(automos, log, poses, tmp_path):
    lose_a_pose(log, poses)
    options = ["--poses", poses, "--chunk", 2, "--workers", 2, "--work", tmp_path / "work"]
    ended = automos("label", log, "--out", tmp_path / "out", *options)
    said = ended.err.splitlines()[-1]  # after the bar of its progress
    assert (ended.code, ended.out) == (2, "")
    assert said.startswith("error: ")
    assert "poses.txt holds 7 poses for 8 scans" in said


def test_all_recordings_of_a_root_are_labelled_each_into_its_folder(automos, world, tmp_path):
    for name in ("00", "01"):
        write_bins(world.sequence, tmp_path / "root" / "sequences" / name / "velodyne")
        (tmp_path / "root" / "sequences" / name / "velodyne" / "000007.bin").unlink()
    ended = automos("label", tmp_path / "root", "--out", tmp_path / "out", "--workers", 1, "--preset", "paper")
    assert ended.code == 0
    assert [len(labels_in(tmp_path / "out" / name)) for name in ("00", "01")] == [7, 7]
    (tmp_path / "root" / "sequences" / "01").rename(tmp_path / "01")
    ended = automos("label", tmp_path / "root", "--out", tmp_path / "out", "--workers", 1, "--preset", "paper")
    assert "1 of 1 recordings labelled (1 had been before)" in ended.out
    assert not (tmp_path / "out" / "predictions").exists()


def test_poses_of_one_recording_or_a_calibration_without_any_are_not_taken_for_several(automos, world, poses, tmp_path):
    for name in ("00", "01"):
        write_bins(world.sequence, tmp_path / "root" / "sequences" / name / "velodyne")
    ended = automos("label", tmp_path / "root", "--out", tmp_path / "out", "--poses", poses)
    assert (ended.code, is_one_sentence(ended.err)) == (2, True)
    assert "root holds 2 recordings, but --poses is of one" in ended.err
    for more in ((), ("--dry-run",), ("--shard", "0/2")):
        ended = automos("label", tmp_path / "root", "--out", tmp_path / "out", "--calib", poses, *more)
        assert (ended.code, is_one_sentence(ended.err)) == (2, True)
        assert "give that with --poses, or neither" in ended.err
    assert not (tmp_path / "out").exists()


def test_labels_are_scored_against_the_truth_that_lies_beside_the_scans(automos, tmp_path):
    world, log = lane(), tmp_path / "log"
    write_bins(world.sequence, log)
    (log / "labels").mkdir()
    for scan, truth in zip(world.sequence, world.truth, strict=True):
        truth.astype(np.uint32).tofile(log / "labels" / f"{scan.name}.label")
    write_kitti(tmp_path / "poses.txt", world.poses)
    options = ["--poses", tmp_path / "poses.txt", "--preset", "paper", "--workers", 1]
    automos("label", log, "--out", tmp_path / "out", *options)
    ended = automos("evaluate", tmp_path / "out", log, "--json", tmp_path / "scores.json")
    assert ended.code == 0
    iou = iou_of_moving(labels_in(tmp_path / "out"), world.truth)
    assert iou > 0.3
    assert json.loads((tmp_path / "scores.json").read_text())["iou"] == pytest.approx(iou)
    assert f"{100 * iou:.1f}" in ended.out


def test_a_dry_run_says_what_would_be_done_and_does_nothing(automos, log, tmp_path):
    ended = automos("label", log, "--dry-run")
    assert ended.code == 0
    assert "log: 8 scans from" in ended.out
    assert "automos_runs/log" in ended.out
    assert files_in(tmp_path / "here") == []


def test_options_reach_the_settings_that_are_used(automos, log, poses, tmp_path):
    (tmp_path / "mine.yaml").write_text("tracking: {max_misses: 1}\ninstances: {max_range: 50}\n")
    options = ["--preset", "paper", "--settings", tmp_path / "mine.yaml", "--set", "tracking.max_misses=2"]
    ended = automos("label", log, "--out", tmp_path / "out", "--poses", poses, "--workers", 1, *options)
    assert ended.code == 0
    used = load_settings("default", tmp_path / "out" / "settings.yaml")
    assert (used.tracking.max_misses, used.instances.max_range) == (2, 50.0)


def test_what_the_library_warns_of_is_told_once(automos, world, log, tmp_path):
    (tmp_path / "log" / "times.txt").write_text("".join(f"{0.1 * i:.1f}\n" for i in range(8)))
    write_tum(tmp_path / "poses.tum", world.poses, 1000.0 + 0.1 * np.arange(8))
    for _ in range(2):  # each command tells it
        ended = automos("label", log, "--out", tmp_path / "out", "--poses", tmp_path / "poses.tum", "--workers", 1)
        assert ended.code == 0
        assert ended.err.count("poses.tum runs on another clock than the scans") == 1
        assert f"warning: {tmp_path / 'poses.tum'} runs on another clock" in ended.err


def test_names_of_files_that_are_printed_give_the_terminal_no_orders(capsys):
    output.print(Path("\x1b[2Jrun"))
    assert capsys.readouterr().out == "\N{REPLACEMENT CHARACTER}[2Jrun\n"


def test_settings_are_printed_as_a_settings_file(automos):
    ended = automos("settings", "--preset", "paper", "--set", "instances.hdbscan.epsilons=[1.5, 0.3]")
    assert ended.code == 0
    printed = yaml.safe_load(ended.out)
    assert printed["instances"]["hdbscan"]["epsilons"] == [1.5, 0.3]
    assert printed["tracking"]["max_misses"] == 5


def test_the_version_is_printed(automos):
    assert automos("--version").out.strip() == __version__


@pytest.mark.parametrize("command", ["label", "evaluate", "settings"])
def test_every_command_explains_itself(automos, command):
    ended = automos(command, "--help")
    assert ended.code == 0
    assert command in ended.out


def test_simulate_keeps_a_recording_as_a_recorder_would(automos):
    ended = automos("simulate", "log", "--scenario", "canyon", "--sensor", "VLP-16", "--scans", 3, "--rig", "truck",
                    "--convention", "turns=1.5", "--convention", "order=random")  # fmt: skip
    assert ended.code == 0
    assert "2 scans in log (turns=1.5, order=random)" in ended.out
    scans, labels = sorted(Path("log/velodyne").iterdir()), sorted(Path("log/labels").iterdir())
    assert [s.stat().st_size // 16 for s in scans] == [t.stat().st_size // 4 for t in labels]
    refused = automos("simulate", "other", "--convention", "tuns=2")
    assert refused.code == 2
    assert "did you mean turns?" in refused.err
    assert not Path("other").exists()


def test_a_name_of_thousands_of_letters_does_not_hide_what_is_wrong_with_it(automos):
    Path("poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n")
    ended = automos("drift", "poses.txt", "a/" * 2500)
    assert ended.code == 2
    assert "File name too long" in ended.err
    assert len(ended.err) < 2100


def test_names_that_the_terminal_has_no_letters_for_are_printed_all_the_same(tmp_path):
    log = tmp_path / "Straße" / "log"
    log.mkdir(parents=True)
    (log / "0.bin").write_bytes(bytes(16))
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "1"}
    command = [sys.executable, "-P", "-m", "automos", "label", str(log), "--dry-run", "--out", str(log.parent / "out")]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, encoding="ascii")
    assert (run.returncode, run.stderr) == (0, "")
    assert "Stra\\xdfe" in run.stdout


INTERRUPTED = """
import importlib.abc, os, signal, sys

module = sys.argv.pop(1)

class Presses(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == module:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Presses())
from automos.__main__ import main
main()
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("module", ["typer", "automos.cli.compare", "automos.readers.codecs", "numba"])
def test_ctrl_c_while_the_program_is_imported_prints_no_traceback(module):
    ended = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, module, "formats"], capture_output=True, text=True, check=False
    )
    assert ended.returncode in (-signal.SIGINT, 130)
    assert "Traceback" not in ended.stderr
