import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from street_log import OBJECTS, assert_points_lie_in_their_boxes, assert_same_points, assert_same_truth, street_log

from automos.core.errors import InputError
from automos.core.geometry import inverse, make_transform
from automos.readers import nuscenes, open_recordings, open_sequence

T_EGO_SENSOR = make_transform(Rotation.from_euler("z", -np.pi / 2).as_matrix(), [0.94, 0.0, 1.84])
T_GLOBAL_GROUND = make_transform(Rotation.from_euler("z", 0.7).as_matrix(), [1010.0, 610.0, 0.0])
KEYFRAMES = (0, 5, 10)


def placed(T):
    return {
        "translation": T[:3, 3].tolist(),
        "rotation": np.roll(Rotation.from_matrix(T[:3, :3]).as_quat(), 1).tolist(),
    }


def write_tables(root, log, scenes=("scene-0061",), attributes=True, boxes=True, version="v1.0-mini"):
    """Write scenes as nuScenes publishes them: sweeps of five columns, tables of rows with tokens."""
    tables = {name: [] for name in ("scene", "sample", "sample_data", "ego_pose", "sample_annotation")}
    names = ("vehicle.moving", "vehicle.parked", "cycle.with_rider", "pedestrian.standing")
    tables["attribute"] = [{"token": f"a-{name}", "name": name, "description": ""} for name in names]
    tables["sensor"] = [
        {"token": "s-cam", "channel": "CAM_FRONT", "modality": "camera"},
        {"token": "s-lidar", "channel": "LIDAR_TOP", "modality": "lidar"},
    ]
    tables["calibrated_sensor"] = [
        {"token": "c-cam", "sensor_token": "s-cam", **placed(np.eye(4)), "camera_intrinsic": []},
        {"token": "c-lidar", "sensor_token": "s-lidar", **placed(T_EGO_SENSOR), "camera_intrinsic": []},
    ]
    T_global_sensor = T_GLOBAL_GROUND @ log.T_ground_sensor
    for scene in scenes:
        tables["scene"].append({"token": f"t-{scene}", "name": scene, "first_sample_token": f"{scene}-0"})
        for i, scan in enumerate(log.scans):
            keyframe = max(k for k in KEYFRAMES if k <= i)
            microseconds = round(1e6 * scan.stamp)
            folder = "samples" if i in KEYFRAMES else "sweeps"
            filename = f"{folder}/LIDAR_TOP/{scene}__LIDAR_TOP__{microseconds}.pcd.bin"
            (root / folder / "LIDAR_TOP").mkdir(parents=True, exist_ok=True)
            np.column_stack([scan.points, scan.intensity, scan.ring]).astype("<f4").tofile(root / filename)
            row = {"token": f"{scene}-d{i}", "sample_token": f"{scene}-{keyframe}", "timestamp": microseconds}
            row |= {"ego_pose_token": f"{scene}-e{i}", "is_key_frame": i in KEYFRAMES}
            beside = [f"{scene}-d{k}" if 0 <= k < len(log.scans) else "" for k in (i - 1, i + 1)]
            lidar = {**row, "calibrated_sensor_token": "c-lidar", "filename": filename, "prev": beside[0]}
            lidar["next"] = beside[1]
            camera = {**row, "token": f"{scene}-c{i}", "calibrated_sensor_token": "c-cam", "filename": "x.jpg"}
            tables["sample_data"][:0] = [lidar, camera]  # rows are in no order of time
            T = T_global_sensor[i] @ inverse(T_EGO_SENSOR)
            tables["ego_pose"].append({"token": f"{scene}-e{i}", "timestamp": microseconds, **placed(T)})
            if i in KEYFRAMES:
                tables["sample"].append(
                    {"token": f"{scene}-{i}", "timestamp": microseconds, "scene_token": f"t-{scene}"}
                )
                tables["sample_annotation"] += annotations(log, i, scene, attributes)
    if not boxes:
        del tables["sample_annotation"]
    (root / version).mkdir(parents=True, exist_ok=True)
    for name, rows in tables.items():
        (root / version / f"{name}.json").write_text(json.dumps(rows))
    nuscenes._read.cache_clear()
    return root


def annotations(log, i, scene, attributes):
    found = log.boxes(i)
    rows = []
    for k, thing in enumerate(OBJECTS):
        T = T_GLOBAL_GROUND @ make_transform(Rotation.from_euler("z", found.yaw[k]).as_matrix(), found.center[k])
        is_moving = any(thing.velocity)
        # said in one keyframe only: what moves at some time moves in all
        said = "cycle.with_rider" if is_moving and i == KEYFRAMES[1] else "vehicle.parked"
        rows.append(
            {
                "token": f"{scene}-b{i}-{k}",
                "sample_token": f"{scene}-{i}",
                "instance_token": f"{scene}-i{k}",
                "attribute_tokens": [f"a-{said}"] if attributes else [],
                "size": found.size[k, [1, 0, 2]].tolist(),
                **placed(T),
            }
        )
    return rows


@pytest.fixture
def root(tmp_path):
    return write_tables(tmp_path / "nuscenes", street_log())


def test_a_scene_is_all_sweeps_of_its_lidar_in_order_of_time(root):
    sequence, log = open_sequence(root), street_log()
    assert (sequence.name, len(sequence)) == ("scene-0061", 12)
    assert sequence.names[0] == "scene-0061__LIDAR_TOP__1500000000000000"
    for got, true in zip(sequence, log.scans, strict=True):
        assert_same_points(got, true, atol=0)
    np.testing.assert_allclose(sequence.stamps, log.stamps, atol=1e-6)
    np.testing.assert_allclose(sequence.reference_poses, log.poses, atol=1e-9)


@pytest.mark.parametrize("attributes", [True, False])
def test_keyframes_have_truth_from_attributes_or_where_there_are_none_from_the_boxes(tmp_path, attributes):
    log = street_log()
    sequence = open_sequence(write_tables(tmp_path, log, attributes=attributes))
    assert [i for i in range(12) if sequence.truth(i) is not None] == list(KEYFRAMES)
    for i in KEYFRAMES:
        assert_same_truth(sequence.truth(i), log.truth[i])
        assert_points_lie_in_their_boxes(sequence, i)


def test_scenes_without_boxes_have_no_truth(tmp_path):
    sequence = open_sequence(write_tables(tmp_path, street_log(), boxes=False))
    assert sequence.truth(0) is None


def test_scenes_are_named_below_their_tables(tmp_path):
    root = write_tables(tmp_path, street_log(), scenes=("scene-0103", "scene-0061"))
    assert [s.name for s in open_recordings(root)] == ["scene-0061", "scene-0103"]
    assert [s.name for s in open_recordings(root / "v1.0-mini")] == ["scene-0061", "scene-0103"]
    assert len(open_sequence(root / "v1.0-mini" / "scene-0103")) == 12
    with pytest.raises(InputError, match=r"holds 2 recordings .* give one, as .*v1.0-mini/scene-0061"):
        open_sequence(root)
    with pytest.raises(InputError, match=r"scene.json has no scene 'scene-9'"):
        open_sequence(root / "v1.0-mini" / "scene-9")


@pytest.mark.parametrize("lost", [0, 5, 11])
def test_a_row_of_a_sweep_that_was_lost_is_told_as_its_neighbours_name_it(root, lost):
    path = root / "v1.0-mini" / "sample_data.json"
    rows = [row for row in json.loads(path.read_text()) if row["token"] != f"scene-0061-d{lost}"]
    path.write_text(json.dumps(rows))
    nuscenes._read.cache_clear()
    with pytest.raises(InputError, match=f"sample_data.json has no row scene-0061-d{lost}, which others name"):
        open_sequence(root)


def test_tables_that_name_what_is_absent_are_told(root):
    (root / "sweeps" / "LIDAR_TOP" / "scene-0061__LIDAR_TOP__1500000000300000.pcd.bin").unlink()
    with pytest.raises(InputError, match=r"sample_data.json names .*300000.pcd.bin, which is absent; unpack"):
        open_sequence(root)


@pytest.mark.parametrize("table", ["ego_pose", "calibrated_sensor", "sample_annotation"])
def test_damaged_tables_are_told(root, table):
    path = root / "v1.0-mini" / f"{table}.json"
    path.write_text(path.read_text()[:50])
    nuscenes._read.cache_clear()
    with pytest.raises(InputError, match=rf"{table}.json is damaged"):
        open_sequence(root)


@pytest.mark.parametrize("rows", ["{}", '["a"]', "3"])
def test_a_table_that_is_no_list_of_rows_is_told(root, rows):
    (root / "v1.0-mini" / "sample.json").write_text(rows)
    nuscenes._read.cache_clear()
    with pytest.raises(InputError, match=r"sample.json is damaged \(it is no list of rows\)"):
        open_sequence(root)


def test_a_pose_that_is_not_in_the_table_is_told(root):
    path = root / "v1.0-mini" / "ego_pose.json"
    path.write_text(json.dumps(json.loads(path.read_text())[1:]))
    nuscenes._read.cache_clear()
    with pytest.raises(InputError, match=r"ego_pose.json has no row scene-0061-e0, which another table names"):
        open_sequence(root)


@pytest.mark.parametrize("rotation", [[0, 0, 0, 0], [2, 0, 0, 0], [float("nan")] * 4, ["a"] * 4, None])
def test_a_pose_that_is_no_rotation_is_told_with_its_table(root, rotation):
    path = root / "v1.0-mini" / "ego_pose.json"
    rows = json.loads(path.read_text())
    rows[1]["rotation"] = rotation
    path.write_text(json.dumps(rows))
    nuscenes._read.cache_clear()
    with pytest.raises(InputError, match=r"ego_pose.json (holds a pose that is none|is damaged)"):
        open_sequence(root)


@pytest.mark.parametrize("name", ["scene-0061", "../scene"])
def test_scenes_named_twice_or_by_a_path_are_told(root, name):
    path = root / "v1.0-mini" / "scene.json"
    rows = json.loads(path.read_text())
    path.write_text(json.dumps([*rows, {**rows[0], "name": name}]))
    nuscenes._read.cache_clear()
    with pytest.raises(InputError, match=r"scene.json names a scene twice, or by a path"):
        open_recordings(root)


def test_a_file_that_is_two_scans_is_told(root):
    path = root / "v1.0-mini" / "sample_data.json"
    rows = json.loads(path.read_text())
    first, second, *_ = (row for row in rows if "/LIDAR_TOP/" in row["filename"])
    second["filename"] = first["filename"]
    path.write_text(json.dumps(rows))
    nuscenes._read.cache_clear()
    with pytest.raises(InputError, match="has two scans named scene-0061__LIDAR_TOP__"):
        open_sequence(root)
