"""Data sets of boxes for detectors, and clouds for map cleaning, read as their loaders read them."""

import pickle

import numpy as np
import pytest
from made_run import (
    CENTERS,
    INSTANCES,
    LABELS,
    SIZE,
    T_LEVEL_WORLD,
    T_WORLD_SENSOR,
    VELOCITY,
    YAW,
    export,
    make_run,
    make_scans,
)

from automos.core.geometry import inverse, transform

HINT = "pip install -e '.[dev-readers]'"
MOVING_IN = (0, 1, 2)
"""Scans in which track 2, the only one that moves, has a box."""


@pytest.fixture
def run(tmp_path):
    return make_run(tmp_path / "run")


def upright_center(run, index):
    center = np.array([CENTERS[2, index]])
    return transform(inverse(run.T_level_upright(index)), center)[0]


def openpcdet_boxes(root, split):
    """Read as pcdet.datasets.custom does: stems of ImageSets, rows of six numbers, a heading and a name."""
    found = {}
    for stem in (root / "ImageSets" / f"{split}.txt").read_text().split():
        points = np.load(root / "points" / f"{stem}.npy")
        assert points.dtype == np.float32
        assert points.shape[1] == 4
        rows = [line.strip().split(" ") for line in (root / "labels" / f"{stem}.txt").read_text().splitlines()]
        boxes = np.array([[float(value) for value in row[:-1]] for row in rows])[:, :7]
        found[int(stem)] = points, boxes, [row[-1] for row in rows]
    return found


def test_openpcdet_reads_points_and_boxes_of_what_moves(run, tmp_path):
    out = export(run, "openpcdet", tmp_path / "set")
    found = openpcdet_boxes(out, "train") | openpcdet_boxes(out, "val")
    assert tuple(sorted(found)) == MOVING_IN
    for index, (points, boxes, kinds) in found.items():
        assert kinds == ["Vehicle"]
        np.testing.assert_allclose(boxes[0, :3], upright_center(run, index), atol=1e-4)
        np.testing.assert_allclose(boxes[0, 3:6], SIZE)
        scan = make_scans()[index]
        expected = transform(run.T_upright_sensor(index), scan.points[scan.is_valid])
        np.testing.assert_allclose(points[:, :3], expected, atol=1e-4)


def test_mmdetection3d_reads_boxes_from_their_bottoms(run, tmp_path):
    out = export(run, "mmdet3d", tmp_path / "set")
    infos = [pickle.loads((out / f"infos_{split}.pkl").read_bytes()) for split in ("train", "val")]
    assert infos[0]["metainfo"]["categories"] == {"Vehicle": 0, "Pedestrian": 1, "Cyclist": 2}
    frames = infos[0]["data_list"] + infos[1]["data_list"]
    assert [frame["sample_idx"] for frame in frames] == [0, 1, 2]
    for index, frame in enumerate(frames):
        points = np.fromfile(out / "points" / frame["lidar_points"]["lidar_path"], np.float32)
        assert len(points) == frame["lidar_points"]["num_pts_feats"] * make_scans()[index].is_valid.sum()
        (thing,) = frame["instances"]
        assert (thing["bbox_label_3d"], thing["track_id"]) == (0, 2)
        np.testing.assert_allclose(thing["bbox_3d"][:3], upright_center(run, index) - [0, 0, SIZE[2] / 2], atol=1e-6)


def test_the_devkit_reads_the_tables_of_nuscenes(run, tmp_path):
    nuscenes = pytest.importorskip("nuscenes.nuscenes", reason=HINT)
    out = export(run, "nuscenes-tables", tmp_path / "root")
    read = nuscenes.NuScenes("v1.0-automos", str(out), verbose=False)
    (scene,) = read.scene
    assert (scene["name"], scene["nbr_samples"]) == ("street", 3)
    token, index = scene["first_sample_token"], 0
    while token:
        sample = read.get("sample", token)
        data = sample["data"]["LIDAR_TOP"]
        path, boxes, _ = read.get_sample_data(data)
        (box,) = read.get_boxes(data)
        np.testing.assert_allclose(box.center, CENTERS[2, index], atol=1e-4)
        np.testing.assert_allclose(box.wlh, [SIZE[1], SIZE[0], SIZE[2]])
        assert box.orientation.yaw_pitch_roll[0] == pytest.approx(YAW[2])
        T_sensor_level = inverse(T_LEVEL_WORLD @ T_WORLD_SENSOR[index])
        np.testing.assert_allclose(
            boxes[0].center, transform(T_sensor_level, np.array([CENTERS[2, index]]))[0], atol=1e-4
        )
        scan = make_scans()[index]
        points = np.fromfile(path, np.float32).reshape(-1, 5)
        np.testing.assert_array_equal(points[:, :3], scan.points[scan.is_valid])
        np.testing.assert_array_equal(points[:, 4], scan.ring[scan.is_valid])
        labels = np.fromfile(out / read.get("lidarseg", data)["filename"], np.uint8)
        truth = zip(np.array(LABELS[index])[scan.is_valid], np.array(INSTANCES[index])[scan.is_valid], strict=True)
        assert labels.tolist() == [
            0 if label == 0 else 1 if label == 9 else 2 if track else 6 for label, track in truth
        ]
        if 0 < index < 2:
            np.testing.assert_allclose(read.box_velocity(boxes[0].token)[:2], VELOCITY[:2], atol=1e-3)
        token, index = sample["next"], index + 1
    assert index == 3


def test_tier_iv_finds_no_error_in_a_t4_data_set_and_reads_its_boxes(run, tmp_path):
    sanity = pytest.importorskip("t4_devkit.sanity", reason="its 0.8 is no package: see benchmarks/consumers/table.py")
    from t4_devkit import T4Devkit

    out = export(run, "t4", tmp_path / "root")
    reports = sanity.sanity_check(str(out)).reports
    wrong = [(str(report.id), report.reasons) for report in reports if report.is_failed()]
    assert len(reports) > 50
    assert wrong == []
    read = T4Devkit(str(out), verbose=False)
    for index, sample in enumerate(sorted(read.sample, key=lambda sample: sample.timestamp)):
        (box,) = read.get_box3ds(sample.data["LIDAR_CONCAT"])
        np.testing.assert_allclose(box.position, CENTERS[2, index], atol=1e-4)
        np.testing.assert_allclose(box.size, [SIZE[1], SIZE[0], SIZE[2]])
        assert box.semantic_label.name == "vehicle.car"
    (made_by,) = read.sample_annotation[0].autolabel_metadata
    assert (made_by.name, made_by.score) == ("automos", 0.875)


def test_dufomap_reads_clouds_in_the_world_with_the_sensors_pose(run, tmp_path, monkeypatch):
    dufomap = pytest.importorskip("dufomap", reason="pip install -e '.[dufomap]'")
    pcdpy3 = pytest.importorskip("dufomap.utils.pcdpy3")
    monkeypatch.setattr(np, "fromstring", np.frombuffer)  # its reader calls what NumPy 2.3 no longer has
    out = export(run, "dynamicmap", tmp_path / "set")
    together = []
    for index in (0, 2):
        cloud = pcdpy3.PointCloud.from_path(str(out / "pcd" / f"{index:06d}.pcd"))
        T = inverse(T_WORLD_SENSOR[0]) @ T_WORLD_SENSOR[index]
        scan = make_scans()[index]
        got = np.asarray(cloud.np_data)
        np.testing.assert_allclose(got[:, :3], transform(T, scan.points[scan.is_valid]), atol=1e-4)
        assert got[:, 3].tolist() == [float(label == 251) for label in np.array(LABELS[index])[scan.is_valid]]
        viewpoint = [float(value) for value in cloud.viewpoint]
        np.testing.assert_allclose(viewpoint[:3], T[:3, 3], atol=1e-6)
        dufomap.dufomap(resolution=0.1, d_s=0.2, d_p=1, num_threads=1).run(got[:, :3], viewpoint, cloud_transform=False)
        together.append(got)
    whole = pcdpy3.PointCloud.from_path(str(out / "gt_cloud.pcd"))
    np.testing.assert_array_equal(np.asarray(whole.np_data), np.concatenate(together))
