"""What is written of every point is read back, by the library that others read it with where there is one."""

import json
import os
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_run import INSTANCES, LABELS, export, make_run, make_scans

from automos.core.errors import InputError, MissingExtraError
from automos.odometry.sweep_timing import SweepTiming
from automos.readers import open_sequence
from automos.readers.codecs import read_columns
from automos.writers import EXPORTS, export_run, load_export

OF_ANY_RECORDING = [format for format in EXPORTS if format != "drivestudio"]  # which asks for cameras
NEEDS = {
    "laz": "laspy",
    "parquet": "pyarrow",
    "flow-av2": "pyarrow",
    "mcap": "rosbags",
    "opensceneflow": "h5py",
    "ncore": "ncore.data.v4",
}


@pytest.fixture
def run(tmp_path):
    return make_run(tmp_path / "run")


def assert_columns(columns, index):
    """Assert that `columns` are the scan's, bit by bit, with its labels and instances."""
    scan = make_scans()[index]
    np.testing.assert_array_equal(np.column_stack([columns[axis] for axis in "xyz"]), scan.points)
    for name in ("intensity", "time", "ring"):
        np.testing.assert_array_equal(columns[name], getattr(scan, name))
    assert columns["label"].tolist() == LABELS[index]
    assert columns["instance"].tolist() == INSTANCES[index]


@pytest.mark.parametrize("format", ["pcd", "ply"])
def test_point_files_hold_all_columns_in_the_scans_order(run, tmp_path, format):
    folder = export(run, format, tmp_path / "out")
    for index in range(3):
        assert_columns(read_columns(folder / f"{index:06d}.{format}", format), index)
    assert len(list(folder.glob("[!.]*"))) == 3
    np.testing.assert_array_equal(open_sequence(folder)[2].points, make_scans()[2].points)


def test_deskewed_points_are_those_seen_from_the_scans_pose_and_have_no_times(tmp_path):
    motion = np.zeros((3, 6))
    motion[:, 0] = 1.0  # a metre ahead in each sweep
    run = make_run(tmp_path / "run", timing=SweepTiming("file", 0.1, share=1.0), sweep_motion=motion)
    (out,) = export_run(run.folder, [run.sequence], "pcd", tmp_path / "out", deskewed=True)
    columns, scan = read_columns(out / "000000.pcd", "pcd"), make_scans()[0]
    assert "time" not in columns
    shift = np.column_stack([columns[axis] for axis in "xyz"]) - scan.points
    np.testing.assert_allclose(shift[:, 0], scan.time / 0.1 - 0.5, atol=0.02)
    np.testing.assert_allclose(shift[:, 1:], 0.0, atol=1e-6)
    with pytest.raises(InputError, match="cvat cannot be written deskewed; these can: pcd, ply, laz, parquet, mcap"):
        export_run(run.folder, [run.sequence], "cvat", tmp_path / "cvat", deskewed=True)
    shutil.rmtree(run.folder / "stages")
    with pytest.raises(InputError, match="label again to deskew"):
        export_run(run.folder, [run.sequence], "pcd", tmp_path / "again", deskewed=True)


def test_parquet_holds_all_scans_one_after_the_other(run, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    path = export(run, "parquet", tmp_path / "street.parquet")
    table = parquet.read_table(path)
    assert parquet.ParquetFile(path).num_row_groups == 3
    scan = table["scan"].to_numpy()
    assert scan.tolist() == [0] * 6 + [2] * 4
    for index in range(3):
        rows = scan == index
        assert_columns({name: table[name].to_numpy()[rows] for name in table.column_names}, index)


def test_laz_holds_all_points_on_its_grid_and_labels_as_classification(run, tmp_path):
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    folder = export(run, "laz", tmp_path / "out")
    for index, scan in enumerate(make_scans()):
        las = laspy.read(folder / f"{index:06d}.laz")
        expected = np.nan_to_num(scan.points, nan=0.0)
        np.testing.assert_allclose(las.xyz, expected, atol=0.6e-4)
        assert np.asarray(las.classification).tolist() == LABELS[index]
        assert las["label"].tolist() == LABELS[index]
        assert las["instance"].tolist() == INSTANCES[index]
        assert las["ring"].tolist() == scan.ring.tolist()
        assert np.asarray(las.intensity).tolist() == scan.intensity.tolist()
        np.testing.assert_allclose(las.gps_time, scan.stamp + scan.time.astype(float), atol=1e-6)


def test_laz_has_the_intensities_of_a_recording_on_one_scale(tmp_path):
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    for name, bright, expected in (("counts", 200.0, [1, 200]), ("shares", 0.5, [65535, 32768])):
        first, second, third = make_scans()
        dark = replace(first, intensity=np.full(6, 1.0, np.float32))  # alone, it might be of either scale
        run = make_run(tmp_path / name, scans=[dark, second, replace(third, intensity=np.full(4, bright, np.float32))])
        folder = export(run, "laz", tmp_path / "out" / name)
        found = [np.unique(laspy.read(folder / f"{scan}.laz").intensity).tolist() for scan in ("000000", "000002")]
        assert found == [[value] for value in expected]


def test_mcap_is_read_back_with_all_points_and_its_labels(run, tmp_path):
    pytest.importorskip("rosbags")
    from rosbags.highlevel import AnyReader

    from automos.readers.point_cloud2 import read_columns as read_message

    path = export(run, "mcap", tmp_path / "street.mcap")
    with AnyReader([path]) as reader:
        messages = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages()]
        assert {c.topic: c.msgtype for c in reader.connections} == {"/automos/points": "sensor_msgs/msg/PointCloud2"}
    for index, message in enumerate(messages):
        columns = read_message(message, "here")
        columns["time"] = (columns["t"] * 1e-9).astype(np.float32)
        assert_columns(columns, index)
        assert message.is_dense == (index != 2)
    sequence = open_sequence(path)
    np.testing.assert_allclose(sequence.stamps, run.stamps, atol=1e-6)
    np.testing.assert_array_equal(sequence[2].points, make_scans()[2].points)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run", "street.mcap"]


def test_panoptic_labels_have_the_track_in_the_upper_half(run, tmp_path):
    folder = export(run, "panoptic", tmp_path / "out")
    for index in range(3):
        packed = np.fromfile(folder / f"{index:06d}.label", np.uint32)
        assert (packed & 0xFFFF).tolist() == LABELS[index]
        assert (packed >> 16).tolist() == INSTANCES[index]


def test_instances_alone_are_numpy_files(run, tmp_path):
    folder = export(run, "instances", tmp_path / "out")
    assert [np.load(folder / f"{index:06d}.npy").tolist() for index in range(3)] == INSTANCES


# --------------------------------------------------------------------------------------------------- the benchmark
def validate(path, scans_of):
    """Check a submission as the benchmark's script does: directories, names, sizes. `scans_of`: points per scan."""
    assert path.suffix == ".zip"
    with zipfile.ZipFile(path) as archive:
        infos = {info.filename: info for info in archive.infolist()}
        assert len(infos) == len(archive.infolist()), "a name twice"
        assert "sequences/" in infos
        for sequence, n_points in scans_of.items():
            assert f"sequences/{sequence}/" in infos
            assert f"sequences/{sequence}/predictions/" in infos
            for scan, n in enumerate(n_points):
                info = infos[f"sequences/{sequence}/predictions/{scan:06d}.label"]
                assert info.file_size == 4 * n
        n_files = sum(len(n_points) for n_points in scans_of.values())
        assert len(infos) == 1 + 2 * len(scans_of) + n_files
        assert archive.testzip() is None


def test_the_benchmarks_zip_has_its_directories_and_a_file_for_every_scan(tmp_path):
    run = make_run(tmp_path / "run", name="8")
    path = export(run, "semantickitti", tmp_path / "submission.zip")
    validate(path, {"08": [6, 0, 4]})
    with zipfile.ZipFile(path) as archive:
        labels = np.frombuffer(archive.read("sequences/08/predictions/000000.label"), np.uint32)
    assert labels.tolist() == LABELS[0]


def test_sequences_join_the_same_zip_and_replace_themselves(tmp_path):
    runs = [make_run(tmp_path / "runs" / name, name=name) for name in ("11", "12")]
    (path,) = export_run(tmp_path / "runs", [run.sequence for run in runs], "semantickitti", tmp_path / "all.zip")
    validate(path, {"11": [6, 0, 4], "12": [6, 0, 4]})
    export(runs[0], "semantickitti", path)
    validate(path, {"11": [6, 0, 4], "12": [6, 0, 4]})


def test_what_the_benchmark_does_not_take_is_refused(run, tmp_path):
    scans = make_scans()
    object.__setattr__(scans[1], "name", "b")
    other = make_run(tmp_path / "other", scans=scans)
    with pytest.raises(InputError, match="street has a scan named 'b'"):
        export(other, "semantickitti", tmp_path / "a.zip")
    for names, said in ((("0", "1", "1000000"), "named '1000000'"), (("0", "1", "01"), "two scans numbered 000001")):
        scans = [replace(scan, name=name) for scan, name in zip(make_scans(), names, strict=True)]
        with pytest.raises(InputError, match=said):
            export(make_run(tmp_path / names[2], scans=scans), "semantickitti", tmp_path / "a.zip")
    (tmp_path / "b.zip").write_text("no zip")
    with pytest.raises(InputError, match=r"b.zip is there, and automos did not write it"):
        export(run, "semantickitti", tmp_path / "b.zip")
    assert not (tmp_path / "a.zip").exists()


# --------------------------------------------------------------------------------------------------- all of them
@pytest.mark.parametrize("format", OF_ANY_RECORDING)
def test_results_go_beside_the_run_where_no_place_is_given_and_the_same_again(run, format):
    pytest.importorskip(NEEDS.get(format, "numpy"))
    (first,) = export_run(run.folder, [run.sequence], format)
    assert first.is_relative_to(run.folder / "export" / format)
    before = content(first)
    assert before
    (again,) = export_run(run.folder, [run.sequence], format)
    assert again == first
    if format != "mcap":  # its writer names itself and the time in the file
        assert content(again) == before


@pytest.mark.parametrize("format", OF_ANY_RECORDING)
def test_a_recording_in_which_nothing_was_found_is_written_as_well(tmp_path, format):
    pytest.importorskip(NEEDS.get(format, "numpy"))
    run = make_run(tmp_path / "run")
    path = run.folder / "tracks.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"tracks": []}))
    for name, n in (("000000", 6), ("000002", 4)):
        np.full(n, 9, np.uint32).tofile(run.folder / "predictions" / f"{name}.label")
    (written,) = export_run(run.folder, [run.sequence], format, tmp_path / f"out{load_export(format).suffix}")
    assert content(written)


@pytest.mark.parametrize("format", OF_ANY_RECORDING)
def test_points_beyond_any_sensor_are_written_in_every_format(tmp_path, format):
    pytest.importorskip(NEEDS.get(format, "numpy"))
    scans = make_scans()
    scans[0].points[1:4, 1] = (np.inf, -5e18, 3e38)
    run = make_run(tmp_path / "run", scans=scans)
    assert content(export(run, format, tmp_path / f"out{load_export(format).suffix}"))


def content(path):
    files = [path] if path.is_file() else [p for p in path.rglob("*") if p.is_file()]
    return {file.name: file.read_bytes() for file in files}


def test_several_recordings_are_written_beside_each_other(tmp_path):
    runs = [make_run(tmp_path / "runs" / name, name=name) for name in ("a", "b")]
    sequences = [run.sequence for run in runs]
    assert export_run(tmp_path / "runs", sequences, "pcd", tmp_path / "out") == [tmp_path / "out/a", tmp_path / "out/b"]
    written = export_run(tmp_path / "runs", sequences, "openlabel", tmp_path / "out")
    assert written == [tmp_path / "out" / "a.json", tmp_path / "out" / "b.json"]


def test_an_unknown_format_names_the_nearest_and_a_place_in_the_way_is_told(run, tmp_path):
    with pytest.raises(InputError, match="unknown format 'semantic-kitti'; did you mean 'semantickitti'"):
        export_run(run.folder, [run.sequence], "semantic-kitti")
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"file is a file: choose another --out"):
        export(run, "pcd", tmp_path / "file")
    with pytest.raises(InputError, match=r"is a device, a pipe or the like: choose another --out"):
        export(run, "pcd", Path(os.devnull))


@pytest.mark.parametrize(
    ("format", "module"), [(name, module) for name in EXPORTS for module in load_export(name).modules]
)
def test_a_missing_package_is_told_with_the_command_that_installs_it(run, tmp_path, monkeypatch, format, module):
    monkeypatch.setitem(__import__("sys").modules, module, None)
    with pytest.raises(MissingExtraError, match=rf"pip install '.*\[{load_export(format).needs}\]'"):
        export(run, format, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_format_that_needs_an_extra_says_what_it_imports_of_it():
    assert all(bool(load_export(name).needs) == bool(load_export(name).modules) for name in EXPORTS)


def test_parquet_holds_scans_of_which_some_lack_what_others_have(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    scans = make_scans()
    for scan, name in zip(scans, ("intensity", "time", "ring"), strict=True):
        object.__setattr__(scan, name, None)
    table = parquet.read_table(export(make_run(tmp_path / "run", scans=scans), "parquet", tmp_path / "a.parquet"))
    assert table["time"].to_pylist()[:6] == scans[0].time.tolist()
    assert table["ring"].to_pylist() == [*range(6), *[None] * 4]
    assert table["intensity"].to_pylist()[:6] == [None] * 6


@pytest.mark.parametrize("first", [-0.1, 2.0**31 - 0.15, 9e10])
def test_times_that_ros_cannot_hold_are_told_before_an_mcap_is_written(run, tmp_path, first):
    pytest.importorskip("rosbags")
    run.sequence._stamps = first + 0.1 * np.arange(3)
    with pytest.raises(InputError, match=r"scan 00000\d is at .* s, but ROS has times from 0 to 2\^31 s only"):
        export_run(run.folder, [run.sequence], "mcap", tmp_path / "a.mcap")
    assert not list(tmp_path.glob("*.mcap"))


@pytest.mark.parametrize("format", OF_ANY_RECORDING)
def test_a_disk_that_is_full_is_told_with_the_name_of_what_could_not_be_written(run, tmp_path, format):
    resource = pytest.importorskip("resource")
    pytest.importorskip(NEEDS.get(format, "numpy"))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (16, before[1]))  # no file may have more bytes
    try:
        with pytest.raises(InputError, match=f"{tmp_path}/out.* (could not|cannot) be written"):
            export_run(run.folder, [run.sequence], format, tmp_path / "out")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not [
        path for path in tmp_path.rglob("*") if path.is_file() and path.stat().st_size > 16 and "out" in str(path)
    ]


@pytest.mark.parametrize("format", ["pcd", "ply", "panoptic", "instances", "sustech", "cvat", "segments"])
def test_scans_of_another_recording_are_not_mixed_with_those_of_an_earlier_export(run, tmp_path, format):
    out = export(run, format, tmp_path / "out")
    scans = make_scans()
    object.__setattr__(scans[1], "name", "000007")
    other = make_run(tmp_path / "other", scans=scans)
    before = content(out)
    with pytest.raises(InputError, match=r"out holds \d files of scans that street has not \(first: 000001\."):
        export(other, format, out)
    assert content(out) == before


@pytest.mark.parametrize("format", ["pcd", "openlabel", "mcap", "semantickitti"])
def test_a_place_that_cannot_be_is_one_sentence(run, tmp_path, format):
    if format == "mcap":
        pytest.importorskip("rosbags")
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"cannot be written \(Not a directory\): choose another --out"):
        export(run, format, tmp_path / "file" / "out")


def test_a_zip_whose_packed_bytes_are_damaged_is_not_joined(tmp_path):
    runs = [make_run(tmp_path / "runs" / name, name=name) for name in ("11", "12")]
    path = export(runs[0], "semantickitti", tmp_path / "all.zip")
    damaged = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as archive:
        at = archive.getinfo("sequences/11/predictions/000000.label").header_offset
    at += 30 + len("sequences/11/predictions/000000.label")
    damaged[at : at + 3] = b"\xff" * 3  # no block of deflate begins so
    path.write_bytes(damaged)
    with pytest.raises(InputError, match=r"all.zip is not a zip file that can be read"):
        export(runs[1], "semantickitti", path)
    assert path.read_bytes() == damaged


@pytest.mark.parametrize(
    ("format", "names"), [("semantickitti", ("a", "b")), ("semantickitti", ("1", "01")), ("pcd", "aa")]
)
def test_recordings_that_would_replace_each_other_are_refused(tmp_path, format, names):
    runs = [make_run(tmp_path / "runs" / name, name=name) for name in names]
    with pytest.raises(InputError, match=r"would both be written as \w+: export them one by one"):
        export_run(
            tmp_path / "runs", [run.sequence for run in runs], format, tmp_path / f"out{load_export(format).suffix}"
        )
    assert not list(tmp_path.glob("out*"))


def test_mcap_counts_from_the_first_point_whatever_a_caller_counts_from(tmp_path):
    pytest.importorskip("rosbags")
    scans = make_scans()
    scans[0].time[:] = [-0.09, -0.06, -0.03, 0.0, np.nan, 0.01]
    path = export(make_run(tmp_path / "run", scans=scans), "mcap", tmp_path / "a.mcap")
    np.testing.assert_allclose(open_sequence(path)[0].time, [0.0, 0.03, 0.06, 0.09, 0.0, 0.1], atol=1e-6)
