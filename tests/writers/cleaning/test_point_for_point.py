"""Recordings without what automos labelled as moving, read back by others' readers and compared point for point.

AUTOMOS_RUNS names results folders to do so with (of recordings in folders; `benchmarks/consumers/table.py` says its own
there). Without it they are a simulated motorway and, with the slow tests, a denser one and `lyft_5hz`.
"""

import os
import shutil
from itertools import zip_longest
from pathlib import Path

import numpy as np
import pytest

from automos import simulation
from automos.labeling import label_recording
from automos.readers import open_sequence
from automos.results.open_run import open_run
from automos.results.run_files import RunFiles
from automos.settings import load_settings
from automos.writers.cleaning.clean import clean

RUNS = [name for name in os.environ.get("AUTOMOS_RUNS", "").split(os.pathsep) if name]
WORLDS = {"motorway_VLP-16": ("VLP-16", 10, 905), "motorway_HDL-64E": ("HDL-64E", 12, 906)}
DENSE = pytest.param("motorway_HDL-64E", marks=pytest.mark.slow)
DRIVE = pytest.param("lyft_5hz", marks=[pytest.mark.slow, pytest.mark.recordings])
FLOATS = np.dtype([(name, "<f4") for name in ("x", "y", "z", "intensity")])
BEGIN = 1_700_000_000_000_000_000
"""Nanoseconds, the time of a bag's first cloud."""


@pytest.fixture(scope="module", params=RUNS or ["motorway_VLP-16", DENSE, DRIVE], ids=lambda name: Path(name).name)
def run(request, tmp_path_factory):
    """Return a recording that is labelled."""
    if request.param in RUNS:
        return open_run(Path(request.param))
    folder = tmp_path_factory.mktemp("labelled")
    if request.param in WORLDS:
        sensor, scans, seed = WORLDS[request.param]
        source = simulation.write(simulation.simulate("motorway", sensor, n_scans=scans, seed=seed), folder / "world")
    else:
        source = request.getfixturevalue("recordings") / "sequences" / request.param
        if not source.is_dir():
            pytest.skip(f"{source.parent} holds no {source.name}")
    label_recording(open_sequence(source), folder / "run", load_settings("default"), workers=1)
    return open_run(folder / "run")


@pytest.fixture
def scratch(tmp_path):
    """Return a folder that is gone after the test: recordings are large."""
    yield tmp_path / "scratch"
    shutil.rmtree(tmp_path / "scratch", ignore_errors=True)


def rows_kept(run, index):
    """Return (N,) which points stay: all static ones, none that moves, and those without a return."""
    labels = np.fromfile(run.folder / "predictions" / f"{run.names[index]}.label", "<u4") & 0xFFFF
    assert set(np.unique(labels)) <= {0, 9, 251}
    return (labels == 9) | ((labels == 0) & ~run.scan(index).is_valid)


def run_of(run, recording, folder):
    """Return the labels of `run` as those of the same scans in another recording."""
    sequence = open_sequence(recording)
    assert len(sequence) == len(run)
    (folder / "predictions").mkdir(parents=True)
    for name, same in zip(run.names, sequence.names, strict=True):
        shutil.copy(run.folder / "predictions" / f"{name}.label", folder / "predictions" / f"{same}.label")
    return RunFiles(folder, sequence)


def columns_of(scan):
    """Return x, y, z and what else the recording has."""
    others = {name: getattr(scan, name) for name in ("intensity", "time", "ring")}
    return dict(zip("xyz", scan.points.T, strict=True)) | {k: v for k, v in others.items() if v is not None}


def assert_same(read, run, index):
    """Assert that `read`, columns or records, has the kept points of a scan, in order and bit for bit."""
    rows = rows_kept(run, index)
    for name, column in columns_of(run.scan(index)).items():
        if name in ("x", "y", "z", "intensity"):
            assert np.asarray(read[name]).astype("<f4").tobytes() == column[rows].astype("<f4").tobytes(), name


def movers_of(run):
    """Return how many points of the run's labels move."""
    return sum((run.labels(index, len(run.scan(index))) == 251).sum() for index in range(len(run)))


@pytest.mark.slow
def test_scans_of_four_floats_come_back_as_the_bytes_they_were(run, scratch):
    written, n_points, n_left = clean(run, scratch)
    assert n_points == sum(len(run.scan(index)) for index in range(len(run)))
    assert n_left == n_points - sum(rows_kept(run, index).sum() for index in range(len(run)))
    assert n_left >= movers_of(run) > 0
    folder = run.sequence.source
    for index, path in enumerate(run.sequence.paths):
        was, now = (np.fromfile(of, FLOATS) for of in (path, written / path.relative_to(folder)))
        assert now.tobytes() == was[rows_kept(run, index)].tobytes()
    assert len(list(written.rglob("*.bin"))) == len(run)
    for name in ("times.txt", "poses.txt", "calib.txt"):
        assert (written / name).exists() == (folder / name).exists()
        assert not (folder / name).exists() or (written / name).read_bytes() == (folder / name).read_bytes()


def test_as_bin_numpy_reads_the_points_that_stay(run, scratch):
    written, *_ = clean(run, scratch, "bin")
    paths = sorted((written / "velodyne").iterdir())
    assert [path.stem for path in paths] == list(run.names)
    for index, path in enumerate(paths):
        assert_same(np.fromfile(path, FLOATS), run, index)
    np.testing.assert_allclose(np.loadtxt(written / "times.txt"), run.stamps, atol=1e-9)


def test_as_pcd_pypcd4_reads_the_points_that_stay(run, scratch):
    pypcd4 = pytest.importorskip("pypcd4", reason="pip install -e '.[dev-readers]'")
    written, *_ = clean(run, scratch, "pcd")
    paths = sorted(written.rglob("*.pcd"))
    assert [path.stem for path in paths] == list(run.names)
    for index, path in enumerate(paths):
        assert_same(pypcd4.PointCloud.from_path(path).pc_data, run, index)


def test_as_laz_laspy_reads_the_points_that_stay_to_a_tenth_of_a_millimetre(run, scratch):
    laspy = pytest.importorskip("laspy")
    written, *_ = clean(run, scratch, "laz")
    paths = sorted(written.rglob("*.laz"))
    assert [path.stem for path in paths] == list(run.names)
    counts = any((scan.intensity > 1.0).any() for scan in map(run.scan, range(len(run))))
    for index, path in enumerate(paths):
        las, rows, scan = laspy.read(path), rows_kept(run, index), run.scan(index)
        np.testing.assert_allclose(np.column_stack([las.x, las.y, las.z]), scan.points[rows], atol=0.51e-4)
        true = scan.intensity[rows] * np.float32(1.0 if counts else 65535.0)
        np.testing.assert_array_equal(las.intensity, np.round(true))


@pytest.mark.parametrize("kind", ["pcd", "laz"])
def test_files_with_labels_inside_keep_every_field_of_what_stays(run, scratch, kind):
    from automos.writers import load_export

    (scratch / "in").mkdir(parents=True)
    load_export(kind).write(RunFiles(run.folder, run.sequence), scratch / "in")
    again = run_of(run, scratch / "in", scratch / "run")
    written, *_ = clean(again, scratch / "out")
    for index, path in enumerate(again.sequence.paths):
        was, now = (records(kind, of) for of in (path, written / path.name))
        label = "classification" if kind == "laz" else "label"
        assert now.dtype == was.dtype
        assert now.tobytes() == was[rows_kept(again, index)].tobytes()
        assert 251 not in now[label]
        assert (now[label] == 9).sum() == (was[label] == 9).sum()


def records(kind, path):
    """Return the points of a file as records of all its fields."""
    if kind == "laz":
        return pytest.importorskip("laspy").read(path).points.array
    return pytest.importorskip("pypcd4").PointCloud.from_path(path).pc_data


@pytest.mark.parametrize("name", ["robot.bag", "robot", "robot.db3", "robot.mcap"])
def test_bags_differ_by_the_points_that_move_and_by_nothing_else(run, scratch, name):
    pytest.importorskip("rosbags")
    from bags import write_robots_bag
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    scans = []
    for index, stamp in enumerate(run.stamps - run.stamps[0]):
        columns, n = columns_of(run.scan(index)), len(run.scan(index))
        columns |= {"t": np.arange(n, dtype="u4"), "ring": (np.arange(n) % 16).astype("u2")}
        scans.append((BEGIN + round(1e9 * float(stamp)), columns))
    bag = write_robots_bag(scratch / "in" / name, scans)
    of_bag = run_of(run, bag / "points", scratch / "run")
    written, *_ = clean(of_bag, scratch / "out")
    types, index, seen = get_typestore(Stores.ROS2_HUMBLE), 0, set()
    with AnyReader([bag], default_typestore=types) as one, AnyReader([written], default_typestore=types) as other:
        assert [(c.topic, c.msgtype, c.digest) for c in one.connections] == [
            (c.topic, c.msgtype, c.digest) for c in other.connections
        ]
        for (c, at, was), (d, then, now) in zip_longest(one.messages(), other.messages(), fillvalue=(None,) * 3):
            assert (c.topic, c.msgtype, at) == (d.topic, d.msgtype, then)
            seen.add(c.topic)
            if c.topic != "/points":
                assert was == now
                continue
            before, after = one.deserialize(was, c.msgtype), other.deserialize(now, d.msgtype)
            for same in ("header", "fields", "point_step", "is_dense", "is_bigendian"):
                assert repr(getattr(after, same)) == repr(getattr(before, same))
            rows = before.data.reshape(-1, before.point_step)[rows_kept(of_bag, index)]
            assert (after.height, after.width, after.data.tobytes()) == (1, len(rows), rows.tobytes())
            index += 1
    assert index == len(run)
    assert seen == {"/points", "/rear/points", "/imu", "/tf", "/tf_static"}
