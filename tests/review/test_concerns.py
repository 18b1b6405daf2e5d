"""Warnings point at something, and only when it is there."""

import json
import shutil

import numpy as np
import pytest

from automos.core.geometry import make_transform
from automos.core.pose_writers import write_kitti
from automos.labeling import label_recording, summary
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict
from automos.readers import open_sequence
from automos.results.open_run import open_run
from automos.review.concerns import _steep, find_concerns
from automos.review.run_stages import RunStages
from automos.review.session import Session
from automos.settings import load_settings
from automos.views.report import write_report


@pytest.fixture
def stages(lane_run, tmp_path):
    run = shutil.copytree(lane_run, tmp_path / "run")
    return RunStages(run, open_sequence(lane_run.parent / "lane"))


def test_a_whole_recording_warns_of_nothing(stages):
    assert find_concerns(stages, has_given_poses=True) == []
    assert json.loads((stages.folder / "run.json").read_text())["warnings"] == []


def test_a_track_that_ends_while_the_thing_goes_on_is_told_with_scan_and_place(stages):
    moving = np.flatnonzero(stages.verdicts.verdict == Verdict.MOVING)
    track = int(moving[np.argmax([stages.tracks.is_observed[stages.tracks.rows_of(k)].sum() for k in moving])])
    rows = stages.tracks.rows_of(track)
    gone = slice(rows.start + 6, rows.stop)
    lost = stages.tracks[np.arange(gone.start, gone.stop)]
    keep = np.ones(len(stages.tracks.track), bool)
    keep[gone] = False
    stages.tracks = Tracks(*(column[keep] for column in stages.tracks.to_arrays().values()))
    (concern,) = find_concerns(stages, has_given_poses=False)
    assert (concern["kind"], concern["track"]) == ("lost", track + 1)
    assert concern["scan"] in {stages.names[i] for i in lost.scan}
    first = lost.center[lost.scan == stages.index[concern["scan"]], :2][0]
    assert np.linalg.norm(np.subtract(concern["at"], first)) < 1.0
    last = stages.names[stages.tracks.scan[stages.tracks.rows_of(track)][-1]]
    assert f"Object {track + 1} ends after scan {last}" in concern["sentence"]


def test_two_scans_are_too_short_to_decide_and_it_is_said(lane_run, tmp_path):
    recording = tmp_path / "two"
    shutil.copytree(lane_run.parent / "lane", recording)
    for path in [*sorted((recording / "velodyne").iterdir())[2:], *sorted((recording / "labels").iterdir())[2:]]:
        path.unlink()
    (recording / "times.txt").write_text("0.0\n0.1\n")
    run = label_recording(open_sequence(recording), tmp_path / "out", load_settings("default"), workers=1)
    (sentence,) = run["recording"]["warnings"]
    assert sentence.startswith("2 scans over 0.1 s are too few to decide what moves")
    assert f"warning: {sentence}" in summary(run, tmp_path / "out", 1.0, was_there=False)
    page = Session(open_run(tmp_path / "out", recording)).overview()
    assert page["sentences"] == [sentence]
    write_report(open_run(tmp_path / "out", recording), tmp_path / "report.html")
    assert sentence in (tmp_path / "report.html").read_text()


def test_poses_of_a_camera_are_told_and_those_of_the_sensor_are_not(lane_run, tmp_path):
    recording = lane_run.parent / "lane"
    R_camera_sensor = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    T = make_transform(R_camera_sensor)
    sequence = open_sequence(recording)
    poses = np.tile(np.eye(4), (len(sequence), 1, 1))
    poses[:, 0, 3] = 0.5 * np.arange(len(sequence))  # ahead, 5 m/s
    for name, given in (("sensor", poses), ("camera", T @ poses @ np.linalg.inv(T))):
        write_kitti(tmp_path / f"{name}.txt", given)
        run = label_recording(
            sequence, tmp_path / name, load_settings("default"), pose_file=tmp_path / f"{name}.txt", workers=1
        )
        kinds = [warning["kind"] for warning in run["warnings"]]
        assert kinds.count("camera") == (name == "camera")


def test_a_ramp_of_a_car_park_is_no_camera():
    way = np.linspace(0.0, 100.0, 50)
    assert _steep(np.column_stack([way, 0.0 * way, 0.15 * way])) == []
    assert _steep(np.column_stack([0.02 * way, 0.0 * way, way]))[0]["kind"] == "camera"
