import json
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from forks import TRACED_PATIENCE, in_a_fork
from worlds import lane, write_bins

from automos import Labeler, load_settings, open_sequence
from automos.core.atomic import held
from automos.core.errors import InputError
from automos.core.pose_files import read_poses
from automos.evaluation.predictions import find_predictions
from automos.labeling import label_recording
from automos.live.segment import results_writer, segment_recording, stamped, summary
from automos.online.labelled_scan import OBJECT_FIELDS, LabelledScan


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return open_sequence(write_bins(lane(10).sequence, tmp_path_factory.mktemp("lane")))


def test_what_is_written_is_what_the_labeler_gives_back(recording, tmp_path):
    settings = load_settings("default", None, {"output.track_ids": True, "output.confidence": True})
    run = segment_recording(recording, tmp_path / "run", settings, lag=0.3)
    labeler = Labeler(settings, lag=0.3)
    given = [g for scan in stamped(recording) for g in labeler.push(scan)] + labeler.finish()
    poses = read_poses(tmp_path / "run" / "poses.txt", len(recording), None, None, recording.names)
    np.testing.assert_allclose(poses[0], np.eye(4), atol=1e-6)
    tracks = {}
    for name, one, pose in zip(recording.names, given, poses, strict=True):
        written = np.fromfile(tmp_path / "run" / "predictions" / f"{name}.label", np.uint32)
        np.testing.assert_array_equal(written & 0xFFFF, one.labels)
        np.testing.assert_array_equal((written >> 16).astype(int) - 1, one.track_ids)
        np.testing.assert_array_equal(np.load(tmp_path / "run" / "confidences" / f"{name}.npy"), one.confidence)
        np.testing.assert_allclose(pose, np.linalg.inv(given[0].pose) @ one.pose, atol=1e-5)
        for row in one.objects:
            tracks.setdefault(int(row["track"]) + 1, []).append(int(one.index))
    document = json.loads((tmp_path / "run" / "tracks.json").read_text())
    assert {t["id"]: [box["scan"] for box in t["boxes"]] for t in document["tracks"]} == tracks
    sure = {}
    for track in document["tracks"]:
        seen = [given[box["scan"]] for box in track["boxes"]]
        sure[track["id"]] = np.mean([one.confidence[one.track_ids + 1 == track["id"]].mean() for one in seen])
    assert {t["id"]: t["confidence"] for t in document["tracks"]} == pytest.approx(sure, abs=6e-4)
    assert len(tracks) >= 2
    assert run["points"]["moving"] == sum(int((g.labels == 251).sum()) for g in given)
    assert run["lag_seconds"] == 0.3
    assert "2 objects" in summary(run, tmp_path / "run") or len(tracks) > 2


def test_labels_of_another_program_are_not_overwritten(recording, tmp_path):
    (tmp_path / "predictions").mkdir()
    (tmp_path / "predictions" / "000000.label").write_bytes(b"1234")
    with pytest.raises(InputError, match="automos did not make that folder: choose another --out"):
        segment_recording(recording, tmp_path, load_settings("default"))
    assert (tmp_path / "predictions" / "000000.label").read_bytes() == b"1234"


def test_a_second_run_replaces_the_first(recording, tmp_path):
    settings = load_settings("default")
    segment_recording(recording, tmp_path / "run", settings)
    first = (tmp_path / "run" / "predictions" / "000009.label").read_bytes()
    segment_recording(recording, tmp_path / "run", settings, lag=0.5)
    assert json.loads((tmp_path / "run" / "run.json").read_text())["lag_seconds"] == 0.5
    assert len((tmp_path / "run" / "predictions" / "000009.label").read_bytes()) == len(first)


def test_a_run_that_was_killed_is_no_result_and_the_rerun_is_as_if_it_had_not_been(recording, tmp_path):
    settings, out = load_settings("default"), tmp_path / "run"
    segment_recording(recording, tmp_path / "whole", settings)
    code = (
        "import os, sys\n"
        "from pathlib import Path\n"
        "from automos import load_settings, open_sequence\n"
        "from automos.live.segment import segment_recording\n"
        "segment_recording(open_sequence(sys.argv[1]), Path(sys.argv[2]), load_settings('default'),\n"
        "                  progress=lambda name, done, total: done == 4 and os.kill(os.getpid(), 9))\n"
    )
    killed = subprocess.run([sys.executable, "-c", code, recording.source, out], check=False)
    assert killed.returncode != 0
    assert len(list((out / "predictions").glob("*.label"))) == 4
    with pytest.raises(InputError, match="was not labelled to its end"):
        find_predictions(out, recording.name, True)
    (out / "predictions" / "of_another_recording.label").touch()
    segment_recording(recording, out, settings)
    written = {path.relative_to(out): path for path in out.rglob("*") if path.is_file()}
    assert written.keys() == {path.relative_to(tmp_path / "whole") for path in (tmp_path / "whole").rglob("*.*")}
    for name, path in written.items():
        assert name.name == "run.json" or path.read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert not (out / "stages").exists()


def test_a_folder_that_somebody_writes_into_is_refused(recording, tmp_path):
    pytest.importorskip("fcntl", reason="Windows has no locks on folders")
    with (
        held(tmp_path / "run"),
        pytest.raises(InputError, match="another process writes into"),
    ):
        segment_recording(recording, tmp_path / "run", load_settings("default"))


def test_what_label_or_merge_wrote_and_the_recording_itself_are_not_written_over(recording, tmp_path):
    (tmp_path / "labelled" / "stages" / "odometry-0").mkdir(parents=True)
    (tmp_path / "merged").mkdir()
    (tmp_path / "merged" / "merge.json").write_text("{}")
    for name, said in (("labelled", "that automos segment did not write"), ("merged", "corrected by automos merge")):
        with pytest.raises(InputError, match=f"holds labels {said}"):
            segment_recording(recording, tmp_path / name, load_settings("default"))
    before = sorted(recording.source.iterdir())
    with pytest.raises(InputError, match="automos did not make that folder: choose another --out"):
        segment_recording(recording, recording.source, load_settings("default"))
    assert sorted(recording.source.iterdir()) == before


def scan_of(index, n_objects=0):
    objects = np.zeros(n_objects, OBJECT_FIELDS)
    objects["track"] = np.arange(n_objects)
    labels, tracks = np.full(n_objects + 1, 251, np.uint8), np.arange(n_objects + 1, dtype=np.int32)
    return LabelledScan(index, 0.1 * index, np.eye(4), labels, tracks, np.ones(n_objects + 1, np.float32), objects)


def write_and_stop(out, settings):
    with results_writer(out, None, settings) as writer:
        writer.write(scan_of(0))
        raise RuntimeError


def test_what_a_sensor_sent_is_never_replaced(recording, tmp_path):
    settings, out = load_settings("default"), tmp_path / "out"
    with results_writer(out, None, settings):
        pass  # no packets came, so there is nothing to lose
    with pytest.raises(RuntimeError):  # killed
        write_and_stop(out, settings)
    again = results_writer(out, None, settings)
    with pytest.raises(InputError, match="labels of an earlier run"):
        again.__enter__()
    with results_writer(tmp_path / "whole", None, settings) as writer:
        writer.write(scan_of(0))
        writer.finish({"recording": {"name": "velodyne_2368", "scans": 1, "is_sensor": True}})
    for command in (segment_recording, label_recording):
        with pytest.raises(InputError, match="labels of what a sensor sent, which would be lost: choose another --out"):
            command(recording, tmp_path / "whole", settings)
    assert [path.name for path in (tmp_path / "whole" / "predictions").iterdir()] == ["000000.label"]


def test_an_hour_of_objects_is_kept_in_little_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("automos.live.segment.write_points", lambda *given: None)
    n_scans, n_objects = 100, 50

    def write_the_rest():
        for index in range(1, n_scans):
            writer.write(scan_of(index, n_objects))

    def memory_of_the_rest():
        tracemalloc.start()
        write_the_rest()
        ours = [tracemalloc.Filter(True, f"*/automos/{name}.py") for name in ("live/segment", "results/tracks_file")]
        return sum(file.size for file in tracemalloc.take_snapshot().filter_traces(ours).statistics("filename"))

    with results_writer(tmp_path / "out", None, load_settings("default")) as writer:
        writer.write(scan_of(0, n_objects))
        kept = in_a_fork(memory_of_the_rest, TRACED_PATIENCE)
        write_the_rest()
        run = writer.finish({})
    assert 100.0 < kept / (n_scans * n_objects) < 200.0  # bytes for a box of 13 numbers
    assert run["tracks"] == {"total": n_objects, "moving": n_objects}
    tracks = json.loads((tmp_path / "out" / "tracks.json").read_text())["tracks"]
    assert [[box["scan"] for box in track["boxes"]] for track in tracks] == [list(range(n_scans))] * n_objects
