"""What is written for mapping and reconstruction, read by NCore's own loader, and as drivestudio's loader reads."""

import json

import numpy as np
import pytest
from made_run import CENTERS, LABELS, SIZE, STAMPS, T_LEVEL_WORLD, T_WORLD_SENSOR, YAW, make_run, make_scans
from made_run import export as write

from automos.core.errors import InputError
from automos.core.geometry import inverse, transform
from automos.odometry.sweep_timing import SweepTiming
from automos.readers import open_sequence


def test_ncores_loader_compensates_the_rays_as_we_do_and_finds_tracks_of_boxes(tmp_path):
    v4 = pytest.importorskip("ncore.data.v4", reason="pip install '.[ncore]', in an environment of its own")
    from ncore.impl.data.types import LabelSource
    from upath import UPath

    motion = np.zeros((3, 6))
    motion[:, 0], motion[:, 5] = 1.0, 0.1  # a metre ahead and six degrees to the left in each sweep
    timing = SweepTiming("file", 0.09, share=0.9)
    run = make_run(tmp_path / "run", timing=timing, sweep_motion=motion)
    out = write(run, "ncore", tmp_path / "set")
    reader = v4.SequenceComponentGroupsReader([UPath(path) for path in out.glob("*.itar")])
    loader = v4.SequenceLoaderV4(reader)
    assert (loader.sequence_id, loader.lidar_ids) == ("street", ["lidar"])
    lidar = loader.get_lidar_sensor("lidar")
    assert lidar.frames_count == 3
    for index, scan in enumerate(make_scans()):
        start, end = lidar.frames_timestamps_us[index].tolist()
        assert (start + end) / 2e6 == pytest.approx(STAMPS[index], abs=2e-6)
        n_points = int(scan.is_valid.sum())
        assert lidar.get_frame_ray_bundle_count(index) == n_points
        label = lidar.get_frame_generic_data(index, "label")
        assert label.tolist() == np.array(LABELS[index])[scan.is_valid].tolist()
        cloud = lidar.get_frame_point_cloud(index, motion_compensation=True, with_start_points=False)
        world = transform(loader.pose_graph.evaluate_poses("lidar", "world", np.array(end, np.uint64)), cloud.xyz_m_end)
        expected = transform(T_LEVEL_WORLD @ T_WORLD_SENSOR[index], run.points_at_pose(scan, index)[scan.is_valid])
        np.testing.assert_allclose(world, expected, atol=5e-3)  # poses in between are interpolated
    found = list(loader.get_cuboid_track_observations())
    assert [box.track_id for box in found] == ["2", "2", "2"]
    assert {box.source for box in found} == {LabelSource.AUTOLABEL}
    for index, box in enumerate(found):
        np.testing.assert_allclose(box.bbox3.centroid, CENTERS[2, index], atol=1e-3)
        np.testing.assert_allclose(box.bbox3.dim, SIZE)
        assert box.bbox3.rot[2] == pytest.approx(YAW[2])


@pytest.fixture
def drive(tmp_path):
    """Return a raw drive of KITTI's with the scans of a made run, and pictures of 400 by 200 pixels."""
    image = pytest.importorskip("PIL.Image")
    day = tmp_path / "2011_09_26"
    source = day / "2011_09_26_drive_0001_sync"
    (source / "velodyne_points" / "data").mkdir(parents=True)
    for k, scan in enumerate(make_scans()):
        rows = np.column_stack([scan.points, scan.intensity / 255]).astype(np.float32)
        rows.tofile(source / "velodyne_points" / "data" / f"{k:010d}.bin")
        for number in (2, 3):
            path = source / f"image_{number:02d}" / "data" / f"{k:010d}.png"
            path.parent.mkdir(parents=True, exist_ok=True)
            image.new("RGB", (400, 200), (10 * k, 0, 0)).save(path)
    (day / "calib_velo_to_cam.txt").write_text("R: 0 -1 0 0 0 -1 1 0 0\nT: 0 0 0\n")
    rows = ["R_rect_00: 1 0 0 0 1 0 0 0 1"]
    for number, shift in ((2, 0), (3, -50)):  # the right camera is half a metre to the right
        rows.append(f"S_rect_{number:02d}: 400 200\nP_rect_{number:02d}: 100 0 200 {shift} 0 100 100 0 0 0 1 0")
    (day / "calib_cam_to_cam.txt").write_text("\n".join(rows) + "\n")
    return source


def test_drivestudio_finds_a_scene_with_pictures_cameras_and_what_moves(drive, tmp_path):
    run = make_run(tmp_path / "run", sequence=open_sequence(drive))
    out = write(run, "drivestudio", tmp_path / "scene")
    objects = json.loads((out / "instances" / "instances_info.json").read_text())
    frames = json.loads((out / "instances" / "frame_instances.json").read_text())
    assert frames == {"0": [0], "1": [0], "2": [0]}
    assert objects["0"]["class_name"] == "Car"
    told = objects["0"]["frame_annotations"]
    assert told["frame_idx"] == [0, 1, 2]
    to_camera = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    for index, scan in enumerate(make_scans()):
        np.testing.assert_allclose(np.array(told["obj_to_world"][index])[:3, 3], CENTERS[2, index])
        T = np.loadtxt(out / "ego_pose" / f"{index:03d}.txt")
        np.testing.assert_allclose(T, T_LEVEL_WORLD @ T_WORLD_SENSOR[index], atol=1e-9)
        points = np.fromfile(out / "lidar" / f"{index:03d}.bin", np.float32).reshape(-1, 4)
        np.testing.assert_allclose(points[:, :3], scan.points[scan.is_valid])
        for camera, baseline in (("0", 0.0), ("1", 0.5)):
            T_ego_camera = np.loadtxt(out / "extrinsics" / f"{camera}.txt")
            np.testing.assert_allclose(inverse(T_ego_camera)[:3, :3], to_camera[:3, :3], atol=1e-12)
            np.testing.assert_allclose(T_ego_camera[:3, 3], [0.0, -baseline, 0.0], atol=1e-12)
            assert np.loadtxt(out / "intrinsics" / f"{camera}.txt").tolist() == [100, 100, 200, 100, 0, 0, 0, 0, 0]
            picture = pytest.importorskip("PIL.Image").open(out / "images" / f"{index:03d}_{camera}.jpg")
            assert picture.size == (400, 200)
            for kind in ("all", "human", "vehicle"):
                assert (out / "dynamic_masks" / kind / f"{index:03d}_{camera}.png").exists()


def test_a_box_that_the_camera_sees_whole_is_white_in_the_masks_of_its_kind(drive, tmp_path, monkeypatch):
    image = pytest.importorskip("PIL.Image")
    monkeypatch.setitem(CENTERS, (2, 0), [20.0, 2.0, 1.8])
    run = make_run(tmp_path / "run", sequence=open_sequence(drive))
    out = write(run, "drivestudio", tmp_path / "scene") / "dynamic_masks"
    masks = {kind: np.asarray(image.open(out / kind / "000_0.png")) for kind in ("all", "human", "vehicle")}
    assert not masks["human"].any()
    np.testing.assert_array_equal(masks["all"], masks["vehicle"])
    (box,) = run.boxes_level(0).moving
    T = inverse(T_LEVEL_WORLD @ T_WORLD_SENSOR[0])
    x, y, z = transform(T, box.center[None])[0]
    assert masks["all"][round(100 - 100 * z / x), round(200 - 100 * y / x)] == 255
    assert 0.0 < (masks["all"] > 0).mean() < 0.1


def test_what_drivestudio_needs_and_a_recording_has_not_is_one_sentence(drive, tmp_path):
    with pytest.raises(InputError, match=r"street has no cameras that are read: drivestudio asks for a raw drive"):
        write(make_run(tmp_path / "array"), "drivestudio", tmp_path / "scene")
    run = make_run(tmp_path / "run", sequence=open_sequence(drive))
    (drive / "image_03" / "data" / "0000000001.png").unlink()
    with pytest.raises(InputError, match=r"image_03/data/0000000001.png is missing, and drivestudio asks for the pict"):
        write(run, "drivestudio", tmp_path / "scene")
    assert not (tmp_path / "scene" / "images").exists()
