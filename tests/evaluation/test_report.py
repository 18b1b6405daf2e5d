import io
import json

import numpy as np
import pytest
from rich.console import Console

from automos.core.errors import InputError
from automos.core.label_files import to_mos
from automos.core.labels import Label
from automos.evaluation.boxes import objects_table
from automos.evaluation.moving import RANGES, Counts
from automos.evaluation.report import Report, Result, evaluate_folder, evaluate_recordings
from automos.readers import open_recordings, open_sequence


def make_drive(root, name, truth_per_scan):
    """Write a drive whose points of scan i lie 10, 20, 40 and 60 m away, with the given labels."""
    drive = root / "sequences" / name
    (drive / "velodyne").mkdir(parents=True)
    (drive / "labels").mkdir()
    for i, truth in enumerate(truth_per_scan):
        points = np.zeros((len(truth), 4), np.float32)
        points[:, 0] = np.resize([10, 20, 40, 60], len(truth))
        points.tofile(drive / "velodyne" / f"{i:06d}.bin")
        np.array(truth, np.uint32).tofile(drive / "labels" / f"{i:06d}.label")
    return drive


def write_predictions(folder, labels_per_scan):
    folder.mkdir(parents=True, exist_ok=True)
    for i, labels in enumerate(labels_per_scan):
        np.array(labels, np.uint32).tofile(folder / f"{i:06d}.label")
    return folder


CAR = 1 << 16 | 252
TRUTH = [[CAR, CAR, 9, 0], [CAR, 9, 9, 9]]


@pytest.fixture
def drive(tmp_path):
    return make_drive(tmp_path / "data", "00", TRUTH)


def test_a_folder_of_labels_is_scored_by_hand(drive, tmp_path):
    folder = write_predictions(tmp_path / "out", [[251, 9, 251, 251], [251, 9, 9, 0]])
    # TD: 10 m twice. FS: the car at 20 m. FD: the point at 40 m. The unlabeled point at 60 m is ignored.
    result = evaluate_folder(folder, open_sequence(drive))
    scores = result.counts.scores
    assert (scores.true_dynamic, scores.false_dynamic, scores.false_static) == (2, 1, 1)
    by_range = result.counts.scores_by_range
    assert [by_range[r].iou for r in ("0-15 m", "15-30 m", "30-50 m")] == [1.0, 0.0, 0.0]
    assert np.isnan(by_range["50+ m"].iou)
    np.testing.assert_allclose(result.movers.recall, [2 / 3])


@pytest.mark.parametrize("home", ["", "predictions", "00/predictions", "sequences/00/predictions", "00"])
def test_predictions_are_found_in_results_folders_and_the_benchmarks_layout(drive, tmp_path, home):
    write_predictions(tmp_path / "out" / home, TRUTH)
    report = evaluate_recordings(tmp_path / "out", open_recordings(drive))
    assert report.scores.iou == 1.0


def test_poses_of_the_benchmark_do_not_make_its_folders_a_run_of_ours(drive):
    (drive / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 2)
    write_predictions(drive / "predictions", TRUTH)
    root = drive.parents[1]
    assert evaluate_recordings(root, open_recordings(root)).scores.iou == 1.0
    (drive / "tracks.json").write_text("{}")
    with pytest.raises(InputError, match="was not labelled to its end"):
        evaluate_recordings(root, open_recordings(root))


def test_two_recordings_of_one_name_are_not_scored_as_one(drive, tmp_path):
    other = open_sequence(make_drive(tmp_path / "other", "00", TRUTH))
    write_predictions(tmp_path / "out" / "00", TRUTH)
    with pytest.raises(InputError, match="two recordings are named 00"):
        evaluate_recordings(tmp_path / "out", [open_sequence(drive), other])


def test_recordings_are_pooled_and_listed(drive, tmp_path):
    make_drive(tmp_path / "data", "01", [[CAR] * 8])
    write_predictions(tmp_path / "out" / "00" / "predictions", TRUTH)
    write_predictions(tmp_path / "out" / "01" / "predictions", [[9] * 8])
    seen = []
    report = evaluate_recordings(tmp_path / "out", open_recordings(tmp_path / "data"), lambda *step: seen.append(step))
    assert report.scores.iou == pytest.approx(3 / 11)  # 3 of 3 and 0 of 8
    values = json.loads(report.to_json())
    assert values["iou"] == pytest.approx(3 / 11)
    assert (values["n_scans"], values["true_dynamic"], values["false_static"]) == (3, 3, 8)
    assert values["recordings"]["00"]["iou"] == 1.0
    assert values["recordings"]["01"]["recall"] == 0.0
    assert values["recordings"]["01"]["precision"] is None
    assert values["recordings"]["01"]["objects"] == [
        {
            **{"instance": 1, "label": 252, "n_scans": 1, "n_points": 8, "recall": 0.0},
            **{"outcome": "missed", "track": 0, "association": 0.0},
        }
    ]
    assert values["recordings"]["01"]["of_objects"] is None  # no label names a track
    assert values["ranges"]["0-15 m"]["true_dynamic"] == 2
    assert seen == [("evaluating 00", 1, 2), ("evaluating 00", 2, 2), ("evaluating 01", 1, 1)]


def test_the_table_shows_percent_points_and_objects(drive, tmp_path):
    write_predictions(tmp_path / "out", [[251, 9, 251, 251], [251, 9, 9, 0]])
    report = evaluate_recordings(tmp_path / "out", [open_sequence(drive)])
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(report.table())
    text = console.export_text()
    line = next(line for line in text.splitlines() if "all points" in line)
    assert " ".join(line.replace("│", " ").split()) == "all points 50.0 66.7 66.7 2 1 1 1 of 1"
    assert all(name in text for name in ("0-15 m", "15-30 m", "30-50 m", "50+ m"))


def test_tracks_in_the_upper_bits_are_scored_as_objects(drive, tmp_path):
    labels = [[251 | 4 << 16, 251 | 4 << 16, 9, 0], [251 | 4 << 16, 9, 251 | 8 << 16, 9]]
    report = evaluate_recordings(write_predictions(tmp_path / "out", labels), [open_sequence(drive)])
    (mover,) = report.to_dict()["recordings"]["00"]["objects"]
    assert (mover["outcome"], mover["track"], mover["association"], mover["n_points"]) == ("whole", 4, 1.0, 3)
    assert report.objects["tracks_elsewhere"] == 1
    assert np.isnan(report.objects["association"])  # of movers of 300 points
    assert json.loads(report.to_json())["objects"]["association"] is None
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(objects_table(report.objects))
    text = console.export_text()
    assert "0 of 0 whole; 0 missed, 0 split, 0 merged" in text
    assert "0.0 % on movers, 0.0 % elsewhere" in text


def test_the_table_of_a_long_recording_has_whole_words_in_80_columns():
    confusion = np.zeros((len(RANGES), 3, 3), np.int64)
    confusion[0, 1:, 1:] = [[400_000_000, 1_234_567], [12_345_678, 123_456_789]]
    report = Report({"drive": Result(Counts(confusion, 4541))})
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(report.table())
    text = console.export_text()
    assert "…" not in text
    assert all(word in text.split() for word in ("IoU", "precision", "recall", "right", "wrong", "missed", "objects"))
    assert sum("all points" in line for line in text.splitlines()) == 1


def test_a_missing_prediction_is_an_error_and_shifts_nothing(drive, tmp_path):
    folder = write_predictions(tmp_path / "out", TRUTH)
    (folder / "000000.label").unlink()
    with pytest.raises(InputError, match=r"000000\.label is missing"):
        evaluate_folder(folder, open_sequence(drive))


@pytest.mark.parametrize(
    ("n_bytes", "said"), [(12, "holds 3 labels"), (20, "holds 5 labels"), (13, "has 13 bytes"), (0, "holds 0 labels")]
)
def test_a_prediction_of_another_length_is_an_error(drive, tmp_path, n_bytes, said):
    folder = write_predictions(tmp_path / "out", TRUTH)
    (folder / "000001.label").write_bytes(bytes(n_bytes))
    with pytest.raises(InputError, match=rf"000001\.label {said}"):
        evaluate_folder(folder, open_sequence(drive))


def test_a_prediction_of_a_class_that_there_is_not_is_an_error(drive, tmp_path):
    folder = write_predictions(tmp_path / "out", TRUTH)
    np.array([9, 251, 65536 * 7 + 9, 2304], np.uint32).tofile(folder / "000001.label")
    with pytest.raises(InputError, match=r"000001\.label has a point of class 2304, which SemanticKITTI has not"):
        evaluate_folder(folder, open_sequence(drive))


def test_predictions_that_are_nowhere_are_an_error(drive, tmp_path):
    with pytest.raises(InputError, match="holds no predictions for 00"):
        evaluate_recordings(tmp_path, [open_sequence(drive)])


def test_recordings_without_truth_are_left_out_and_none_with_truth_is_an_error(drive, tmp_path, caplog):
    bare = make_drive(tmp_path / "data", "01", [[9]])
    (bare / "labels" / "000000.label").unlink()
    write_predictions(tmp_path / "out" / "00", TRUTH)
    report = evaluate_recordings(tmp_path / "out", open_recordings(tmp_path / "data"))
    assert list(report.recordings) == ["00"]
    assert "left out, without truth: 01" in caplog.text
    with pytest.raises(InputError, match="01 came without labels"):
        evaluate_recordings(tmp_path / "out", [open_sequence(bare)])


@pytest.mark.recordings
def test_a_real_drive_is_scored_from_files_as_from_arrays(recordings, tmp_path):
    sequence = open_sequence(recordings / "sequences" / "kitti_0005")
    kept = range(0, 154, 30)

    class Part(type(sequence)):
        """Every thirtieth scan."""

        def truth(self, index):
            return super().truth(index) if index in kept else None

    part = Part(sequence.source)
    td = fd = fs = 0
    for i in kept:
        # Called moving: everything between 5 and 15 m ahead.
        x = sequence[i].points[:, 0]
        is_moving = (x > 5) & (x < 15)
        np.where(is_moving, 251, 9).astype(np.uint32).tofile(tmp_path / f"{sequence.names[i]}.label")
        truth = to_mos(sequence.truth(i))
        td += int((is_moving & (truth == Label.MOVING)).sum())
        fd += int((is_moving & (truth == Label.STATIC)).sum())
        fs += int((~is_moving & (truth == Label.MOVING)).sum())
    result = evaluate_folder(tmp_path, part)
    assert result.counts.n_scans == len(kept)
    scores = result.counts.scores
    assert (scores.true_dynamic, scores.false_dynamic, scores.false_static) == (td, fd, fs)
    assert min(td, fd, fs) > 0
    assert sum(scores.true_dynamic for scores in result.counts.scores_by_range.values()) == td
    assert result.movers.n_found.sum() == td


@pytest.mark.parametrize(
    ("lag", "moving", "is_said"),
    [({"lag_seconds": 0.5}, "null", True), ({"lag_seconds": 0.5}, "sequence", False), ({}, "null", False),
     ({}, "now", True), ({"lag_seconds": None}, "null", False), ({"lag_seconds": 0.5}, "{}", False)],
)  # fmt: skip
def test_labels_of_what_moves_now_are_told(drive, tmp_path, caplog, lag, moving, is_said):
    folder = write_predictions(tmp_path / "out" / "predictions", TRUTH).parent
    (folder / "run.json").write_text(json.dumps({"recording": {}, "points": {}, "versions": {}, **lag}))
    (folder / "settings.yaml").write_text(f"labels:\n  moving: {moving}\n")
    assert evaluate_recordings(folder, open_recordings(drive)).scores.iou == 1.0
    assert ("the labels of 00 say what moves in each scan" in caplog.text) == is_said
