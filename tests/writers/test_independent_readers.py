"""Exports read by programs that others wrote, where they are installed: `pip install -e ".[dev-readers]"`."""

import json

import numpy as np
import pytest
from made_run import CENTERS, INSTANCES, LABELS, SIZE, T_LEVEL_WORLD, VELOCITY, export, make_run, make_scans

from automos.core.geometry import inverse, transform

HINT = "pip install -e '.[dev-readers]'"


@pytest.fixture
def run(tmp_path):
    """Return a run of three scans."""
    return make_run(tmp_path / "run")


def assert_columns(read, index):
    """Assert that `read`, a function from a name to a column, gives all of scan `index`."""
    scan = make_scans()[index]
    np.testing.assert_array_equal(np.column_stack([read(axis) for axis in "xyz"]), scan.points)
    np.testing.assert_array_equal(read("intensity"), scan.intensity)
    np.testing.assert_array_equal(read("ring"), scan.ring)
    assert np.asarray(read("label")).tolist() == LABELS[index]
    assert np.asarray(read("instance")).tolist() == INSTANCES[index]


def test_plyfile_reads_ply(run, tmp_path):
    plyfile = pytest.importorskip("plyfile", reason=HINT)
    out = export(run, "ply", tmp_path / "out")
    for index in (0, 2):
        vertices = plyfile.PlyData.read(str(out / f"{index:06d}.ply"))["vertex"]
        assert_columns(vertices.__getitem__, index)


def test_pypcd4_reads_pcd(run, tmp_path):
    pypcd4 = pytest.importorskip("pypcd4", reason=HINT)
    out = export(run, "pcd", tmp_path / "out")
    for index in (0, 2):
        cloud = pypcd4.PointCloud.from_path(out / f"{index:06d}.pcd")
        assert_columns(lambda name, cloud=cloud: cloud.pc_data[name], index)


def test_the_makers_own_library_reads_mcap(run, tmp_path):
    reader = pytest.importorskip("mcap_ros2.reader", reason=HINT)
    path = export(run, "mcap", tmp_path / "street.mcap")
    clouds = [found.ros_msg for found in reader.read_ros2_messages(str(path))]
    kinds = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
    for index, cloud in enumerate(clouds):
        names = [field.name for field in cloud.fields]
        layout = np.dtype(
            {
                "names": names,
                "formats": [kinds[field.datatype] for field in cloud.fields],
                "offsets": [field.offset for field in cloud.fields],
                "itemsize": cloud.point_step,
            }
        )
        rows = np.frombuffer(bytes(cloud.data), layout)
        assert_columns(rows.__getitem__, index)


def test_vcd_reads_openlabel_and_finds_it_valid(run, tmp_path):
    core = pytest.importorskip("vcd.core", reason=HINT)
    path = export(run, "openlabel", tmp_path / "labels.json")
    told = core.OpenLABEL()
    told.load_from_file(str(path), validation=True)
    for track, scan in ((1, 0), (2, 1)):
        cuboid = told.get_object_data(track, "box", scan)
        assert cuboid["val"][:3] == CENTERS[track, scan]
        assert cuboid["val"][7:] == SIZE
    assert [told.get_object(track)["type"] for track in (1, 2)] == ["static", "moving"]


def test_the_devkit_reads_nuscenes_results(run, tmp_path, monkeypatch):
    classes = pytest.importorskip("nuscenes.eval.tracking.data_classes", reason=HINT)
    # its own names of classes are of things, not of motion
    monkeypatch.setattr(classes, "TRACKING_NAMES", ["moving", "static", "unknown"])
    told = json.loads(export(run, "nuscenes", tmp_path / "tracks.json").read_text())
    boxes = {}
    for token, rows in told["results"].items():
        for row in rows:
            box = classes.TrackingBox.deserialize(row)
            boxes[int(box.tracking_id), int(token)] = box
    assert boxes.keys() == CENTERS.keys()
    for key, box in boxes.items():
        center = transform(inverse(T_LEVEL_WORLD), np.array([CENTERS[key]]))[0]
        np.testing.assert_allclose(box.translation, center, atol=1e-3)
        np.testing.assert_allclose(box.size, [SIZE[1], SIZE[0], SIZE[2]])
        np.testing.assert_allclose(box.velocity, (inverse(T_LEVEL_WORLD)[:3, :3] @ VELOCITY)[:2], atol=1e-4)


def test_trackeval_reads_kitti_tracking(run, tmp_path):
    datasets = pytest.importorskip("trackeval.datasets", reason=HINT)
    export(run, "kitti_tracking", tmp_path / "out")
    reader = datasets.Kitti2DBox.__new__(datasets.Kitti2DBox)  # its own constructor wants the benchmark's folders
    reader.class_list = ["moving", "static", "unknown"]  # and its names of classes are of things, not of motion
    reader.class_name_to_class_id = {name: number for number, name in enumerate(reader.class_list)}
    reader.data_is_zipped, reader.seq_lengths = False, {"street": 3}
    reader.tracker_fol, reader.tracker_sub_fol = str(tmp_path), "label_02"
    told = reader._load_raw_file("out", "street", is_gt=False)
    assert [ids.tolist() for ids in told["tracker_ids"]] == [[1, 2], [2], [2]]
    assert [classes.tolist() for classes in told["tracker_classes"]] == [[1, 0], [0], [0]]
    assert all(((sure >= 0.0) & (sure <= 1.0)).all() for sure in told["tracker_confidences"])


def test_the_devkit_reads_boxes_of_kitti_tracking(run, tmp_path):
    kitti = pytest.importorskip("nuscenes.utils.kitti", reason=HINT)
    out = export(run, "kitti_tracking", tmp_path / "out")
    T_camera_sensor = np.array((out / "calib" / "street.txt").read_text().split()[-12:], float).reshape(3, 4)
    T_camera_sensor = np.vstack([T_camera_sensor, [0.0, 0.0, 0.0, 1.0]])
    seen = []
    for line in (out / "label_02" / "street.txt").read_text().splitlines():
        scan, track, told = line.split(" ", 2)  # what follows is a line of the benchmark for single frames
        box = kitti.KittiDB.parse_label_line(told)
        level = transform(inverse(run.T_level_sensor(int(scan))), np.array([CENTERS[int(track), int(scan)]]))
        center = transform(T_camera_sensor, level)[0]
        np.testing.assert_allclose(np.array(box["xyz_camera"]) - [0.0, 0.5 * SIZE[2], 0.0], center, atol=2e-3)
        np.testing.assert_allclose(box["wlh"], [SIZE[1], SIZE[0], SIZE[2]])
        assert box["name"] == ("Moving" if track == "2" else "Static")
        seen.append((int(track), int(scan)))
    assert sorted(seen) == sorted(CENTERS)


def test_the_sdk_takes_cuboids_and_segmentation_of_segments(run, tmp_path):
    typing = pytest.importorskip("segments.typing", reason=HINT)
    out = export(run, "segments", tmp_path / "out")
    cuboids = typing.PointcloudSequenceCuboidLabelAttributes(**json.loads((out / "cuboids.json").read_text()))
    for scan, frame in enumerate(cuboids.frames):
        for one in frame.annotations:
            center = [one.position.x, one.position.y, one.position.z]
            np.testing.assert_allclose(center, CENTERS[one.track_id, scan], atol=1e-5)
            assert [one.dimensions.x, one.dimensions.y, one.dimensions.z] == SIZE
    told = json.loads((out / "segmentation.json").read_text())
    segmentation = typing.PointcloudSequenceSegmentationLabelAttributes(**told)
    for scan, frame in enumerate(segmentation.frames):
        is_written = np.isfinite(make_scans()[scan].points).all(axis=1)  # as in the cloud
        is_moving = np.array(LABELS[scan])[is_written] == 251
        assert (np.array(frame.point_annotations, int) > 1).tolist() == is_moving.tolist()
    sample = typing.PointcloudSequenceSampleAttributes(**json.loads((out / "sample.json").read_text()))
    assert [frame.name for frame in sample.frames] == run.names


def test_the_sdk_reads_a_project_of_supervisely(run, tmp_path):
    hint = "pip install -e '.[dev-supervisely]' in an environment of its own"
    projects = pytest.importorskip("supervisely.project.pointcloud_episode_project", reason=hint)
    out = export(run, "supervisely", tmp_path / "out")
    project = projects.PointcloudEpisodeProject(str(out), projects.OpenMode.READ)
    (episode,) = list(project.datasets)
    told = episode.get_ann(project.meta)
    assert {item.obj_class.name for item in told.objects} == {"moving", "static"}
    assert told.frames_count == len(list(episode)) == 3
    boxes = [(frame.index, figure.geometry) for frame in told.frames for figure in frame.figures]
    assert len(boxes) == len(CENTERS)
    for index, cuboid in boxes:
        position = np.array([cuboid.position.x, cuboid.position.y, cuboid.position.z])
        level = transform(run.T_level_upright(index), position[None])[0]
        assert min(np.linalg.norm(level - center) for (_, scan), center in CENTERS.items() if scan == index) < 1e-3
        assert [cuboid.dimensions.x, cuboid.dimensions.y, cuboid.dimensions.z] == SIZE
