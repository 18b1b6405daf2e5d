"""Data sets for trainers, made of runs whose every point is known, and read as trainers read them."""

import json
from dataclasses import replace
from glob import glob

import numpy as np
import pytest
import yaml
from loaders import HelimosTrainer, RangeImageTrainer
from made_run import INSTANCES, LABELS, SIZE, T_LEVEL_WORLD, T_WORLD_SENSOR, make_run, make_scans

from automos.core.errors import InputError
from automos.core.geometry import inverse, transform
from automos.core.scan import Scan
from automos.odometry.sweep_timing import SweepTiming
from automos.results.run_files import RunFiles
from automos.writers.training.make import make_training_set
from automos.writers.training.members import members_of
from automos.writers.training.scans import ImageSensor
from automos.writers.training.sequence import Extras

KEPT = [0, 2]
"""The scans of the made run that have points."""


def deskewed(run):
    return RunFiles(run.folder, run.sequence, deskewed=True)


@pytest.fixture
def run(tmp_path):
    return deskewed(make_run(tmp_path / "run"))


@pytest.fixture
def other(tmp_path):
    """Return another run, of a recording whose name has blanks and letters beyond ASCII."""
    return deskewed(make_run(tmp_path / "other", "Straße am Park"))


def of_use(index):
    return np.isfinite(make_scans()[index].points).all(axis=1)


def test_a_range_image_trainer_reads_what_was_labelled(run, other, tmp_path):
    make_training_set([run, other], tmp_path / "set", "semantickitti", splits={"Straße am Park": "valid"})
    for split in ("train", "valid"):
        read = RangeImageTrainer(tmp_path / "set", split)
        assert len(read.scans) == len(KEPT)
        expected = [np.linalg.inv(T_WORLD_SENSOR[0]) @ T_WORLD_SENSOR[index] for index in KEPT]
        np.testing.assert_allclose(read.poses[0], expected, atol=1e-9)
        for k, index in enumerate(KEPT):
            points, classes, _ = read[k]
            scan = make_scans()[index]
            np.testing.assert_array_equal(points[:, :3], scan.points[of_use(index)])
            np.testing.assert_allclose(points[:, 3], scan.intensity[of_use(index)] / 255, rtol=1e-6)
            theirs = {0: 0, 9: 1, 251: 2}
            assert classes.tolist() == [theirs[n] for n in np.array(LABELS[index])[of_use(index)].tolist()]
    assert [path.name for path in sorted((tmp_path / "set" / "sequences").iterdir())] == ["50", "51"]


def test_kiss_icp_reads_the_sequence(run, tmp_path):
    kitti = pytest.importorskip("kiss_icp.datasets.kitti")
    make_training_set([run], tmp_path / "set", "semantickitti")
    read = kitti.KITTIOdometryDataset(tmp_path / "set", 50)
    assert len(read) == len(KEPT)
    np.testing.assert_allclose(read.load_poses(tmp_path / "set" / "poses" / "50.txt"), T_WORLD_SENSOR[KEPT], atol=1e-9)
    assert len(read[0][0]) == of_use(0).sum()


def test_a_helimos_trainer_reads_what_was_labelled(run, other, tmp_path):
    root = tmp_path / "set"
    make_training_set([run, other], root, "helimos", splits={"Straße am Park": "valid"})
    named = yaml.safe_load((root / "mos4d.yaml").read_text())["training"]
    assert named["train"] == ["street/train.txt"]
    assert named["val"] == ["Straße am Park/val.txt"]
    for sequence in (*named["train"], *named["val"]):
        read = HelimosTrainer(root, sequence)
        for k, index in enumerate(KEPT):
            points, labels = read[k]
            np.testing.assert_array_equal(points, make_scans()[index].points[of_use(index)])
            theirs = {0: -1, 9: 0, 251: 1}
            assert labels.tolist() == [theirs[n] for n in np.array(LABELS[index])[of_use(index)].tolist()]


@pytest.mark.parametrize(("ids", "numbers"), [("universal", {0: 0, 9: 99, 251: 259}), ("mos", {0: 0, 9: 9, 251: 251})])
def test_ids_are_numbered_as_asked_and_objects_only_where_tools_bear_them(run, tmp_path, ids, numbers):
    make_training_set([run], tmp_path / "set", "semantickitti", ids)
    for k, index in enumerate(KEPT):
        raw = np.fromfile(tmp_path / "set" / "sequences" / "50" / "labels" / f"{k:06d}.label", np.uint32)
        assert (raw & 0xFFFF).tolist() == [numbers[n] for n in np.array(LABELS[index])[of_use(index)].tolist()]
        objects = np.array(INSTANCES[index])[of_use(index)] if ids == "universal" else 0 * raw
        assert (raw >> 16).tolist() == objects.tolist()


def test_insmos_boxes_are_in_the_sensors_frame(run, tmp_path):
    make_training_set([run], tmp_path / "set", "semantickitti", extras=Extras(boxes=True))
    boxes = np.load(tmp_path / "set" / "sequences" / "50" / "boundingbox_label" / "000000.npy", allow_pickle=True)
    assert [(row[1], row[2]) for row in boxes] == [(1, 0), (1, 1)]  # cars by their size; the second moves
    T_sensor_level = inverse(T_LEVEL_WORLD @ T_WORLD_SENSOR[0])
    np.testing.assert_allclose(boxes[0][3][:3], transform(T_sensor_level, np.array([[5.0, 0.0, 1.0]]))[0], atol=1e-6)
    assert boxes[0][3][3:6] == SIZE


def test_the_manifest_maps_every_scan_back_and_the_list_names_those_with_movers(run, tmp_path):
    made = make_training_set([run], tmp_path / "set", "semantickitti")
    manifest = json.loads((tmp_path / "set" / "dataset.json").read_text())
    scans = manifest["sequences"]["sequences/50"]["scans"]
    assert scans == [
        {"name": "000000", "points": 6, "moving": 3},
        {"name": "000002", "points": 3, "moving": 1},
    ]
    assert "unfinished" not in manifest
    assert (tmp_path / "set" / "train_split_dynamic_pointnumber.txt").read_text() == "50 000000 3\n50 000001 1\n"
    assert made.sentences()[0].startswith("street: sequence 50, train, 2 scans, 2 with movers")
    assert "--split valid=NAME" in made.sentences()[1]


def test_scans_in_which_nothing_moves_are_counted(run, tmp_path, monkeypatch):
    monkeypatch.setattr(RunFiles, "labels", lambda self, index, n: np.full(n, 9, np.uint16))
    made = make_training_set([run], tmp_path / "set", "semantickitti", "mos")
    assert any("nothing moves in 2 scans" in sentence for sentence in made.sentences())


def test_an_interrupted_data_set_is_known_as_such_and_goes_on(run, tmp_path, monkeypatch):
    whole = make_training_set([run], tmp_path / "whole", "semantickitti", extras=Extras((1,), True)).folder

    def stops(self, index, n):
        if index == 2:
            raise InputError("the disk is full")
        return taken(self, index, n)

    taken = RunFiles.labels
    monkeypatch.setattr(RunFiles, "labels", stops)
    with pytest.raises(InputError, match="disk"):
        make_training_set([run], tmp_path / "set", "semantickitti", extras=Extras((1,), True))
    assert json.loads((tmp_path / "set" / "dataset.json").read_text())["unfinished"]
    monkeypatch.setattr(RunFiles, "labels", taken)
    make_training_set([run], tmp_path / "set", "semantickitti", extras=Extras((1,), True))
    files = sorted(path.relative_to(whole) for path in whole.rglob("*") if path.is_file())
    assert files == sorted(p.relative_to(tmp_path / "set") for p in (tmp_path / "set").rglob("*") if p.is_file())
    assert all((whole / file).read_bytes() == (tmp_path / "set" / file).read_bytes() for file in files)


def test_folders_that_hold_other_things_or_another_set_are_refused(run, tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("all of it")
    with pytest.raises(InputError, match="automos did not make"):
        make_training_set([run], tmp_path / "full", "semantickitti")
    assert [path.name for path in (tmp_path / "full").iterdir()] == ["thesis.txt"]
    make_training_set([run], tmp_path / "set", "semantickitti")
    with pytest.raises(InputError, match="written of something else"):
        make_training_set([run], tmp_path / "set", "semantickitti", "mos")
    with pytest.raises(InputError, match="automos did not make"):
        make_training_set([run], run.folder / "predictions", "semantickitti")


def test_what_cannot_be_is_said_in_a_sentence(run, tmp_path):
    out = tmp_path / "set"
    for arguments, match in (
        (([], out, "helimos"), "needs results"),
        (([run, run], out, "helimos"), "given twice"),
        (([run], out, "pascal"), "semantickitti, helimos"),
        (([run], out, "helimos", "voc"), "universal, mos"),
        (([run], out, "helimos", "mos", {"street": "validation"}), "train, valid, test"),
        (([run], out, "helimos", "mos", {"lane": "valid"}), "no such recording; there are: street"),
        (([run], tmp_path / "velodyne" / "set", "helimos"), "without 'velodyne'"),
        (([run], tmp_path / "set [1]", "helimos"), r"without '\['"),
    ):
        with pytest.raises(InputError, match=match):
            make_training_set(*arguments)
    assert not out.exists()


def test_recordings_of_different_sensors_have_files_of_their_own(run, tmp_path):
    few = [
        scan if not len(scan) else Scan(scan.points, scan.intensity, scan.time, 40 * scan.ring, scan.stamp, scan.name)
        for scan in make_scans()
    ]
    wide = deskewed(make_run(tmp_path / "wide", "wide", few))
    made = make_training_set([run, wide], tmp_path / "set", "semantickitti")
    assert made.members[0].sensor.height == 16
    assert made.members[1].sensor.height == 208
    for k in (1, 2):
        read = RangeImageTrainer(tmp_path / "set", "train", f"semantic-kitti-mos_{k}.yaml", f"sensor_{k}.yaml")
        assert {path.parents[1].name for path in read.scans} == {str(49 + k)}
        read[0]


def test_recordings_of_one_name_are_kept_apart(run, tmp_path):
    twin = deskewed(make_run(tmp_path / "twin"))
    make_training_set([run, twin], tmp_path / "set", "helimos")
    assert {path.name for path in (tmp_path / "set").iterdir() if path.is_dir()} == {"street-50", "street-51"}


def test_recordings_whose_names_are_patterns_or_look_numbered_are_found_and_kept_apart(tmp_path):
    names = ("log [1]*", "street", "street", "street-51", "street-52")
    runs = [deskewed(make_run(tmp_path / str(k), name)) for k, name in enumerate(names)]
    made = make_training_set(runs, tmp_path / "set", "helimos", splits={"log [1]*": "valid"})
    assert len({member.name for member in made.members}) == len(names)
    for member in made.members:  # as HeLiMOS's loader does
        assert len(glob(f"{tmp_path}/set/{member.name}/velodyne/*.bin")) == len(KEPT)
    assert made.members[0].split == "valid"


def test_like_sensors_share_an_image_that_holds_the_rays_of_both(run):
    from automos.writers.training.members import _with_joined_sensors, members_of
    from automos.writers.training.scans import ImageSensor

    (member,) = members_of([run], {})
    sensors = [ImageSensor(64, 3, -25), ImageSensor(64, 2, -26), ImageSensor(32, 10, -30)]
    joined = _with_joined_sensors([replace(member, sensor=sensor) for sensor in sensors])
    assert [one.sensor for one in joined] == [ImageSensor(64, 3, -26), ImageSensor(64, 3, -26), sensors[2]]


def test_a_sensor_is_one_of_its_rays_whatever_rides_along_and_how_fast(tmp_path):
    elevation, azimuth = (a.ravel() for a in np.radians(np.meshgrid(np.linspace(-29.5, 9.5, 32), np.arange(360.0))))
    ranges = np.where(elevation < np.radians(-25.0), 1.0, 15.0)  # the lowest see what carries the sensor
    rays = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)]) * np.cos(elevation)[:, None]
    ring = np.tile(np.arange(32, dtype=np.uint16), 360)
    scan = Scan((ranges[:, None] * rays).astype(np.float32), time=(azimuth / 20 / np.pi).astype(np.float32), ring=ring)
    scans = [replace(scan, name=f"{i:06d}") for i in range(3)]
    motion = np.tile([2.5, 0.0, 0.0, 0.0, 0.0, 0.0], (3, 1))
    run = make_run(tmp_path / "run", "street", scans, SweepTiming("file", 0.1, share=1.0), motion)
    (member,) = members_of([run], {})
    assert member.sensor == ImageSensor(32, 10, -30)
