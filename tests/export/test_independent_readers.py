"""Exports read by programs that others wrote, where they are installed: `pip install -e ".[dev-readers]"`."""

import json

import numpy as np
import pytest
from made_run import CENTERS, INSTANCES, LABELS, SIZE, T_LEVEL_WORLD, VELOCITY, export, make_run, make_scans

from automos.geometry import inverse, transform

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
