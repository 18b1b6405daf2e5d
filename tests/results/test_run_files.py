import json

import numpy as np
import pytest
from made_run import CENTERS, INSTANCES, LABELS, T_LEVEL_WORLD, T_WORLD_SENSOR, VELOCITY, make_run, make_scans

from automos.core.array_sequence import ArraySequence
from automos.core.errors import InputError
from automos.core.geometry import transform
from automos.core.workspace import Workspace
from automos.objects.verdict import Verdict
from automos.odometry.sweep_timing import SweepTiming
from automos.results.open_run import open_run
from automos.results.run_files import RunFiles
from automos.results.tracks_file import VERDICTS


@pytest.fixture
def run(tmp_path):
    return make_run(tmp_path / "run")


def test_labels_and_instances_are_those_of_the_run(run):
    for i, (label, ids) in enumerate(zip(LABELS, INSTANCES, strict=True)):
        assert run.labels(i, len(label)).tolist() == label
        assert run.instances(i, len(label)).tolist() == ids


def test_instances_are_read_from_the_labels_where_they_are(run):
    (run.folder / "stages").rename(run.folder / "gone")
    with pytest.raises(InputError, match=r"does not say which object .* --set output.track_ids=true"):
        run.instances(0, 6)
    packed = np.array([9, 251 | 7 << 16, 251 | 7 << 16, 0, 9, 251], np.uint32)
    packed.tofile(run.folder / "predictions" / "000000.label")
    assert run.instances(0, 6).tolist() == [0, 7, 7, 0, 0, 0]


def test_boxes_are_told_scan_by_scan_with_their_verdicts(run):
    found = run.boxes_level(0)
    assert found.ids.tolist() == [1, 2]
    assert [VERDICTS[v] for v in found.verdict] == ["static", "moving"]
    np.testing.assert_allclose(found.boxes.center, [CENTERS[1, 0], CENTERS[2, 0]])
    np.testing.assert_allclose(found.boxes.score, [1.0, 0.875])
    assert [len(run.boxes_level(i)) for i in range(3)] == [2, 1, 1]
    assert run.boxes_level(1).observed.tolist() == [False]
    assert tuple(v.name.lower() for v in Verdict) == VERDICTS


def test_the_upright_frame_is_the_sensors_with_z_up(run):
    for i in range(3):
        T = run.T_level_upright(i)
        np.testing.assert_allclose(T[:3, 2], [0, 0, 1], atol=1e-12)
        np.testing.assert_allclose(T[:3, 3], (T_LEVEL_WORLD @ T_WORLD_SENSOR[i])[:3, 3], atol=1e-8)
        # nothing but roll and pitch is between it and the sensor: 10 and 5 degrees are 11.2 together
        angle = np.degrees(np.arccos((np.trace(run.T_upright_sensor(i)[:3, :3]) - 1) / 2))
        assert angle == pytest.approx(11.2, abs=0.1)


def test_boxes_and_points_in_the_upright_frame_are_those_in_the_level_frame(run):
    for i, scan in enumerate(make_scans()):
        level, upright = run.boxes_level(i), run.boxes_upright(i)
        T = run.T_level_upright(i)
        np.testing.assert_allclose(transform(T, upright.boxes.center), level.boxes.center, atol=1e-9)
        np.testing.assert_allclose(upright.velocity @ T[:3, :3].T, np.tile(VELOCITY, (len(level), 1)), atol=1e-9)
        forth = transform(T, run.points_upright(scan, i).astype(float))
        np.testing.assert_allclose(forth, transform(run.T_level_sensor(i), scan.points.astype(float)), atol=1e-4)


def test_a_recording_of_other_scans_is_refused(run):
    other = ArraySequence([np.zeros((1, 3))] * 4, name="other")
    with pytest.raises(InputError, match=r"has no 000003.label: .* was made from another recording than other"):
        RunFiles(run.folder, other)
    with pytest.raises(InputError, match="holds no predictions for street"):
        RunFiles(run.folder / "nowhere", run.sequence)
    longer = ArraySequence([np.zeros((7, 3))] * 3, name="longer")
    with pytest.raises(InputError, match="holds 6 labels, but its scan has 7 points"):
        RunFiles(run.folder, longer).labels(0, 7)


def test_missing_and_damaged_tracks_are_told(run):
    path = run.folder / "tracks.json"
    text = path.read_text()
    path.write_text(text[:100])
    with pytest.raises(InputError, match=r"tracks.json is damaged"):
        run.boxes_level(0)
    path.unlink()
    with pytest.raises(InputError, match=r"tracks.json is missing"):
        run.boxes_level(0)
    path.write_text(json.dumps(json.loads(text) | {"tracks": []}))
    assert [len(run.boxes_level(i)) for i in range(3)] == [0, 0, 0]


def test_points_are_as_seen_from_the_pose_and_keep_their_order(tmp_path, caplog):
    # a metre forward during the sweep: the first point was measured half a metre behind, the last one half before
    motion = np.tile([1.0, 0, 0, 0, 0, 0], (3, 1))
    run = make_run(tmp_path / "run", timing=SweepTiming("file", duration=0.1, share=1.0), sweep_motion=motion)
    scan = make_scans()[2]
    points = run.points_at_pose(scan, 2)
    expected = scan.points + np.outer(scan.time / 0.1 - 0.5, [1, 0, 0])
    np.testing.assert_allclose(points, expected, atol=1e-5)
    np.testing.assert_array_equal(scan.points, make_scans()[2].points)
    (run.folder / "stages").rename(run.folder / "gone")
    np.testing.assert_array_equal(RunFiles(run.folder, run.sequence).points_at_pose(scan, 2), scan.points)
    assert "points are written as measured" in caplog.text


@pytest.mark.parametrize(
    ("where", "value", "said"),
    [
        (["T_world_level"], [[1.0, 0.0]], "t_world_level"),
        (["T_world_level", 0, 0], 7.0, "not a rigid transform"),
        (["tracks"], {}, "tracks"),
        (["tracks", 0, "id"], 0, "greater than or equal to 1"),
        (["tracks", 0, "id"], 2, "two tracks have one id"),
        (["tracks", 0, "verdict"], "parked", "'unknown', 'static' or 'moving'"),
        (["tracks", 0, "boxes", 0, "center"], [1.0, 2.0], "at least 3 items"),
        (["tracks", 0, "boxes", 0, "center", 1], float("nan"), "finite number"),
        (["tracks", 0, "boxes", 0, "size", 0], -1.0, "greater than or equal to 0"),
        (["tracks", 0, "boxes", 0, "scan"], 3, "boxes of more than 3 scans"),
        (["tracks", 1, "boxes", 0, "scan"], 1, "a track has two boxes in a scan"),
        (["tracks", 0, "boxes", 0, "scan"], 1.5, "scan"),
    ],
)
def test_tracks_that_nobody_wrote_so_are_refused_with_the_file(tmp_path, where, value, said):
    run = make_run(tmp_path / "run")
    path = run.folder / "tracks.json"
    document = json.loads(path.read_text())
    place = document
    for key in where[:-1]:
        place = place[key]
    place[where[-1]] = value
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"tracks\.json is damaged") as told:
        _ = run.tracks_file
    assert said in str(told.value).lower()


def test_a_folder_of_results_folders_is_told_with_what_is_in_it(run):
    (run.folder / "run.json").write_text('{"fingerprint": "key"}')
    with pytest.raises(InputError, match=r"holds no results of automos label .*; these in it do: run$"):
        open_run(run.folder.parent)
    (run.folder / "run.json").unlink()
    with pytest.raises(InputError, match=r"run.json is missing or damaged\)$"):
        open_run(run.folder)


def test_a_name_that_is_too_long_is_told():
    with pytest.raises(InputError, match=r"cannot be used \(File name too long\): give another path"):
        open_run("a" * 5000)


def test_what_the_run_is_is_read_once_for_all_scans(run, monkeypatch):
    read, reads = Workspace.read_run, []
    monkeypatch.setattr(Workspace, "read_run", lambda self: reads.append(self.root) or read(self))
    found = RunFiles(run.folder, run.sequence)
    n = len(reads)
    for _ in range(5):
        for i, scan in enumerate(make_scans()):
            found.instances(i), found.points_at_pose(scan, i), found.is_ground(scan, i)
    assert len(reads) == n + 1
