"""A recording on disk into a results folder, whole, interrupted, killed, and refused."""

import os
import shutil
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from forks import in_a_fork
from worlds import World, lane, write_bins

from automos.core.array_sequence import ArraySequence
from automos.core.claims import MARK
from automos.core.errors import InputError
from automos.core.geometry import inverse
from automos.core.pose_writers import write_kitti
from automos.core.workspace import RUN_FILE, Workspace
from automos.labeling import label_recording, summary
from automos.live.segment import segment_recording
from automos.pipeline import Steps
from automos.readers import open_sequence
from automos.settings import load_settings

PAPER = load_settings("paper")


@pytest.fixture(scope="module")
def world() -> World:
    """Return two cyclists in a lane, twelve scans."""
    return lane()


@pytest.fixture
def recording(world, tmp_path) -> Path:
    """Return a folder with the world's scans as .bin files, and its poses beside it."""
    write_kitti(tmp_path / "poses.txt", world.poses)
    return write_bins(world.sequence, tmp_path / "log")


def run(recording: Path, out: Path, settings=PAPER) -> dict:
    return label_recording(open_sequence(recording), out, settings, recording.parent / "poses.txt", workers=1)


def predictions(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted((out / "predictions").iterdir())}


def test_every_scan_gets_a_label_file_of_its_name_and_length(world, recording, tmp_path):
    done = run(recording, tmp_path / "out")
    labels = predictions(tmp_path / "out")
    assert list(labels) == [f"{scan.name}.label" for scan in world.sequence]
    assert [len(raw) for raw in labels.values()] == [4 * len(scan) for scan in world.sequence]
    assert sum(done["points"].values()) == sum(map(len, world.sequence))
    assert done["points"]["moving"] > 0


def test_the_summary_tells_points_objects_and_place():
    done = {
        "recording": {"name": "log", "scans": 10},
        "points": {"unlabeled": 5, "static": 900, "moving": 95},
        "points_riding_along": 4,
        "tracks": {"total": 7, "moving": 2},
        "seconds": {"odometry": 1.0, "labels": 2.0},
        "odometry": {"warnings": ["no ground found."]},
    }
    text = summary(done, Path("out"), 5.0, was_there=False)
    assert "log: 10 scans, 1,000 points, 95 moving (9.50 %) on 2 objects, 5 unlabeled (4 on what rides along" in text
    assert "warning: no ground found." in text
    assert "5.0 s, 0.500 s per scan; labels in out/predictions" in text


def test_the_summary_of_a_run_that_did_nothing_does_not_tell_yesterdays_seconds_as_its_own():
    done = {
        "recording": {"name": "log", "scans": 10},
        "points": {"unlabeled": 0, "static": 900, "moving": 0},
        "tracks": {"total": 0, "moving": 0},
        "seconds": {"odometry": 1.0, "labels": 2.0},
        "odometry": {},
    }
    text = summary(done, Path("out"), 0.2, was_there=True)
    assert text.endswith("nothing to do: labelled before with these settings, in 3.0 s; labels in out/predictions")


def test_a_second_run_gives_the_same_files_without_work(recording, tmp_path):
    first = run(recording, tmp_path / "out")
    before = predictions(tmp_path / "out")
    second = run(recording, tmp_path / "out")
    assert predictions(tmp_path / "out") == before
    assert first == second  # times too: they are those of the run that did the work


def test_another_setting_in_the_same_folder_gives_what_a_fresh_folder_gives(recording, tmp_path):
    strict = load_settings("paper", overrides={"tracking.verdict.min_observations": 99})  # nothing moves
    run(recording, tmp_path / "out")
    before = predictions(tmp_path / "out")
    run(recording, tmp_path / "out", strict)
    run(recording, tmp_path / "fresh", strict)
    assert predictions(tmp_path / "out") == predictions(tmp_path / "fresh") != before


def test_changed_scans_are_labelled_again(recording, tmp_path):
    run(recording, tmp_path / "out")
    scan = recording / "000003.bin"
    np.fromfile(scan, np.float32)[:-4].tofile(scan)  # one point less
    run(recording, tmp_path / "out")
    assert len(predictions(tmp_path / "out")["000003.label"]) == scan.stat().st_size // 4


@pytest.fixture(scope="module")
def straight(world, tmp_path_factory) -> dict[str, bytes]:
    """Return the labels of a run that nobody disturbs."""
    folder = tmp_path_factory.mktemp("straight")
    write_kitti(folder / "poses.txt", world.poses)
    run(write_bins(world.sequence, folder / "log"), folder / "out")
    return predictions(folder / "out")


def run_until_killed(recording: Path, out: Path, n_saved: int) -> None:
    """Label in a process that is killed in the middle of the file after `n_saved` of them."""
    save, saved = np.savez, []

    def save_some(file, **arrays):
        if len(saved) == n_saved:
            file.write(b"half")
            file.flush()
            os.kill(os.getpid(), signal.SIGKILL)
        saved.append(file.name)
        save(file, **arrays)

    np.savez = save_some
    run(recording, out)


# one file of the odometry, twelve of the candidates, twelve of the instances, one of the tracks, twelve of the labels
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system has no signal that ends a process at once")
@pytest.mark.parametrize(("n_saved", "stage"), [(5, "candidates"), (20, "instances"), (30, "labels")])
def test_a_run_that_was_killed_goes_on_and_ends_with_the_same_labels(recording, straight, tmp_path, n_saved, stage):
    out = tmp_path / "out"
    with pytest.raises(AssertionError, match=f"ended with {-signal.SIGKILL}"):
        in_a_fork(lambda: run_until_killed(recording, out, n_saved), patience=60)
    (half,) = out.rglob(".*.part")
    assert half.parent.name.startswith(stage)
    assert not (out / RUN_FILE).exists()
    saved = {path: path.stat().st_mtime_ns for path in out.glob("stages/*/[!.]*.npz")}
    assert len(saved) == n_saved

    run(recording, out)
    assert predictions(out) == straight
    assert {path: path.stat().st_mtime_ns for path in saved} == saved
    assert [path.name for path in out.rglob(".*")] == [MARK]


@pytest.mark.parametrize("file", ["predictions/000000.label", "confidences/000000.npy", "stages/train/train.py"])
def test_results_of_another_program_are_not_replaced(file, recording, tmp_path):
    foreign = tmp_path / "out" / file
    foreign.parent.mkdir(parents=True)
    foreign.write_bytes(b"by hand")
    with pytest.raises(InputError, match="automos did not make that folder: choose another --out"):
        run(recording, tmp_path / "out")
    assert [path for path in (tmp_path / "out").rglob("*") if path.is_file()] == [foreign]
    assert foreign.read_bytes() == b"by hand"


def test_merged_corrections_are_not_labelled_over(recording, tmp_path):
    run(recording, tmp_path / "out")
    shutil.copytree(tmp_path / "out", tmp_path / "merged")
    (tmp_path / "merged" / "merge.json").write_text("{}")
    with pytest.raises(InputError, match="holds labels corrected by automos merge"):
        run(recording, tmp_path / "merged")


def test_a_recordings_own_poses_are_not_replaced(recording, tmp_path):
    own = tmp_path / "out" / "poses.txt"
    own.parent.mkdir()
    own.write_text("by GPS")
    with pytest.raises(
        InputError, match=r"out holds poses.txt, and automos did not make that folder: choose another --out"
    ):
        run(recording, tmp_path / "out")
    assert own.read_text() == "by GPS"


@pytest.mark.parametrize("place", ["out", "out/inside"])
def test_a_place_that_is_a_file_is_told(recording, tmp_path, place):
    (tmp_path / "out").write_text("I am a file")
    with pytest.raises(InputError, match="choose another --out"):
        run(recording, tmp_path / place)
    assert (tmp_path / "out").read_text() == "I am a file"


def test_a_folder_for_labels_that_is_a_file_is_told_before_the_work(recording, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "predictions").write_text("I am a file")
    with pytest.raises(InputError, match="automos did not make that folder: choose another --out"):
        run(recording, tmp_path / "out")
    assert not (tmp_path / "out" / "stages").exists()


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root and Windows may write anywhere")
def test_a_place_that_may_not_be_written_is_told(recording, tmp_path):
    (tmp_path / "out").mkdir(mode=0o500)
    with pytest.raises(InputError, match="choose another --out"):
        run(recording, tmp_path / "out")


def test_poses_are_read_with_the_calibration_given(recording, world, straight, tmp_path):
    # the camera's poses and the calibration that turns them back: the labels are those of the sensor's poses
    T_camera_sensor = np.array([[0.0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1]])
    write_kitti(tmp_path / "camera.txt", T_camera_sensor @ world.poses @ inverse(T_camera_sensor))
    (tmp_path / "calib.txt").write_text("Tr: " + " ".join(map(str, T_camera_sensor[:3].ravel())))
    sequence = open_sequence(recording)
    label_recording(sequence, tmp_path / "out", PAPER, tmp_path / "camera.txt", tmp_path / "calib.txt", workers=1)
    assert predictions(tmp_path / "out") == straight


@pytest.mark.parametrize("out", [".", "velodyne", "labels"])
def test_results_are_not_written_into_the_recordings_own_folders(world, tmp_path, out):
    log = tmp_path / "log"
    write_bins(world.sequence, log / "velodyne")
    (log / "labels").mkdir()
    (log / "labels" / "000000.label").touch()
    before = sorted(log.rglob("*"))
    with pytest.raises(InputError, match="automos did not make that folder: choose another --out"):
        label_recording(open_sequence(log), log / out, PAPER, workers=1)
    assert sorted(log.rglob("*")) == before


def test_results_in_a_folder_of_their_own_within_the_recording_go_on(world, recording):
    done = run(recording, recording / "labelled")
    assert run(recording, recording / "labelled") == done


def test_scans_whose_names_are_too_long_for_files_are_told_before_work_starts(world, tmp_path):
    scans = [replace(scan, name="a" * 250 + scan.name) for scan in world.sequence]
    for start in (
        lambda: Steps(ArraySequence(scans), PAPER, workspace=Workspace(tmp_path / "out"), workers=1).found(),
        lambda: label_recording(ArraySequence(scans), tmp_path / "out", PAPER, workers=1),
        lambda: segment_recording(ArraySequence(scans), tmp_path / "out", load_settings("default")),
    ):
        with pytest.raises(InputError, match=r"a scan is named 'aaa.* \(256 letters\), and results are files"):
            start()
    assert list(tmp_path.glob("out/*")) == []


def test_results_with_other_poses_are_replaced_only_where_that_is_asked_for(world, recording, tmp_path):
    sequence, out = open_sequence(recording), tmp_path / "out"
    first = label_recording(sequence, out, PAPER, tmp_path / "poses.txt", workers=1)
    assert label_recording(sequence, out, PAPER, tmp_path / "poses.txt", workers=1) == first
    write_kitti(tmp_path / "others.txt", world.poses + 1e-3 * np.eye(4, k=3))
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    for other in (tmp_path / "others.txt", None):
        with pytest.raises(
            InputError, match="holds results with other poses, which would be replaced: add --overwrite"
        ):
            label_recording(sequence, out, PAPER, other, workers=1)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before
    again = label_recording(sequence, out, PAPER, tmp_path / "others.txt", workers=1, overwrite=True)
    assert again["poses"] != first["poses"]
