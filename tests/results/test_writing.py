"""The results folder of a run whose every number is made by hand."""

import errno
import json
import os

import numpy as np
import pytest
from forks import peak_memory

from automos import __version__
from automos.core.array_sequence import ArraySequence
from automos.core.atomic import write_raw
from automos.core.errors import InputError
from automos.core.geometry import make_transform
from automos.core.label_files import to_mos
from automos.core.labels import Label
from automos.core.pose_files import read_poses
from automos.core.workspace import COMPLETE, RUN_FILE, Workspace
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.trajectory import Trajectory
from automos.pipeline import Found
from automos.results import point_files
from automos.results.tracks_file import track_entries
from automos.results.writing import write_results
from automos.settings import load_settings

SEQUENCE = ArraySequence([np.ones((5, 3)), np.zeros((0, 3)), np.ones((4, 3))], 100.0 + 0.1 * np.arange(3), "street")
LABELS = [[9, 251, 251, 0, 9], [], [251, 9, 9, 0]]
TRACK_OF = [[-1, 1, 1, -1, -1], [], [1, -1, -1, -1]]
POSES = np.stack([make_transform(t=[0.5 * i, 0.0, 0.0]) for i in range(3)])
PAPER = load_settings("paper")
WITH_IDS = load_settings("paper", overrides={"output.track_ids": True})


def strictly(text: str):
    """Return JSON as other languages read it: without NaN and infinity."""

    def refuse(constant):
        raise ValueError(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


def make_result(key: str = "k", labels=LABELS) -> Found:
    """Return two tracks: 0, static, seen in the first scan; 1, moving, seen in the first and third."""
    stage = Workspace().stage("labels", key)
    for name, label, track in zip(SEQUENCE.names, labels, TRACK_OF, strict=True):
        stage.save(
            name, {"label": np.array(label, np.uint8), "track": np.array(track, np.int32), "n_body": np.array(1)}
        )
    T_level_world = make_transform(t=[0.0, 0.0, 1.8])
    trajectory = Trajectory(POSES, SEQUENCE.stamps, np.zeros((3, 6)), SweepTiming(), T_level_world, {"warnings": ["w"]})
    tracks = Tracks(
        track=np.array([0, 1, 1, 1]),
        scan=np.array([0, 0, 1, 2]),
        segment=np.array([0, 1, -1, 0]),
        center=np.array([[5.0, 0, 1], [1.0, 2, 3], [1.5, 2, 3], [2.00049, 2, 3]]),
        size=np.tile([4.0, 2.0, 1.5], (4, 1)),
        yaw=np.array([0.5, 0.1, 0.1, 0.1]),
        velocity=np.tile([5.0, 0.0, 0.0], (4, 1)),
    )
    verdicts = Verdicts(np.array([Verdict.STATIC, Verdict.MOVING], np.int8), np.array([1.0, 0.87654]))
    seconds = {"odometry": 1.23456, "labels": 0.0}
    return Found(trajectory, tracks, verdicts, SEQUENCE.names, seconds, {"odometry": "o", "labels": key}, stage)


@pytest.fixture
def folder(tmp_path):
    """Return a folder with the results."""
    write_results(tmp_path / "run", SEQUENCE, make_result(), PAPER)
    return tmp_path / "run"


def read_labels(folder) -> dict[str, list[int]]:
    return {path.stem: np.fromfile(path, np.uint32).tolist() for path in sorted((folder / "predictions").iterdir())}


def test_labels_are_one_uint32_a_point_in_a_file_of_the_scans_name(folder):
    assert read_labels(folder) == dict(zip(SEQUENCE.names, LABELS, strict=True))


def test_track_numbers_fill_the_upper_bits_of_moving_points_on_request(tmp_path):
    write_results(tmp_path, SEQUENCE, make_result(), WITH_IDS)
    first = np.array(read_labels(tmp_path)["000000"])
    np.testing.assert_array_equal(first >> 16, [0, 2, 2, 0, 0])  # the number that the track has in tracks.json
    np.testing.assert_array_equal(to_mos(first), LABELS[0])


def test_poses_are_written_as_kitti_and_as_tum(folder):
    np.testing.assert_allclose(read_poses(folder / "poses.txt", 3), POSES, atol=1e-9)
    np.testing.assert_allclose(read_poses(folder / "poses.tum", 3, SEQUENCE.stamps), POSES, atol=1e-9)
    assert float((folder / "poses.tum").read_text().split()[0]) == 100.0


def test_the_settings_written_are_those_used(folder, tmp_path):
    assert load_settings("default", folder / "settings.yaml") == PAPER


def test_tracks_are_told_with_verdict_boxes_velocity_and_frame(folder):
    told = strictly((folder / "tracks.json").read_text())
    np.testing.assert_allclose(told["T_world_level"], make_transform(t=[0.0, 0.0, -1.8]))
    assert told["scans"] == SEQUENCE.names
    parked, car = told["tracks"]
    assert (parked["id"], parked["verdict"], parked["confidence"], len(parked["boxes"])) == (1, "static", 1.0, 1)
    assert (car["id"], car["verdict"], car["confidence"]) == (2, "moving", 0.877)
    assert [(box["scan"], box["observed"], box["stamp"]) for box in car["boxes"]] == [
        (0, True, 100.0),
        (1, False, 100.1),
        (2, True, 100.2),
    ]
    assert car["boxes"][2]["center"] == [2.0, 2.0, 3.0]
    assert car["boxes"][2]["size"] == [4.0, 2.0, 1.5]
    assert car["boxes"][2]["yaw"] == 0.1
    assert car["boxes"][2]["velocity"] == [5.0, 0.0, 0.0]


def test_results_that_are_replaced_are_not_called_complete(folder):
    (folder / COMPLETE).write_text("{}")  # of a long recording, labelled in units
    write_results(folder, SEQUENCE, make_result(), PAPER)
    assert (folder / COMPLETE).exists()
    write_results(folder, SEQUENCE, make_result(), WITH_IDS)
    assert not (folder / COMPLETE).exists()


def test_a_run_without_tracks_tells_so(tmp_path):
    result = make_result()
    none = result.tracks[np.zeros(0, int)]
    empty = Found(
        result.trajectory,
        none,
        Verdicts(np.zeros(0, np.int8), np.zeros(0)),
        result.names,
        {},
        result.keys,
        result.stage,
    )
    run = write_results(tmp_path, SEQUENCE, empty, PAPER)
    assert strictly((tmp_path / "tracks.json").read_text())["tracks"] == []
    assert run["tracks"] == {"total": 0, "moving": 0}


def test_the_run_file_tells_counts_times_versions_and_fingerprints(folder):
    run = strictly((folder / RUN_FILE).read_text())
    assert run["points"] == {"unlabeled": 2, "static": 4, "moving": 3}
    assert run["points_riding_along"] == 3
    assert run["tracks"] == {"total": 2, "moving": 1}
    about = {"name": "street", "scans": 3, "input": SEQUENCE.fingerprint(), "source": None}
    about |= {"rate_hz": 10.0, "rate_from": "times"}
    (few,) = run["recording"].pop("warnings")
    assert few.startswith("3 scans over 0.2 s are too few to decide what moves")
    assert run["recording"] == about
    assert run["seconds"] == {"odometry": 1.235}
    assert run["stages"] == {"odometry": "o", "labels": "k"}
    assert run["odometry"]["warnings"] == ["w"]
    assert run["versions"]["automos"] == __version__
    assert {"python", "numpy", "numba", "hdbscan"} <= set(run["versions"])


def test_figures_that_are_no_numbers_do_not_make_the_run_file_unreadable(tmp_path):
    result = make_result()
    result.trajectory.diagnostics["thickness"] = float("nan")
    write_results(tmp_path, SEQUENCE, result, PAPER)
    assert strictly((tmp_path / RUN_FILE).read_text())["odometry"]["thickness"] is None


def test_times_of_stages_that_were_not_run_again_are_those_of_the_first_run(folder):
    result = make_result()
    result.seconds.update(odometry=0.0, labels=0.5)
    assert write_results(folder, SEQUENCE, result, PAPER)["seconds"] == {"odometry": 1.235, "labels": 0.5}


def test_nothing_else_is_left_in_the_folder(folder):
    (folder / ".poses.txt.0123abcd.part").write_text("half")
    (folder / "predictions" / ".000000.label.0123abcd.part").write_text("half")
    write_results(folder, SEQUENCE, make_result(), PAPER)
    assert sorted(path.name for path in folder.iterdir()) == [
        "poses.tum",
        "poses.txt",
        "predictions",
        "run.json",
        "settings.yaml",
        "tracks.json",
    ]
    assert list(read_labels(folder)) == SEQUENCE.names


def full_disk(path, array):
    if path.name == "000002.label":
        raise InputError(f"{path} could not be written ({os.strerror(errno.ENOSPC)})")
    write_raw(path, array)


@pytest.mark.parametrize(("result", "settings"), [(make_result("other"), PAPER), (make_result(), WITH_IDS)])
def test_labels_of_another_run_are_removed_before_the_first_new_one_is_written(folder, monkeypatch, result, settings):
    (folder / "predictions" / "000099.label").write_bytes(b"")
    (folder / "probabilities").mkdir()  # of automos segment with a network
    (folder / "probabilities" / "000000.npy").write_bytes(b"")
    monkeypatch.setattr(point_files, "write_raw", full_disk)
    with pytest.raises(InputError, match="No space left"):
        write_results(folder, SEQUENCE, result, settings)
    # two of three are new, none is old, and no run.json vouches for them
    assert list(read_labels(folder)) == ["000000", "000001"]
    assert list((folder / "probabilities").iterdir()) == []
    assert not (folder / RUN_FILE).exists()


def test_labels_of_the_same_run_stay_while_they_are_written_again(folder, monkeypatch):
    monkeypatch.setattr(point_files, "write_raw", full_disk)
    with pytest.raises(InputError, match="No space left"):
        write_results(folder, SEQUENCE, make_result(), PAPER)
    assert list(read_labels(folder)) == SEQUENCE.names
    assert (folder / RUN_FILE).exists()


def test_progress_is_told_scan_by_scan(tmp_path):
    ticks = []
    write_results(tmp_path, SEQUENCE, make_result(), PAPER, lambda *tick: ticks.append(tick))
    assert ticks == [("writing", 1, 3), ("writing", 2, 3), ("writing", 3, 3)]


def test_every_label_is_counted():
    assert {label.name.lower() for label in Label} == {"unlabeled", "static", "moving"}


def test_tracks_are_written_in_words_one_after_another():
    n, life = 400, 50
    k = np.arange(n * life)
    column = np.random.default_rng(0).normal(size=(len(k), 3))
    tracks = Tracks(k // life, k % life, 0 * k, column, np.abs(column), column[:, 0], column)
    stamps, still = 0.1 * np.arange(life), np.tile(np.eye(4), (life, 1, 1))
    trajectory = Trajectory(still, stamps, np.zeros((life, 6)), SweepTiming(), np.eye(4))
    verdicts = Verdicts(np.full(n, Verdict.STATIC, np.int8), np.ones(n))
    held = peak_memory(lambda: sum(len(one["boxes"]) for one in track_entries(tracks, verdicts, trajectory)))
    assert held < 8 * 10 * len(k)  # less than the numbers themselves


def test_tracks_that_are_wanted_are_those_of_all():
    found = make_result()
    every = list(track_entries(found.tracks, found.verdicts, found.trajectory))
    assert list(track_entries(found.tracks, found.verdicts, found.trajectory, [1])) == every[1:]
