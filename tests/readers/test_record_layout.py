"""Files without a header: their columns are found from their content, or they are refused with what fits."""

import numpy as np
import pytest
from sweeps import points_of, pose, sweep

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.readers.codecs import parse_columns

XYZ = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]


def plain(kind="<f4", names=("x", "y", "z", "intensity", "ring", "time")):
    return np.dtype([(name, kind) for name in names])


RECORDS = {
    "x,y,z": plain(names="xyz"),
    "x,y,z,intensity": plain(names=("x", "y", "z", "intensity")),
    "x,y,z,intensity,ring": plain(names=("x", "y", "z", "intensity", "ring")),
    "x,y,z,intensity,time": plain(names=("x", "y", "z", "intensity", "time")),
    "x,y,z,intensity,ring,time": plain(),
    "x,y,z,ring,time,intensity": plain(names=("x", "y", "z", "ring", "time", "intensity")),
    "x,y,z,intensity,ring,time,_": plain(names=("x", "y", "z", "intensity", "ring", "time", "none")),
    "x,y,z,intensity,ring,time,_,_": plain(names=("x", "y", "z", "intensity", "ring", "time", "none", "two")),
    "time,x,y,z,intensity": plain(names=("time", "x", "y", "z", "intensity")),
    "intensity,x,y,z": plain(names=("intensity", "x", "y", "z")),
    "intensity,x,y,z,ring": plain(names=("intensity", "x", "y", "z", "ring")),
    "ring,x,y,z,intensity": plain(names=("ring", "x", "y", "z", "intensity")),
    "x:f8,y,z": plain("<f8", "xyz"),
    "x:f8,y,z,intensity": plain("<f8", ("x", "y", "z", "intensity")),
    "x:f8,y,z,intensity,ring,time": plain("<f8"),
    "x:>f4,y,z,intensity": plain(">f4", ("x", "y", "z", "intensity")),
    "x:>f8,y,z,intensity,ring,time": plain(">f8"),
    "x,y,z,_,intensity,_,_,_": np.dtype([*XYZ, ("one", "<f4"), ("intensity", "<f4"), ("pad", "<f4", 3)]),
    "x,y,z,_,intensity,ring:u4,time,_": np.dtype(
        [*XYZ, ("one", "<f4"), ("intensity", "<f4"), ("ring", "<u2"), ("p", "<u2"), ("time", "<f4"), ("q", "<u4")]
    ),
    "x,y,z,_,intensity,_,time:f8,ring:u4,_,_,_": np.dtype(
        [*XYZ, ("one", "<f4"), ("intensity", "<f4"), ("p", "<f4"), ("time", "<f8"), ("ring", "<u2"), ("q", "<u2", 7)]
    ),
    "x,y,z,intensity,ring:u2": np.dtype([*XYZ, ("intensity", "<f4"), ("ring", "<u2")]),
    "x,y,z,intensity,ring:u2,time": np.dtype([*XYZ, ("intensity", "<f4"), ("ring", "<u2"), ("time", "<f4")]),
    "x,y,z,intensity,ring:u2,timestamp:f8": np.dtype([*XYZ, ("intensity", "<f4"), ("ring", "<u2"), ("time", "<f8")]),
    "x,y,z,intensity,time:f8,ring:u2": np.dtype([*XYZ, ("intensity", "<f4"), ("time", "<f8"), ("ring", "<u2")]),
    "x,y,z,intensity,ring:u1,time": np.dtype([*XYZ, ("intensity", "<f4"), ("ring", "u1"), ("time", "<f4")]),
    "x,y,z,_,intensity": np.dtype([*XYZ, ("range", "<f4"), ("intensity", "<f4")]),
    "x:f8,y,z,intensity:f4,ring:u2": np.dtype(
        [*((axis, "<f8") for axis in "xyz"), ("intensity", "<f4"), ("ring", "<u2")]
    ),
}


def records(columns, dtype):
    rows = np.zeros(len(columns["x"]), dtype)
    for name in set(columns) & set(dtype.names):
        rows[name] = columns[name]
    for name, value in (("one", 1.0), ("two", 2.0)):
        if name in dtype.names:
            rows[name] = value
    return rows


def write(folder, dtype, scans):
    folder.mkdir(exist_ok=True)
    for i, columns in enumerate(scans):
        records(columns, dtype).tofile(folder / f"{i}.bin")
    return folder


@pytest.fixture(scope="module")
def scans():
    """Return four sweeps of a sensor that drives on, each of another number of points."""
    found = [sweep(pose(3.0 * i, 0.7 * i), seed=i) for i in range(4)]
    return [{name: column[: len(column) - i] for name, column in one.items()} for i, one in enumerate(found)]


@pytest.mark.parametrize(
    ("spelled", "is_even"),
    [*((spelled, True) for spelled in RECORDS), *((spelled, False) for spelled in list(RECORDS)[::4])],
)
def test_columns_are_those_that_were_written(tmp_path, scans, spelled, is_even):
    if is_even:
        scans = [{name: column[: len(column) // 48 * 48] for name, column in one.items()} for one in scans]
    sequence = open_sequence(write(tmp_path / "log", RECORDS[spelled], scans))
    assert (spelled == "x,y,z,intensity") or any(f"--columns {spelled}." in words for words in sequence.warnings)
    for scan, columns in zip(sequence, scans, strict=True):
        np.testing.assert_allclose(scan.points, points_of(columns), atol=1e-6)
        for name in ("intensity", "ring"):
            if name in RECORDS[spelled].names:
                np.testing.assert_allclose(getattr(scan, name), columns[name], atol=1e-6)
        if "time" in RECORDS[spelled].names:
            np.testing.assert_allclose(scan.time, columns["time"] - columns["time"].min(), atol=1e-6)


@pytest.mark.parametrize(
    ("spelled", "dtype"),
    [
        ("x:>f4,y,z,intensity:>u2", [*((axis, ">f4") for axis in "xyz"), ("intensity", ">u2")]),
        ("x:>f8,y,z,intensity:>u2", [*((axis, ">f8") for axis in "xyz"), ("intensity", ">u2")]),
        ("x,y,z,intensity:u1,_:V1,_:V1", [*XYZ, ("intensity", "u1"), ("green", "u1"), ("blue", "u1")]),
    ],
)
def test_an_intensity_of_whole_numbers_is_found_in_either_byte_order_and_colours_are_no_beams(
    tmp_path, scans, spelled, dtype
):
    rng = np.random.default_rng(0)
    bright = [
        {**one, **{n: rng.integers(0, 256, len(one["x"])) for n in ("intensity", "green", "blue")}} for one in scans
    ]
    sequence = open_sequence(write(tmp_path, np.dtype(dtype), bright))
    assert sequence.about["files"] == f".bin files of {spelled}"
    for scan, one in zip(sequence, bright, strict=True):
        np.testing.assert_array_equal(scan.intensity, one["intensity"])
        assert scan.ring is None


@pytest.mark.parametrize("coordinates", ["<f4", ">f4", "<f8", ">f8"])
def test_both_bytes_of_an_intensity_count(tmp_path, scans, coordinates):
    bright = [{**one, "intensity": (60 * np.linalg.norm(points_of(one), axis=1)).astype(np.uint16)} for one in scans]
    dtype = np.dtype([*((axis, coordinates) for axis in "xyz"), ("intensity", coordinates[0] + "u2")])
    sequence = open_sequence(write(tmp_path, dtype, bright))
    for scan, one in zip(sequence, bright, strict=True):
        np.testing.assert_array_equal(scan.intensity, one["intensity"])


@pytest.mark.parametrize("ring", [[], [("ring", "<f4")], [("ring", "<u2")]], ids=["none", "floats", "two bytes"])
def test_nanoseconds_since_1970_are_times_of_eight_bytes(tmp_path, scans, ring):
    dtype = np.dtype([*XYZ, ("intensity", "<f4"), *ring, ("time", "<u8")])
    start = 1_617_000_000_123_456_789
    since = [
        {**one, "time": np.round(1e9 * one["time"]).astype("u8") + start + 10**8 * i} for i, one in enumerate(scans)
    ]
    sequence = open_sequence(write(tmp_path, dtype, since))
    np.testing.assert_allclose(sequence.stamps - 1e-9 * start, 0.1 * np.arange(len(scans)), atol=1e-6)
    for scan, one in zip(sequence, scans, strict=True):
        np.testing.assert_allclose(scan.time, one["time"] - one["time"].min(), atol=1e-6)
        assert (scan.ring is not None) == bool(ring)


@pytest.mark.parametrize("spelled", ["x,y,z,intensity", "x,y,z,intensity,ring,time", "x:f8,y,z,intensity"])
def test_neither_the_order_of_points_nor_those_without_return_hide_the_columns(tmp_path, scans, spelled):
    rng = np.random.default_rng(0)
    shuffled = [
        {name: column[order] for name, column in one.items()}
        for one in scans
        for order in [rng.permutation(len(one["x"]))]
    ]
    assert [len(scan) for scan in open_sequence(write(tmp_path / "a", RECORDS[spelled], shuffled))] == [
        len(one["x"]) for one in scans
    ]
    for fill in (np.nan, 0.0):
        gaps = []
        for one in scans:
            is_gap = rng.random(len(one["x"])) < 0.4
            gaps.append({n: np.where(is_gap, fill, c) if n in "xyz" else c for n, c in one.items()})
        sequence = open_sequence(write(tmp_path / f"gaps{fill}", RECORDS[spelled], gaps))
        assert [len(scan) for scan in sequence] == [len(one["x"]) for one in scans]
        np.testing.assert_allclose(sequence[2].points, points_of(gaps[2]), atol=1e-6)


@pytest.mark.parametrize("spelled", ["x,y,z,intensity", "x,y,z,intensity,ring,time"])
def test_a_sky_without_return_where_files_begin_does_not_hide_the_columns(tmp_path, scans, spelled):
    grids = []
    for one in scans:
        n = len(one["x"])
        is_sky = (np.arange(n) * 6 // n % 2 == 0) | (np.arange(n) > n - 200)
        grids.append({name: np.where(is_sky, 0.0, column) for name, column in one.items()})
    sequence = open_sequence(write(tmp_path / "log", RECORDS[spelled], grids))
    np.testing.assert_allclose(sequence[2].points, points_of(grids[2]), atol=1e-6)


def test_every_third_record_that_is_none_is_no_part_of_a_larger_one(tmp_path, scans):
    wide = [
        {name: np.insert(column, np.arange(3, len(column), 3).repeat(2), np.nan) for name, column in one.items()}
        for one in scans
    ]
    sequence = open_sequence(write(tmp_path / "log", RECORDS["x,y,z,intensity"], wide))
    assert [len(scan) for scan in sequence] == [len(one["x"]) for one in wide]


def test_a_file_that_was_cut_is_told_by_name_though_other_columns_would_fit(tmp_path, scans):
    folder = write(tmp_path / "log", RECORDS["x,y,z,intensity"], scans)
    raw = (folder / "2.bin").read_bytes()
    (folder / "2.bin").write_bytes(raw[:-12])
    with pytest.raises(InputError, match=r"2\.bin has \d+ bytes, no multiple of a point as .*x,y,z,intensity.* cut"):
        open_sequence(folder)


def test_heights_that_go_on_from_beam_to_beam_are_no_times(tmp_path):
    turn, tilt = (grid.ravel() for grid in np.meshgrid(np.arange(120), np.arange(128), indexing="ij"))
    ranges = 8.0 + 4.0 * np.sin(turn / 9.0)
    azimuth, elevation = 2.0 * np.pi * turn / 120.0, np.radians(-22.5 + 45.0 * tilt / 127.0)
    level = ranges * np.cos(elevation)
    one = {"x": level * np.cos(azimuth), "y": level * np.sin(azimuth), "z": ranges * np.sin(elevation)}
    scans = [{**one, "intensity": np.random.default_rng(i).random(len(turn))} for i in range(3)]
    sequence = open_sequence(write(tmp_path / "log", RECORDS["x,y,z,intensity"], scans))
    np.testing.assert_allclose(sequence[1].points, points_of(scans[1]), atol=1e-6)


def test_a_place_that_the_direction_of_height_and_width_explains_is_no_time(tmp_path):
    rng = np.random.default_rng(0)
    turn = rng.uniform(-np.pi, np.pi, 6000)
    one = {"x": 4.0 * turn, "y": 5.0 * np.cos(turn), "z": 5.0 * np.sin(turn), "intensity": rng.random(6000)}
    sequence = open_sequence(write(tmp_path / "log", RECORDS["x,y,z,intensity"], [one, one]))
    np.testing.assert_allclose(sequence[0].points, points_of(one), atol=1e-6)


@pytest.mark.parametrize("flag", [lambda c: c["x"] > 3.0, lambda c: np.where(c["x"] > 3.0, -0.0, 0.0)])
def test_a_flag_is_no_time(tmp_path, scans, flag):
    flagged = [{**columns, "none": flag(columns)} for columns in scans]
    folder = write(tmp_path / "log", plain(names=("x", "y", "z", "intensity", "none")), flagged)
    sequence = open_sequence(folder)
    assert any("--columns x,y,z,intensity,_." in words for words in sequence.warnings)
    assert all(scan.time is None for scan in sequence)


@pytest.mark.parametrize("names", ["xyz", ("x", "y", "z", "intensity")])
@pytest.mark.parametrize("n_beams", [16, 40])
def test_all_x_before_all_y_are_no_points(tmp_path, names, n_beams):
    for i in range(3):
        columns = sweep(pose(3.0 * i, 0.7 * i), seed=i, n_beams=n_beams)
        np.concatenate([columns[name] for name in names]).tofile(tmp_path / f"{i}.bin")
    with pytest.raises(InputError, match="its content does not show which columns"):
        open_sequence(tmp_path)


@pytest.mark.parametrize("kind", ["<f4", "<f8"])
def test_a_time_of_eight_bytes_may_come_first(tmp_path, scans, kind):
    dtype = np.dtype([("time", "<f8"), *((name, kind) for name in ("x", "y", "z", "intensity"))])
    late = [{**one, "time": 1.7e9 + 0.1 * i + one["time"].astype(float)} for i, one in enumerate(scans)]
    for scan, one in zip(open_sequence(write(tmp_path, dtype, late)), scans, strict=True):
        np.testing.assert_allclose(scan.points, points_of(one), atol=1e-6)
        np.testing.assert_allclose(scan.time, one["time"] - one["time"].min(), atol=1e-5)


@pytest.mark.parametrize("n_bytes", [8, 20, 40])
def test_points_behind_a_header_of_their_own_are_not_taken_for_larger_records(tmp_path, scans, n_bytes):
    for i, columns in enumerate(scans):
        rows = np.column_stack([columns[name] for name in ("x", "y", "z", "intensity")]).astype("<f4")[:3000]
        (tmp_path / f"{i}.bin").write_bytes(b"\7" * n_bytes + rows.tobytes())
    with pytest.raises(InputError, match=r"no header that is known, and its content does not show .* --columns"):
        open_sequence(tmp_path)


def test_numbers_of_no_structure_are_refused_with_how_to_say_the_columns(tmp_path):
    folder = tmp_path / "log"
    folder.mkdir()
    for i in range(3):
        np.random.default_rng(i).integers(0, 256, 24 * 2003, dtype=np.uint8).tofile(folder / f"{i}.bin")
    with pytest.raises(InputError, match=r"0\.bin has 48072 bytes and no header.*--columns x,y,z,intensity"):
        open_sequence(folder)


def test_a_few_numbers_of_no_structure_are_no_larger_records(tmp_path):
    rng = np.random.default_rng(0)
    points = rng.normal(0.0, 10.0, (400, 4)).astype(np.float32)
    points[np.arange(400) % 8 != 0, 0] = 3e38
    points.tofile(tmp_path / "0.bin")  # 50 records of 128 bytes, which begin with three lengths
    with pytest.raises(InputError, match=r"0\.bin has 6400 bytes and no header.*--columns x,y,z,intensity"):
        open_sequence(tmp_path)


def test_a_few_points_are_read_as_kittis_where_they_fit_and_else_asked_for(tmp_path, scans):
    few = [{name: column[:n] for name, column in one.items()} for n, one in zip((7, 11, 13), scans, strict=False)]
    assert [len(scan) for scan in open_sequence(write(tmp_path / "four", RECORDS["x,y,z,intensity"], few))] == [
        7,
        11,
        13,
    ]
    folder = write(tmp_path / "six", RECORDS["x,y,z,intensity,ring,time"], few)
    with pytest.raises(InputError, match=r"0\.bin has 168 bytes and no header"):
        open_sequence(folder)
    assert [len(scan) for scan in open_sequence(folder, "x,y,z,intensity,ring,time")] == [7, 11, 13]


def test_the_old_names_are_the_columns_they_stand_for(tmp_path, scans):
    for name, spelled in {"bin": "x,y,z,intensity", "bin3": "x,y,z", "bin5": "x,y,z,intensity,ring"}.items():
        folder = write(tmp_path / name, RECORDS[spelled], scans)
        assert open_sequence(folder, name).fingerprint() == open_sequence(folder, spelled).fingerprint()
        np.testing.assert_array_equal(open_sequence(folder, name)[3].points, open_sequence(folder)[3].points)


def test_the_columns_that_are_given_are_taken_whatever_the_content(tmp_path, scans):
    folder = write(tmp_path / "log", RECORDS["x,y,z,intensity"], scans)
    np.testing.assert_array_equal(open_sequence(folder, "y,x,z,intensity")[0].points[:, 1], scans[0]["x"])
    with pytest.raises(InputError, match=r"\.bin has \d+ bytes, no multiple of a point \(20 bytes\).*--columns"):
        [scan.points for scan in open_sequence(folder, "x,y,z,intensity,ring")]


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "degrees"), [("kitti_0005", 35), ("kitti_0005", 45), ("lyft_5hz", 60), ("yard_avia", 40)]
)
def test_real_views_to_the_front_are_points(recording_of, tmp_path, name, degrees):
    counts = []
    for i, path in enumerate(sorted((recording_of(name) / "velodyne").glob("*.bin"))[:6]):
        rows = np.fromfile(path, np.float32).reshape(-1, 4)
        rows[:, 3] = np.floor(255 * rows[:, 3])
        rows = rows[np.abs(np.degrees(np.arctan2(rows[:, 1], rows[:, 0]))) < degrees]
        rows.tofile(tmp_path / f"{i}.bin")
        counts.append(len(rows))
    assert [len(scan) for scan in open_sequence(tmp_path)] == counts


REAL = ("kitti_0005", "kitti_0027", "lyft_5hz", "room_vlp16", "yard_avia", "handheld_xt32")
KEPT = (
    "x,y,z",
    "x,y,z,intensity",
    "x,y,z,ring,intensity",
    "x:f8,y,z,intensity",
    "x:>f4,y,z",
    "x,y,z,intensity,_,_,_,_",
)


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "spelled"),
    [(name, spelled) for i, name in enumerate(REAL) for k, spelled in enumerate(KEPT) if (i + k) % 2 == 0],
)
def test_real_sweeps_are_told_apart(recording_of, tmp_path, name, spelled):
    dtype, counts = parse_columns(spelled), []
    for i, path in enumerate(sorted((recording_of(name) / "velodyne").glob("*.bin"))[:16:5]):
        rows = np.fromfile(path, np.float32).reshape(-1, 4)
        rows = rows[: len(rows) // 48 * 48]
        elevation = np.degrees(np.arctan2(rows[:, 2], np.hypot(rows[:, 0], rows[:, 1])))
        columns = {"x": rows[:, 0], "y": rows[:, 1], "z": rows[:, 2], "intensity": rows[:, 3]}
        records({**columns, "ring": np.round(elevation / 2.0).clip(-16, 16) + 16}, dtype).tofile(tmp_path / f"{i}.bin")
        counts.append(len(rows))
    assert [len(scan) for scan in open_sequence(tmp_path)] == counts
