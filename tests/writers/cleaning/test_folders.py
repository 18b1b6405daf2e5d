"""Folders of point files without movers: of their own kind with every column, or as another; and what is refused."""

import json

import numpy as np
import pytest
from labelled import labelled, moving
from street_log import street_log

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.writers.cleaning.clean import Choice, clean
from automos.writers.formats import write_pcd


@pytest.fixture
def kitti(tmp_path):
    """Return a drive in KITTI's layout, with times, poses and truth, its name with a blank and an umlaut."""
    folder = tmp_path / "Fahrt über Land"
    for inner in ("velodyne", "labels"):
        (folder / inner).mkdir(parents=True)
    for index, scan in enumerate(street_log().scans[:3]):
        rows = np.column_stack([scan.points, scan.intensity]).astype(np.float32)
        rows[7] = 0.0  # no return
        rows[8] = np.nan
        rows.tofile(folder / "velodyne" / f"{index:06d}.bin")
        np.zeros(len(rows), np.uint32).tofile(folder / "labels" / f"{index:06d}.label")
    (folder / "times.txt").write_text("0.0\n0.1\n0.2\n")
    (folder / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 3)
    return folder


def rows_of(path):
    return np.fromfile(path, np.float32).reshape(-1, 4)


def test_files_of_the_same_names_hold_the_rows_that_are_kept(kitti, tmp_path):
    run = labelled(tmp_path / "run", kitti)
    written, _, left_out = clean(run, tmp_path / "out")
    assert written == tmp_path / "out"
    assert sorted(p.name for p in written.iterdir()) == [".automos", "clean.json", "poses.txt", "times.txt", "velodyne"]
    n_left = 0
    for index in range(3):
        before = rows_of(kitti / "velodyne" / f"{index:06d}.bin")
        number = np.arange(len(before)) % 5
        is_point = np.isfinite(before).all(axis=1) & before[:, :3].any(axis=1)
        kept = (number > 1) | ((number == 1) & ~is_point)
        n_left += (~kept).sum()
        np.testing.assert_array_equal(rows_of(written / "velodyne" / f"{index:06d}.bin"), before[kept])
    assert left_out == n_left
    assert json.loads((written / "clean.json").read_text())["left_out"] == n_left
    again = open_sequence(written)
    np.testing.assert_array_equal(again.stamps, [0.0, 0.1, 0.2])


@pytest.mark.parametrize("choice", list(Choice))
def test_each_choice_keeps_what_it_says(kitti, tmp_path, choice):
    run = labelled(tmp_path / "run", kitti)
    clean(run, tmp_path / "out", choice=choice)
    before = rows_of(kitti / "velodyne" / "000001.bin")
    number = np.arange(len(before)) % 5
    expected = {Choice.MOVING: number == 0, Choice.NOT_MOVING: number > 0, Choice.STATIC: number > 1}[choice]
    expected[8] = choice is not Choice.MOVING  # without a return, whatever its label
    np.testing.assert_array_equal(rows_of(tmp_path / "out" / "velodyne" / "000001.bin"), before[expected])


def test_every_column_of_pcd_npy_and_las_is_kept(tmp_path):
    laspy = pytest.importorskip("laspy")
    for scan in street_log().scans[:2]:
        columns = {axis: scan.points[:, k] for k, axis in enumerate("xyz")}
        columns |= {
            "intensity": scan.intensity,
            "t": scan.time.astype("f8"),
            "flags": np.arange(len(scan)).astype("i2"),
        }
        table = np.zeros(len(scan), [(name, column.dtype) for name, column in columns.items()])
        for name, column in columns.items():
            table[name] = column
        for kind in ("pcd", "npy", "las"):
            (tmp_path / kind).mkdir(exist_ok=True)
        write_pcd(tmp_path / "pcd" / f"{scan.name}.pcd", columns)
        np.save(tmp_path / "npy" / f"{scan.name}.npy", table)
        las = laspy.LasData(laspy.LasHeader(version="1.4", point_format=6))
        las.header.add_extra_dim(laspy.ExtraBytesParams("flags", "i2"))
        las.header.scales = np.full(3, 1e-4)
        las = laspy.LasData(las.header)
        las.x, las.y, las.z = scan.points.T.astype(float)
        las["flags"] = columns["flags"]
        las.write(tmp_path / "las" / f"{scan.name}.las")
    for kind in ("pcd", "npy", "las"):
        run = labelled(tmp_path / f"run {kind}", tmp_path / kind)
        out, *_ = clean(run, tmp_path / f"out {kind}", choice=Choice.NOT_MOVING)
        for index, path in enumerate(run.sequence.paths):
            kept = ~moving(run, index)
            if kind == "npy":
                np.testing.assert_array_equal(np.load(out / path.name), np.load(path)[kept])
            elif kind == "las":
                was, now = laspy.read(path), laspy.read(out / path.name)
                np.testing.assert_array_equal(now.points.array, was.points[kept].array)
            else:
                from automos.readers.pcd import read

                was, now = read(path), read(out / path.name)
                assert [(k, v.dtype) for k, v in was.items()] == [(k, v.dtype) for k, v in now.items()]
                assert all(np.array_equal(now[k], was[k][kept]) for k in was)


@pytest.mark.parametrize("kind", ["bin", "pcd", "laz", "mcap"])
def test_as_another_kind_it_is_read_back_point_for_point(kitti, tmp_path, kind):
    run = labelled(tmp_path / "run", kitti)
    out, _, left_out = clean(run, tmp_path / "out", kind, Choice.NOT_MOVING)
    again = open_sequence(out)
    assert len(again) == 3
    assert left_out == sum(moving(run, index).sum() for index in range(3))
    for index in range(3):
        kept = ~moving(run, index)
        expected = np.nan_to_num(run.scan(index).points[kept]) if kind == "laz" else run.scan(index).points[kept]
        np.testing.assert_allclose(again[index].points, expected, atol=1e-4 if kind == "laz" else 0.0)
    if kind != "pcd" and kind != "laz":
        np.testing.assert_allclose(again.stamps, [0.0, 0.1, 0.2], atol=1e-9)


def test_the_recordings_folder_and_full_ones_are_refused_and_another_choice_does_not_mix(kitti, tmp_path):
    run = labelled(tmp_path / "run", kitti)
    for out, match in (
        (kitti, "folder of the recording"),
        (tmp_path, "did not make"),
        (run.folder, "did not make"),
    ):
        with pytest.raises(InputError, match=match):
            clean(run, out)
    out, *_ = clean(run, tmp_path / "out")
    with pytest.raises(InputError, match="written of something else"):
        clean(run, out, choice=Choice.MOVING)
    clean(run, out)  # the same once more


def test_a_kind_that_is_not_written_again_names_those_that_are(tmp_path):
    (tmp_path / "text").mkdir()
    scan = street_log().scans[0]
    np.savetxt(tmp_path / "text" / "000000.xyz", scan.points)
    run = labelled(tmp_path / "run", tmp_path / "text")
    with pytest.raises(InputError, match="give --as bin, pcd or laz"):
        clean(run, tmp_path / "out")


def test_records_of_any_columns_are_cut_whole(tmp_path):
    layout = "x:f8,y,z,_:u1,ring:u2,_:V5,t:>u4"
    (tmp_path / "in").mkdir()
    rng = np.random.default_rng(0)
    records = np.frombuffer(rng.bytes(50 * 36), np.dtype((np.void, 36))).copy()
    points = records.view(np.uint8).reshape(50, 36)
    points[:, :24] = rng.uniform(5.0, 9.0, (50, 3)).view(np.uint8)
    records.tofile(tmp_path / "in" / "0.bin")
    run = labelled(tmp_path / "run", tmp_path / "in", layout)
    written, *_ = clean(run, tmp_path / "out", choice=Choice.NOT_MOVING)
    kept = points[np.arange(50) % 5 != 0]
    assert (written / "0.bin").read_bytes() == kept.tobytes()


@pytest.mark.parametrize("shape", [(4, 300), (3, 100, 4)])
def test_arrays_of_other_shapes_become_rows(tmp_path, shape):
    rows = np.random.default_rng(0).uniform(5.0, 9.0, (300, 4)).astype("f4")
    rows[:, 2] = np.repeat([-2.0, 0.0, 2.0], 100)  # each row of an image sees its own part
    (tmp_path / "in").mkdir()
    np.save(tmp_path / "in" / "0.npy", rows.T if shape[0] == 4 else rows.reshape(shape))
    written, *_ = clean(labelled(tmp_path / "run", tmp_path / "in"), tmp_path / "out", choice=Choice.NOT_MOVING)
    np.testing.assert_array_equal(np.load(written / "0.npy"), rows[np.arange(300) % 5 != 0])


def test_binary_pcd_keeps_its_viewpoint_and_fields_of_several_values_and_others_are_told(tmp_path):
    n = 60
    head = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z fpfh _\nSIZE 4 4 4 4 1\nTYPE F F F F U\nCOUNT 1 1 1 3 2\n"
        f"WIDTH {n // 2}\nHEIGHT 2\nVIEWPOINT 1 2 3 1 0 0 0\nPOINTS {n}\nDATA "
    )
    rows = np.zeros(n, [("xyz", "<f4", 3), ("fpfh", "<f4", 3), ("_", "u1", 2)])
    rows["xyz"], rows["fpfh"] = np.random.default_rng(0).uniform(5.0, 9.0, (2, n, 3))
    kept = rows[np.arange(n) % 5 != 0]
    for k in range(2):
        (tmp_path / "in").mkdir(exist_ok=True)
        (tmp_path / "in" / f"{k}.pcd").write_bytes(head.encode() + b"binary\n" + rows.tobytes())
    (tmp_path / "in" / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 2)
    written, *_ = clean(labelled(tmp_path / "run", tmp_path / "in"), tmp_path / "out", choice=Choice.NOT_MOVING)
    lines = head.replace("WIDTH 30", "WIDTH 48").replace("HEIGHT 2", "HEIGHT 1").replace("POINTS 60", "POINTS 48")
    assert (written / "1.pcd").read_bytes() == lines.encode() + b"binary\n" + kept.tobytes()
    (tmp_path / "text").mkdir()
    numbers = np.column_stack([rows["xyz"], rows["fpfh"], rows["_"]])
    text = "\n".join(" ".join(map(str, row)) for row in numbers.tolist())
    (tmp_path / "text" / "0.pcd").write_text(f"{head}ascii\n{text}\n")
    with pytest.raises(InputError, match=r"several values a point as fpfh in ascii.*give --as bin"):
        clean(labelled(tmp_path / "run of text", tmp_path / "text"), tmp_path / "out of text")


def test_archives_are_refused_as_such(tmp_path):
    (tmp_path / "in").mkdir()
    np.savez(tmp_path / "in" / "0.npz", points=np.random.default_rng(0).uniform(5.0, 9.0, (300, 4)))
    with pytest.raises(InputError, match=r"scans in \.npz files are not written again as such: give --as bin"):
        clean(labelled(tmp_path / "run", tmp_path / "in"), tmp_path / "out")
