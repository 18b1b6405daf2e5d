"""Boxes and tracks in other tools' files, with every number worked out from the run that was made by hand."""

import json
import zipfile

import numpy as np
import pytest
from forks import peak_memory
from made_run import CENTERS, SIZE, T_LEVEL_WORLD, T_WORLD_SENSOR, VELOCITY, YAW, export, make_run, make_scans
from scipy.spatial.transform import Rotation

from automos.core.geometry import inverse, transform
from automos.readers.codecs import read_columns
from automos.writers import load_export


@pytest.fixture
def run(tmp_path):
    return make_run(tmp_path / "run")


def corners(center, size, R):
    """Return the eight corners (8, 3) of a box turned by R (3, 3)."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return np.asarray(center) + 0.5 * signs * np.asarray(size) @ np.asarray(R).T


def turn(yaw):
    return Rotation.from_euler("z", yaw).as_matrix()


def true_corners(track, scan, T_target_level):
    """Return the corners of a track's box, in the frame that `T_target_level` leads to."""
    return transform(T_target_level, corners(CENTERS[track, scan], SIZE, turn(YAW[track])))


def assert_cloud_in_frame(path, scan, T_target_sensor):
    """Assert that a .pcd holds the scan's points in another frame, all that are finite, in order."""
    columns, points = read_columns(path, "pcd"), make_scans()[scan].points.astype(float)
    is_finite = np.isfinite(points).all(axis=1)
    expected = transform(T_target_sensor, points[is_finite])
    np.testing.assert_allclose(np.column_stack([columns[a] for a in "xyz"]), expected, atol=1e-5)
    np.testing.assert_array_equal(columns["intensity"], make_scans()[scan].intensity[is_finite])


def test_kitti_tracking_places_boxes_in_the_camera_that_its_calibration_tells(run, tmp_path):
    out = export(run, "kitti_tracking", tmp_path / "kitti")
    lines = [line.split() for line in (out / "label_02" / "street.txt").read_text().splitlines()]
    assert [line[:3] for line in lines] == [
        ["0", "1", "Static"],
        ["0", "2", "Moving"],
        ["1", "2", "Moving"],
        ["2", "2", "Moving"],
    ]
    assert [line[4] for line in lines] == ["0", "0", "3", "0"]
    assert lines[0][5:10] == ["-10", "-1", "-1", "-1", "-1"]
    words = (out / "calib" / "street.txt").read_text().splitlines()[1].split()
    assert words[0] == "Tr_velo_cam"
    T_camera_sensor = np.vstack([np.array(words[1:], float).reshape(3, 4), [0, 0, 0, 1]])
    # at the first scan the camera is level: forward is z, down is y, and boxes are upright in it
    for line in lines[:2]:
        height, width, length, x, y, z, rotation_y, score = (float(word) for word in line[10:])
        R = Rotation.from_euler("y", rotation_y).as_matrix()
        center = np.array([x, y - 0.5 * height, z])
        got = corners(center, [length, height, width], R)
        T_camera_level = T_camera_sensor @ inverse(T_LEVEL_WORLD @ T_WORLD_SENSOR[0])
        same_set(got, true_corners(int(line[1]), 0, T_camera_level), 2e-3)
        assert score == {1: 1.0, 2: 0.875}[int(line[1])]


def same_set(a, b, atol):
    """Assert that two sets of points are the same, in any order."""
    distance = np.linalg.norm(a[:, None] - b[None], axis=-1)
    assert distance.min(axis=0).max() < atol
    assert distance.min(axis=1).max() < atol


def test_nuscenes_results_are_in_the_frame_of_the_poses(run, tmp_path):
    told = json.loads(export(run, "nuscenes", tmp_path / "tracks.json").read_text())
    assert told["meta"] == {
        "use_camera": False,
        "use_lidar": True,
        "use_radar": False,
        "use_map": False,
        "use_external": False,
        "comment": "written by automos",
    }
    assert list(told["results"]) == ["000000", "000001", "000002"]
    for scan, token in enumerate(told["results"]):
        for box in told["results"][token]:
            assert box["sample_token"] == token
            R = Rotation.from_quat(np.roll(box["rotation"], -1)).as_matrix()
            width, length, height = box["size"]
            got = corners(box["translation"], [length, width, height], R)
            expected = true_corners(int(box["tracking_id"]), scan, inverse(T_LEVEL_WORLD))
            np.testing.assert_allclose(got, expected, atol=1e-3)
            np.testing.assert_allclose(box["velocity"], (inverse(T_LEVEL_WORLD)[:3, :3] @ VELOCITY)[:2], atol=1e-4)
    names = [(box["tracking_name"], box["tracking_score"]) for box in told["results"]["000000"]]
    assert names == [("static", 1.0), ("moving", 0.875)]


def test_openlabel_has_a_cuboid_per_frame_and_the_sensors_place(run, tmp_path):
    told = json.loads(export(run, "openlabel", tmp_path / "labels.json").read_text())["openlabel"]
    assert told["metadata"]["schema_version"] == "1.0.0"
    assert told["frame_intervals"] == [{"frame_start": 0, "frame_end": 2}]
    assert {key: (o["type"], o["frame_intervals"]) for key, o in told["objects"].items()} == {
        "1": ("static", [{"frame_start": 0, "frame_end": 0}]),
        "2": ("moving", [{"frame_start": 0, "frame_end": 2}]),
    }
    assert list(told["frames"]) == ["0", "1", "2"]
    for scan, frame in ((int(key), frame) for key, frame in told["frames"].items()):
        assert float(frame["frame_properties"]["timestamp"]) == pytest.approx(run.stamps[scan], abs=1e-6)
        (move,) = frame["frame_properties"]["transforms"].values()
        assert (move["src"], move["dst"]) == ("lidar", "world")
        matrix = np.reshape(move["transform_src_to_dst"]["matrix4x4"], (4, 4))
        np.testing.assert_allclose(matrix, T_LEVEL_WORLD @ T_WORLD_SENSOR[scan], atol=1e-8)
        for key, content in frame["objects"].items():
            (cuboid,) = content["object_data"]["cuboid"]
            R = Rotation.from_quat(cuboid["val"][3:7]).as_matrix()
            got = corners(cuboid["val"][:3], cuboid["val"][7:], R)
            np.testing.assert_allclose(got, true_corners(int(key), scan, np.eye(4)), atol=1e-5)
            assert cuboid["attributes"]["boolean"] == [{"name": "observed", "val": scan != 1}]


def test_sustech_scenes_have_points_and_boxes_upright(run, tmp_path):
    out = export(run, "sustech", tmp_path / "scene")
    for scan in range(3):
        assert_cloud_in_frame(out / "lidar" / f"{scan:06d}.pcd", scan, run.T_upright_sensor(scan))
        for box in json.loads((out / "label" / f"{scan:06d}.json").read_text()):
            psr = {key: [value[axis] for axis in "xyz"] for key, value in box["psr"].items()}
            assert psr["rotation"][:2] == [0.0, 0.0]
            got = corners(psr["position"], psr["scale"], turn(psr["rotation"][2]))
            expected = true_corners(int(box["obj_id"]), scan, inverse(run.T_level_upright(scan)))
            np.testing.assert_allclose(got, expected, atol=1e-5)
            assert box["obj_type"] == {"1": "Static", "2": "Moving"}[box["obj_id"]]


def test_cvat_gets_a_task_and_its_annotations_as_a_zip(run, tmp_path):
    out = export(run, "cvat", tmp_path / "task")
    told = json.loads((out / "annotations" / "default.json").read_text())
    with zipfile.ZipFile(out / "annotations.zip") as archive:
        assert archive.namelist() == ["annotations/default.json"]
        assert json.loads(archive.read("annotations/default.json")) == told
    names = [label["name"] for label in told["categories"]["label"]["labels"]]
    assert [item["id"] for item in told["items"]] == ["000000", "000001", "000002"]
    for scan, item in enumerate(told["items"]):
        assert item["attr"] == {"frame": scan}
        path = out / "point_clouds" / "default" / item["point_cloud"]["path"]
        assert_cloud_in_frame(path, scan, run.T_upright_sensor(scan))
        for box in item["annotations"]:
            track = box["attributes"]["track_id"]
            got = corners(box["position"], box["scale"], turn(box["rotation"][2]))
            np.testing.assert_allclose(got, true_corners(track, scan, inverse(run.T_level_upright(scan))), atol=1e-5)
            assert names[box["label_id"]] == {1: "static", 2: "moving"}[track]
            assert (box["type"], box["attributes"]["occluded"]) == ("cuboid_3d", scan == 1)


def test_segments_places_raw_points_by_the_ego_pose_in_the_world_of_the_cuboids(run, tmp_path):
    out = export(run, "segments", tmp_path / "sample")
    read = {name: json.loads((out / f"{name}.json").read_text()) for name in ("sample", "cuboids", "segmentation")}
    categories = {c["id"]: c["name"] for c in json.loads((out / "categories.json").read_text())["categories"]}
    for scan, (sample, frame) in enumerate(zip(read["sample"]["frames"], read["cuboids"]["frames"], strict=True)):
        assert_cloud_in_frame(out / sample["pcd"]["url"], scan, np.eye(4))
        assert sample["timestamp"] == round(run.stamps[scan] * 1e9)
        T = np.eye(4)
        T[:3, :3] = Rotation.from_quat([sample["ego_pose"]["heading"][f"q{a}"] for a in "xyzw"]).as_matrix()
        T[:3, 3] = [sample["ego_pose"]["position"][axis] for axis in "xyz"]
        np.testing.assert_allclose(T, T_LEVEL_WORLD @ T_WORLD_SENSOR[scan], atol=1e-6)
        for box in frame["annotations"]:
            position, size = ([box[key][axis] for axis in "xyz"] for key in ("position", "dimensions"))
            expected = true_corners(box["track_id"], scan, np.eye(4))
            np.testing.assert_allclose(corners(position, size, turn(box["yaw"])), expected, atol=1e-5)
            assert categories[box["category_id"]] == {1: "static", 2: "moving"}[box["track_id"]]
    first, none, last = read["segmentation"]["frames"]
    # 0: unlabeled, 1: static, track 2 is object 3, moving points without a track are one more
    assert first["point_annotations"] == [1, 3, 3, 0, 1, 4]
    assert (none["point_annotations"], none["annotations"]) == ([], [])
    assert last["point_annotations"] == [3, 1, 1]
    assert [(a["id"], categories[a["category_id"]]) for a in first["annotations"]] == [
        (1, "static"),
        (3, "moving"),
        (4, "moving"),
    ]


def test_supervisely_gets_an_episode_whose_figures_name_their_objects(run, tmp_path):
    out = export(run, "supervisely", tmp_path / "project")
    meta = json.loads((out / "meta.json").read_text())
    assert {c["title"]: c["shape"] for c in meta["classes"]} == dict.fromkeys(
        ("moving", "static", "unknown"), "cuboid_3d"
    )
    assert meta["projectType"] == "point_cloud_episodes"
    episode = out / "street"
    told = json.loads((episode / "annotation.json").read_text())
    clouds = json.loads((episode / "frame_pointcloud_map.json").read_text())
    assert told["framesCount"] == 3
    tracks = {o["key"]: {"static": 1, "moving": 2}[o["classTitle"]] for o in told["objects"]}
    keys = {told["key"], *tracks}
    for scan, frame in enumerate(told["frames"]):
        assert frame["index"] == scan
        assert_cloud_in_frame(episode / "pointcloud" / clouds[str(scan)], scan, run.T_upright_sensor(scan))
        for figure in frame["figures"]:
            shape = {key: [value[axis] for axis in "xyz"] for key, value in figure["geometry"].items()}
            got = corners(shape["position"], shape["dimensions"], turn(shape["rotation"][2]))
            expected = true_corners(tracks[figure["objectKey"]], scan, inverse(run.T_level_upright(scan)))
            np.testing.assert_allclose(got, expected, atol=1e-5)
            assert figure["geometryType"] == "cuboid_3d"
            keys.add(figure["key"])
    assert len(keys) == 1 + 2 + 4
    assert all(len(key) == 32 and int(key, 16) >= 0 for key in keys)


def test_points_on_no_track_are_an_object_of_their_own_for_segments_though_ids_have_gaps(tmp_path):
    run = make_run(tmp_path / "run")
    path = run.folder / "tracks.json"
    tracks = json.loads(path.read_text())
    tracks["tracks"] = [track for track in tracks["tracks"] if track["id"] == 2]  # as after a merge that removed one
    path.write_text(json.dumps(tracks))
    out = export(run, "segments", tmp_path / "sample")
    first = json.loads((out / "segmentation.json").read_text())["frames"][0]
    assert first["point_annotations"] == [1, 3, 3, 0, 1, 4]


def test_segments_holds_the_points_of_one_scan_at_a_time(run, tmp_path, monkeypatch):
    n_points = 200_000
    frame = lambda *_: {"point_annotations": [0] * n_points}  # noqa: E731
    monkeypatch.setattr("automos.writers.annotation_tools._segmentation", frame)
    out = tmp_path / "sample"
    peak = peak_memory(lambda: export(run, "segments", out))
    assert peak < 5 * 8 * n_points  # a list of pointers, its texts and what joins them; three scans have three of each
    text = (out / "segmentation.json").read_text()
    assert text == json.dumps(json.loads(text))
    assert len(json.loads(text)["frames"]) == 3


@pytest.mark.parametrize("format", ["openlabel", "segments", "supervisely"])
def test_tracks_are_listed_once_however_many_tracks_and_scans_there_are(run, tmp_path, monkeypatch, format):
    listed = []
    tracks = type(run).tracks.fget
    monkeypatch.setattr(type(run), "tracks", property(lambda self: listed.append(1) or tracks(self)))
    export(run, format, tmp_path / f"out{load_export(format).suffix}")
    assert len(listed) == 1
