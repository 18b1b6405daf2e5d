"""Inputs as reports about LiDAR programs describe them: drivers' fields, exporters' headers, recorders' file names.

Each is the same short drive, written as some program writes it; what comes out is its points, in order, with their
times and rings where it tells them.
"""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from bags import CODES, cloud, write_bag
from street_log import street_log
from sweeps import pose, sweep

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.views.checking import check

N = 700
"""Points of a scan here; the rest of it says nothing more."""


@pytest.fixture(scope="module")
def drive():
    """Return scans of six: x y z (N, 3) float32, intensity, seconds after the first point, ring, and their stamps."""
    log = street_log()
    scans = []
    for scan in log.scans[:6]:
        rows = np.sort(np.random.default_rng(1).permutation(len(scan))[:N])
        rows = rows[np.argsort(scan.time[rows], kind="stable")]
        time = scan.time[rows].astype(float)
        scans.append(
            SimpleNamespace(
                xyz=scan.points[rows],
                intensity=scan.intensity[rows].astype(np.float32),
                time=time - time.min(),
                ring=scan.ring[rows].astype(np.uint16),
                stamp=float(scan.stamp),
            )
        )
    return scans


def assert_same(sequence, drive, has=("intensity", "time", "ring"), atol=1e-5, order=None):
    (found,) = check(sequence.address)
    rate = "no times" if sequence.stamps is None else "10.0 scans a second"
    assert re.match(rf"\S+ can be labelled(, with \d doubts?)?: {len(drive)} scans, .*, {rate}$", found.first_line)
    assert (found.points, sorted(found.fields)) == (N, sorted(has)), "what automos check says"
    assert len(sequence) == len(drive)
    for k, true in enumerate(drive):
        got, rows = sequence[k], slice(None) if order is None else order
        np.testing.assert_allclose(got.points, true.xyz[rows], atol=atol)
        assert (got.time is not None) == ("time" in has), "time"
        assert (got.ring is not None) == ("ring" in has), "ring"
        assert (got.intensity is not None) == ("intensity" in has), "intensity"
        if "time" in has:
            np.testing.assert_allclose(got.time, true.time[rows], atol=3e-6)
        if "ring" in has:
            np.testing.assert_array_equal(got.ring, true.ring[rows])
        if "intensity" in has:
            np.testing.assert_allclose(got.intensity, true.intensity[rows], rtol=1e-5, atol=1e-4)


# --------------------------------------------------------------------------------------- drivers' PointCloud2
def xyz(scan, kind="f4"):
    return {axis: scan.xyz[:, k].astype(kind) for k, axis in enumerate("xyz")}


def absolute(scan):
    return scan.stamp + scan.time


DRIVERS = {
    "velodyne": lambda s: {**xyz(s), "intensity": s.intensity, "ring": s.ring, "time": s.time.astype("f4")},
    "velodyne, counted to the last point": lambda s: {
        **xyz(s), "intensity": s.intensity, "ring": s.ring, "time": (s.time - s.time.max()).astype("f4")},
    "ouster": lambda s: {
        **xyz(s), "intensity": s.intensity, "t": np.round(1e9 * s.time).astype("u4"),
        "reflectivity": np.full(N, 9, "u2"), "ring": s.ring, "ambient": np.full(N, 3, "u2"),
        "range": np.ones(N, "u4")},
    "ouster, rings of a byte": lambda s: {
        **xyz(s), "intensity": s.intensity, "t": np.round(1e9 * s.time).astype("u4"), "ring": s.ring.astype("u1")},
    "hesai": lambda s: {**xyz(s), "intensity": s.intensity, "ring": s.ring, "timestamp": absolute(s)},
    "robosense": lambda s: {**xyz(s), "intensity": s.intensity, "ring": s.ring, "timestamp": absolute(s)},
    "livox, nanoseconds in float64": lambda s: {
        **xyz(s), "intensity": s.intensity, "tag": np.zeros(N, "u1"), "line": s.ring.astype("u1"),
        "timestamp": np.round(1e9 * absolute(s))},
    "microseconds since 1970": lambda s: {
        **xyz(s), "intensity": s.intensity, "ring": s.ring, "timestamp_us": np.round(1e6 * absolute(s)).astype("f8")},
    "milliseconds": lambda s: {
        **xyz(s), "intensity": s.intensity, "ring": s.ring, "time": (1e3 * s.time).astype("f4")},
    "offsets of either sign": lambda s: {
        **xyz(s), "intensity": s.intensity, "ring": s.ring,
        "offset_time": np.round(1e9 * (s.time - s.time.max())).astype("i4")},
    "double coordinates": lambda s: {
        **xyz(s, "f8"), "intensity": s.intensity, "ring": s.ring.astype("i4"), "time": s.time},
    "intensity first": lambda s: {
        "intensity": s.intensity, "time": s.time.astype("f4"), "ring": s.ring,
        **dict(reversed(list(xyz(s).items())))},
    "capital letters": lambda s: {
        "X": s.xyz[:, 0], "Y": s.xyz[:, 1], "Z": s.xyz[:, 2], "Intensity": s.intensity, "Ring": s.ring,
        "Time": s.time.astype("f4")},
    "intensity of a byte": lambda s: {
        **xyz(s), "intensity": np.floor(s.intensity).astype("u1"), "ring": s.ring, "time": s.time.astype("f4")},
    "rings that are floats": lambda s: {
        **xyz(s), "intensity": s.intensity, "ring": s.ring.astype("f4"), "time": s.time.astype("f4")},
    "channels and labels": lambda s: {
        **xyz(s), "label": np.zeros(N, "u4"), "channel": s.ring, "intensity": s.intensity, "t": s.time.astype("f4"),
        "azimuth": s.time.astype("f4"), "range": np.ones(N, "f4")},
}  # fmt: skip


@pytest.mark.parametrize("big_endian", [False, True], ids=["little", "big"])
@pytest.mark.parametrize("name", DRIVERS)
def test_clouds_of_drivers(tmp_path, drive, name, big_endian):
    messages = []
    for k, scan in enumerate(drive):
        gap = len(name) % 5
        messages.append((round(1e9 * scan.stamp) + k, scan.stamp, cloud(DRIVERS[name](scan), 1, big_endian, gap)))
    path = write_bag(tmp_path / ("log.bag" if len(name) % 2 else "log.mcap"), {"/points": messages})
    whole = [SimpleNamespace(**{**vars(s), "intensity": np.floor(s.intensity)}) for s in drive]
    sequence = open_sequence(path)
    assert_same(sequence, whole if name == "intensity of a byte" else drive)
    np.testing.assert_allclose(sequence.stamps, [scan.stamp for scan in drive], atol=1e-6)


@pytest.mark.parametrize(("per_metre", "unit"), [(100, "centimetres"), (1000, "millimetres")])
def test_clouds_of_whole_numbers_are_in_another_unit_than_metres(tmp_path, per_metre, unit):
    log, messages = street_log(), []
    for scan in log.scans[:6]:
        columns = {axis: np.round(per_metre * scan.points[:, k]).astype("i4") for k, axis in enumerate("xyz")}
        messages.append((round(1e9 * float(scan.stamp)), float(scan.stamp), cloud(columns)))
    sequence = open_sequence(write_bag(tmp_path / "log.mcap", {"/points": messages}))
    assert any(f"taken for {unit}" in words for words in sequence.warnings)
    for got, true in zip(sequence, log.scans, strict=False):
        np.testing.assert_allclose(got.points, true.points, atol=0.51 / per_metre)


def test_two_lidars_that_share_a_topic_are_refused(tmp_path, drive):
    messages = [(round(1e9 * s.stamp) + k, s.stamp, cloud(DRIVERS["velodyne"](s))) for s in drive for k in range(2)]
    front = write_bag(tmp_path / "one.bag", {"/points": messages}, frames={"/points": "front"})
    assert len(open_sequence(front)) == 2 * len(drive)
    raw = front.read_bytes().split(b"front")
    mixed = b"".join(part + (b"right" if k % 2 else b"front") for k, part in enumerate(raw[:-1])) + raw[-1]
    (tmp_path / "two.bag").write_bytes(mixed)
    with pytest.raises(
        InputError, match=r"several LiDARs, in the frames front, right, one after the other; record each"
    ):
        open_sequence(tmp_path / "two.bag")


def with_fields(parts, *more):
    parts.fields = [*parts.fields, *more]
    return parts


ODD = {
    "organised, a row for each point": lambda s: cloud(DRIVERS["velodyne"](s), N),
    "organised, rows with padding": lambda s: cloud(DRIVERS["velodyne"](s), 10, False, 2, 16),
    "rows said to be longer than they are": lambda s: SimpleNamespace(
        **{**vars(cloud(DRIVERS["velodyne"](s))), "row_step": 10**6}),
    "rows of no length": lambda s: SimpleNamespace(**{**vars(cloud(DRIVERS["velodyne"](s), 7)), "row_step": 0}),
    "a field of no type": lambda s: with_fields(cloud(DRIVERS["velodyne"](s)), ("pad", 0, 0)),
    "a field without a name": lambda s: with_fields(cloud(DRIVERS["velodyne"](s)), ("", 0, CODES["u1"])),
    "two colours in one place": lambda s: with_fields(
        cloud({**DRIVERS["velodyne"](s), "rgb": s.time.astype("f4")}, gap=0), ("rgba", 22, CODES["u4"])),
    "bytes of a buffer behind the points": lambda s: SimpleNamespace(
        **{**vars(c := cloud(DRIVERS["velodyne"](s))), "data": np.append(c.data, np.zeros(1000, np.uint8))}),
}  # fmt: skip


@pytest.mark.parametrize("name", ODD)
def test_clouds_packed_in_odd_ways(tmp_path, drive, name):
    messages = [(round(1e9 * scan.stamp), scan.stamp, ODD[name](scan)) for scan in drive]
    assert_same(open_sequence(write_bag(tmp_path / "log.mcap", {"/points": messages})), drive)


def test_a_cloud_of_no_points_among_others_is_a_scan_of_none(tmp_path, drive):
    messages = [(round(1e9 * s.stamp), s.stamp, cloud(DRIVERS["velodyne"](s))) for s in drive]
    empty = cloud({name: column[:0] for name, column in DRIVERS["velodyne"](drive[2]).items()})
    messages[2] = (*messages[2][:2], empty)
    sequence = open_sequence(write_bag(tmp_path / "log.bag", {"/points": messages}))
    assert [len(scan) for scan in sequence] == [N, N, 0, N, N, N]


def test_points_that_are_no_return_stay_in_place_be_they_nan_zero_or_infinite(tmp_path, drive):
    messages = []
    for scan in drive:
        columns = DRIVERS["velodyne"](scan)
        for k, value in enumerate((np.nan, 0.0, np.inf)):
            for axis in "xyz":
                columns[axis] = columns[axis].copy()
                columns[axis][k::9] = value
        messages.append((round(1e9 * scan.stamp), scan.stamp, cloud(columns)))
    for got, true in zip(open_sequence(write_bag(tmp_path / "log.mcap", {"/p": messages})), drive, strict=True):
        kept = np.arange(N) % 9 > 2
        np.testing.assert_array_equal(got.is_valid, kept)
        np.testing.assert_array_equal(got.points[kept], true.xyz[kept])


# ----------------------------------------------------------------------------------------------- exporters' files
def pcd(fields, body, head="", end="\n", data="binary", n=N):
    names, sizes, types, counts = zip(*fields, strict=True)
    lines = ["# .PCD v0.7 - Point Cloud Data file format", "VERSION 0.7", f"FIELDS {' '.join(names)}",
             f"SIZE {' '.join(map(str, sizes))}", f"TYPE {' '.join(types)}", f"COUNT {' '.join(map(str, counts))}",
             *([head] if head else []), f"WIDTH {n}", "HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {n}",
             f"DATA {data}"]  # fmt: skip
    return end.join(lines).encode() + end.encode() + body


def packed(scan, *layout):
    rows = np.zeros(N, [(name, kind) if np.dtype(kind).itemsize else (name, "V1") for name, kind in layout])
    values = {"x": scan.xyz[:, 0], "y": scan.xyz[:, 1], "z": scan.xyz[:, 2], "intensity": scan.intensity,
              "ring": scan.ring, "t": scan.time}  # fmt: skip
    for name, _ in layout:
        if name in values:
            rows[name] = values[name]
    return rows.tobytes()


def stored(*fields):
    """Return fields one behind the other, as compressed PCD has them, of a compressor that finds nothing twice."""
    raw = b"".join(field.tobytes() for field in fields)
    blocks = b"".join(bytes([len(raw[k : k + 32]) - 1]) + raw[k : k + 32] for k in range(0, len(raw), 32))
    return np.array([len(blocks), len(raw)], "<u4").tobytes() + blocks


F = [("x", 4, "F", 1), ("y", 4, "F", 1), ("z", 4, "F", 1)]
XYZ = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]


def text_rows(scan, template, divider="\n"):
    rows = zip(*scan.xyz.T.tolist(), scan.intensity.tolist(), scan.ring.tolist(), scan.time.tolist(), strict=True)
    return divider.join(template.format(*row) for row in rows)


PCDS = {
    "PCL's own padding": lambda s: pcd(
        [*F, ("_", 1, "U", 4), ("intensity", 4, "F", 1), ("ring", 2, "U", 1), ("_", 1, "U", 10)],
        packed(s, *XYZ, ("_", "V4"), ("intensity", "<f4"), ("ring", "<u2"), ("__", "V10"))),
    "lines of Windows": lambda s: pcd(
        [*F, ("intensity", 4, "F", 1), ("ring", 2, "U", 1)],
        packed(s, *XYZ, ("intensity", "<f4"), ("ring", "<u2")), end="\r\n"),
    "remarks between the lines": lambda s: pcd(
        [*F, ("intensity", 4, "F", 1), ("ring", 2, "U", 1)],
        packed(s, *XYZ, ("intensity", "<f4"), ("ring", "<u2")), head="# written by a converter\n#"),
    "a histogram behind the points": lambda s: pcd(
        [*F, ("fpfh", 4, "F", 33), ("intensity", 4, "F", 1), ("ring", 1, "U", 1)],
        packed(s, *XYZ, ("fpfh", "V132"), ("intensity", "<f4"), ("ring", "<u1"))),
    "doubles": lambda s: pcd(
        [(axis, 8, "F", 1) for axis in "xyz"] + [("intensity", 8, "F", 1), ("ring", 4, "I", 1)],
        packed(s, ("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("intensity", "<f8"), ("ring", "<i4"))),
    "capitals": lambda s: pcd(
        [*F, ("intensity", 4, "F", 1), ("ring", 2, "U", 1)],
        packed(s, *XYZ, ("intensity", "<f4"), ("ring", "<u2")), data="BINARY"),
    "text": lambda s: pcd(
        [*F, ("intensity", 4, "F", 1), ("ring", 2, "U", 1)],
        text_rows(s, "{:.6f} {:.6f} {:.6f} {:.4f} {}").encode() + b"\n", data="ascii"),
    "places in one field": lambda s: pcd(
        [("xyz", 4, "F", 3), ("intensity", 4, "F", 1), ("ring", 2, "U", 1)],
        packed(s, *XYZ, ("intensity", "<f4"), ("ring", "<u2"))),
    "packed, with padding, a histogram and places in one field": lambda s: pcd(
        [("pos", 8, "F", 3), ("_", 1, "U", 4), ("fpfh", 4, "F", 3), ("intensity", 4, "F", 1), ("ring", 1, "U", 1)],
        stored(s.xyz.astype("f8"), np.zeros(4 * N, "u1"), np.ones(3 * N, "f4"), s.intensity, s.ring.astype("u1")),
        data="binary_compressed"),
    "text, places in one field": lambda s: pcd(
        [("ring", 2, "U", 1), ("position", 4, "F", 3), ("normal", 4, "F", 3), ("intensity", 4, "F", 1)],
        text_rows(s, "{4} {0:.6f} {1:.6f} {2:.6f} 0 nan 1 {3:.4f}").encode(), data="ascii"),
    "text with a remark and zeros behind": lambda s: pcd(
        [*F, ("intensity", 4, "F", 1), ("ring", 2, "U", 1)],
        text_rows(s, "{:.6f} {:.6f} {:.6f} {:.4f} {}").encode() + b"\n# the end\n" + bytes(99), data="ascii"),
    "text with blanks in front": lambda s: pcd(
        [*F, ("intensity", 4, "F", 1), ("ring", 2, "U", 1)],
        text_rows(s, "  {:.6f}  {:.6f}\t{:.6f} {:.4f} {} ", "\r\n").encode(), data="ascii"),
}  # fmt: skip
PLYS = {
    "Open3D's doubles": ("double x|double y|double z|double intensity|ushort ring", "<"),
    "CloudCompare": ("float x|float y|float z|float scalar_Intensity|float scalar_ring", "<"),
    "normals and colours between": (
        "float x|float y|float z|float nx|float ny|float nz|uchar red|uchar green|uchar blue|float intensity|"
        "uchar ring", "<"),
    "big-endian": ("float x|float y|float z|float intensity|ushort ring", ">"),
    "z first": ("float z|float y|float x|uchar ring|float intensity", "<"),
    "faces before the points": (
        "float x|float y|float z|float intensity|ushort ring", "<",
        ("element face 2", "property list uchar int vertex_indices", "property float quality"),
        b"\3" + bytes(16) + b"\4" + bytes(20)),
}  # fmt: skip


def ply(scan, spelled, order, before=(), body_before=b""):
    kinds = {"float": "f4", "double": "f8", "uchar": "u1", "ushort": "u2"}
    properties = [one.split() for one in spelled.split("|")]
    layout = [(name.lower().removeprefix("scalar_"), order + kinds[kind]) for kind, name in properties]
    name = "binary_big_endian" if order == ">" else "binary_little_endian"
    head = ["ply", f"format {name} 1.0", "comment made by a program", "obj_info num_cols 10", *before,
            f"element vertex {N}", *(f"property {kind} {name}" for kind, name in properties), "element face 0",
            "property list uchar int vertex_indices", "end_header"]  # fmt: skip
    return "\n".join(head).encode() + b"\n" + body_before + packed(scan, *layout)


TEXTS = {
    "VeloView": (
        '"intensity","laser_id","Points_m_XYZ:0","Points_m_XYZ:1","Points_m_XYZ:2"',
        "{3:.4f},{4},{0},{1},{2}",
    ),
    "blanks and units": ("X [m], Y [m], Z [m], Intensity [0-255], Ring []", "{0}, {1}, {2}, {3:.4f}, {4}"),
    "CloudCompare": ("//X Y Z Intensity ring", "{0} {1} {2} {3:.4f} {4}"),
    "tabs": ("x\ty\tz\tintensity\tring", "{0}\t{1}\t{2}\t{3:.4f}\t{4}"),
    "semicolons": ("x;y;z;intensity;ring", "{0};{1};{2};{3:.4f};{4}"),
    "a spreadsheet": ("\ufeffsep=,\nx,y,z,intensity,ring", "{0},{1},{2},{3:.4f},{4}"),
    "other order": ("ring,intensity,z,y,x", "{4},{3:.4f},{2},{1},{0}"),
    "numbers of rows": (",x,y,z,intensity,ring", "7,{0},{1},{2},{3:.4f},{4}"),
    "the lidar's own": ("lidar.x,lidar.y,lidar.z,intensity,ring", "{0},{1},{2},{3:.4f},{4}"),
    "numbers in quotes": ('"x","y","z","intensity","ring"', '"{0}","{1}","{2}","{3:.4f}","{4}"'),
    "a class in words": ("label,x,y,z,intensity,ring", "car,{0},{1},{2},{3:.4f},{4}"),
    "dates": ("stamp;x;y;z;intensity;ring", "2024-05-01 12:00:00.123;{0};{1};{2};{3:.4f};{4}"),
    "words between blanks": ("x y z kind intensity ring", "{0} {1} {2} tree {3:.4f} {4}"),
    "titles above, units below": (
        "LiDAR export of May\nframe;drive\nx;y;z;intensity;ring\nm;m;m;-;-",
        "{0};{1};{2};{3:.4f};{4}",
    ),
    "bars": ("x|y|z|intensity|ring", "{0}|{1}|{2}|{3:.4f}|{4}"),
    "exponents": ("x y z intensity ring", "{0:.7e} {1:+.7E} {2:.7e} {3:.4f} {4}"),
}


def test_spreadsheets_in_utf16_numbers_of_windows_and_a_count_before_the_points_are_read(tmp_path, drive):
    rows = "\n".join(["x\ty\tz\tintensity\tring", *[text_rows(drive[0], "{0}\t{1}\t{2}\t{3:.4f}\t{4}")]])
    for k, byte_order in enumerate(("utf-16", "utf-16-be")):
        (tmp_path / f"{k}.txt").write_bytes(("\ufeff" * k + rows).encode(byte_order))
    (tmp_path / "2.txt").write_text(rows + "\n-nan(ind)\t1.#QNAN\t-1.#IND\t0\t0\n")
    (tmp_path / "3.txt").write_text(f"{N}\n" + text_rows(drive[0], "{0} {1} {2} {3:.4f}"))
    scans = list(open_sequence(tmp_path))
    for got, has_ring in zip(scans, (True, True, True, False), strict=True):
        np.testing.assert_allclose(got.points[:N], drive[0].xyz, atol=1e-5)
        assert (got.ring is not None) == has_ring
    assert np.isnan(scans[2].points[N:]).all()
    assert [len(scan) for scan in scans] == [N, N, N + 1, N]


@pytest.mark.parametrize("suffix", [".npy", ".csv"])
def test_columns_without_names_are_rings_and_times_where_their_numbers_are(tmp_path, suffix):
    sweeps = [sweep(pose(x=0.5 * i), seed=i) for i in range(3)]
    for k, one in enumerate(sweeps):
        rows = np.column_stack([one[name] for name in ("x", "y", "z", "intensity", "ring", "time")]).astype(float)
        for order, folder in (([0, 1, 2, 3, 4, 5], "last"), ([0, 1, 2, 3, 5], "fifth"), ([5, 0, 1, 2, 3], "first")):
            (tmp_path / folder).mkdir(exist_ok=True)
            path = tmp_path / folder / f"{k}{suffix}"
            np.save(path, rows[:, order]) if suffix == ".npy" else np.savetxt(path, rows[:, order], "%.6f", ",")
    for folder, has_ring in (("last", True), ("fifth", False)):
        for scan, one in zip(open_sequence(tmp_path / folder), sweeps, strict=True):
            np.testing.assert_allclose(scan.time, one["time"] - one["time"].min(), atol=2e-6)
            assert (scan.ring is not None) == has_ring
    with pytest.raises(InputError, match=r"which seem to be time,x,y,z,intensity; name them with --columns time,x,y,z"):
        open_sequence(tmp_path / "first")


def test_dates_of_points_are_their_times(tmp_path, drive):
    for k, scan in enumerate(drive):
        at = np.datetime64("2024-05-01T12:00:00", "ns") + np.round(1e9 * (0.1 * k + scan.time)).astype("m8[ns]")
        rows = [f"{t}Z,{x},{y},{z}" for t, (x, y, z) in zip(at, scan.xyz.tolist(), strict=True)]
        (tmp_path / f"{k:06d}.csv").write_text("\n".join(["timestamp,x,y,z", *rows]))
    assert_same(open_sequence(tmp_path), drive, has=("time",), atol=2e-5)


def test_headers_that_count_milliseconds_give_way_to_the_times_of_recording(tmp_path, drive):
    counted = [(round(1e9 * s.stamp), 100.0 * k + 5.0, cloud(DRIVERS["velodyne"](s))) for k, s in enumerate(drive)]
    sequence = open_sequence(write_bag(tmp_path / "log.bag", {"/points": counted}))
    assert_same(sequence, drive)
    assert any("every 100 s by the headers, and every 0.1 s as it was recorded" in said for said in sequence.warnings)


def test_colours_behind_the_points_are_no_rings(tmp_path, drive):
    for k, scan in enumerate(drive):
        (tmp_path / f"{k}.txt").write_text(text_rows(scan, "{0} {1} {2} 120 {4} 140"))
    assert open_sequence(tmp_path)[2].ring is None


@pytest.mark.parametrize("divider", [";", "\t"])
def test_decimals_may_have_commas_where_something_else_divides_the_columns(tmp_path, drive, divider):
    for k, scan in enumerate(drive):
        rows = text_rows(scan, divider.join(["{0:.5f}", "{1:.5f}", "{2:.5f}", "{3:.5f}", "{4}"]))
        text = divider.join(["X [m]", "Y [m]", "Z [m]", "Intensity", "Ring"]) + "\n" + rows.replace(".", ",")
        (tmp_path / f"{k:06d}.csv").write_text(text)
    assert_same(open_sequence(tmp_path), drive, has=("intensity", "ring"), atol=2e-5)


def test_decimals_may_have_commas_in_quotes(tmp_path, drive):
    for k, scan in enumerate(drive):
        rows = text_rows(scan, '"{0:.5f}","{1:.5f}","{2:.5f}",{4}').replace(".", ",")
        (tmp_path / f"{k:06d}.csv").write_text(f"x,y,z,ring\n{rows}\n")
    assert_same(open_sequence(tmp_path), drive, has=("ring",), atol=2e-5)


REFUSED = {
    "X (ft),Y (ft),Z (ft)|{0},{1},{2}": r"other unit than metres \(X \(ft\)\); export it again in metres",
    "x [in],y [in],z [in]|{0},{1},{2}": r"other unit than metres \(x \[in\]\)",
    "east,north,up|{0},{1},{2}": r"no column x, y, z; its columns are: east, north, up; call .* --columns",
    "|7,{0},{1},{2}": "does not name its columns, and one of the first three counts; name them with --columns",
}


@pytest.mark.parametrize("told", REFUSED)
def test_tables_whose_coordinates_are_not_clear_are_refused(tmp_path, drive, told):
    names, _, row = told.partition("|")
    for k, scan in enumerate(drive):
        rows = [*([names] if names else []), *[text_rows(scan, row)] * 2]
        (tmp_path / f"{k:06d}.csv").write_text("\n".join(rows))
    with pytest.raises(InputError, match=REFUSED[told]):
        list(open_sequence(tmp_path))


def structured(scan, order="<"):
    rows = np.zeros(N, [("ring", f"{order}u2"), ("z", f"{order}f4"), ("x", f"{order}f8"), ("y", f"{order}f4"),
                        ("intensity", f"{order}f4")])  # fmt: skip
    rows["x"], rows["y"], rows["z"] = scan.xyz.T
    rows["intensity"], rows["ring"] = scan.intensity, scan.ring
    return rows


FILES = {
    **{f"pcd: {name}": (".pcd", make) for name, make in PCDS.items()},
    **{f"ply: {name}": (".ply", lambda s, of=of: ply(s, *of)) for name, of in PLYS.items()},
    **{
        f"csv: {name}": (".csv", lambda s, of=of: f"{of[0]}\n{text_rows(s, of[1])}\n".encode())
        for name, of in TEXTS.items()
    },
}


@pytest.mark.parametrize("name", FILES)
def test_clouds_of_exporters(tmp_path, drive, name):
    suffix, make = FILES[name]
    for k, scan in enumerate(drive):
        (tmp_path / f"{k:06d}{suffix}").write_bytes(make(scan))
    assert_same(open_sequence(tmp_path), drive, has=("intensity", "ring"), atol=2e-5)


ARRAYS = [
    "fortran",
    "big-endian fields",
    "0-d of an image",
    "npz of columns",
    "npz of points and columns",
    "places in one field",
    "places in one field",
    "a plane each",
]


@pytest.mark.parametrize("kind", ARRAYS)
def test_arrays_of_exporters(tmp_path, drive, kind):
    for k, scan in enumerate(drive):
        rows = np.column_stack([scan.xyz, scan.intensity, scan.ring])
        if kind == "npz of points and columns":
            made = {"points": scan.xyz, "intensity": scan.intensity[:, None], "ring": scan.ring, "pose": np.eye(4)}
            np.savez(tmp_path / f"{k}.npz", **made, box=np.zeros(7), about=np.array({"weather": "rain"}, object))
        elif kind == "npz of columns":
            columns = {"X": rows[:, 0], "Y": rows[:, 1], "Z": rows[:, 2], "intensity": rows[:, 3], "ring": scan.ring}
            np.savez_compressed(tmp_path / f"{k}.npz", **columns, pose=np.eye(4))
        else:
            made = {"fortran": np.asfortranarray(rows), "big-endian fields": structured(scan, ">"),
                    "0-d of an image": rows.reshape(7, 100, 5),
                    "a plane each": rows.T.reshape(5, 5, 140).astype("f4"),
                    "places in one field": rows.astype("f8").view([("xyz", "f8", 3), ("intensity", "f8"),
                                                                   ("ring", "f8")])}[kind]  # fmt: skip
            np.save(tmp_path / f"{k}.npy", made)
    assert_same(open_sequence(tmp_path), drive, has=("intensity", "ring"))


# ---------------------------------------------------------------------------------------------- recorders' names
NAMES = {
    "counted without zeros": lambda k, t: f"{k + 8}",
    "seconds with decimals": lambda k, t: f"{t:.6f}",
    "nanoseconds": lambda k, t: f"{round(1e9 * t)}",
    "microseconds behind a word": lambda k, t: f"cloud_{round(1e6 * t)}",
    "seconds and nanoseconds": lambda k, t: f"{int(t)}_{round(1e9 * (t % 1)):09d}",
    "a number and a time": lambda k, t: f"frame{k:05d}_{t:.3f}",
    "milliseconds": lambda k, t: f"lidar-{round(1e3 * t)}",
}


@pytest.mark.parametrize("name", NAMES)
def test_scans_come_in_the_order_of_time_whatever_recorders_call_them(tmp_path, drive, name):
    for k, scan in reversed(list(enumerate(drive))):
        np.column_stack([scan.xyz, scan.intensity]).astype("<f4").tofile(tmp_path / f"{NAMES[name](k, scan.stamp)}.bin")
    (tmp_path / "._cloud.bin").write_bytes(b"\0\5\26\7Mac OS X")  # and what other systems leave
    (tmp_path / ".DS_Store").write_bytes(bytes(100))
    (tmp_path / "Thumbs.db").write_bytes(bytes(100))
    (tmp_path / "desktop.ini").write_text("[.ShellClassInfo]")
    sequence = open_sequence(tmp_path, "bin")
    assert_same(sequence, drive, has=("intensity",))
    if name != "counted without zeros":
        np.testing.assert_allclose(sequence.stamps, [scan.stamp for scan in drive], atol=1e-3)


@pytest.mark.parametrize("suffix", [".PCD", ".Ply", ".BIN", ".NPY"])
def test_suffixes_may_be_of_any_case(tmp_path, drive, suffix):
    make = {".PCD": PCDS["doubles"], ".Ply": lambda s: ply(s, *PLYS["big-endian"]),
            ".BIN": lambda s: np.column_stack([s.xyz, s.intensity]).astype("<f4").tobytes()}  # fmt: skip
    for k, scan in enumerate(drive):
        path = tmp_path / f"{k:06d}{suffix}"
        if suffix == ".NPY":
            with path.open("wb") as file:
                np.save(file, structured(scan))
        else:
            path.write_bytes(make[suffix](scan))
    assert_same(open_sequence(tmp_path), drive, has=("intensity",) if suffix == ".BIN" else ("intensity", "ring"))


def test_a_split_bag_is_one_drive_whatever_its_parts_are_called(tmp_path, drive):
    messages = [(round(1e9 * s.stamp), s.stamp, cloud(DRIVERS["velodyne"](s))) for s in drive]
    for k, name in enumerate(("drive_2024-01-01_0.bag", "drive_2024-01-01_1.bag", "a_last_part.bag")):
        write_bag(tmp_path / name, {"/points": messages[2 * k : 2 * k + 2]})
    assert_same(open_sequence(tmp_path), drive)


@pytest.mark.parametrize("back", [0.15, 20.0, 4e6])
def test_a_clock_that_is_set_back_amid_a_drive_leaves_its_scans_as_they_were_recorded(tmp_path, drive, back):
    later = [
        (round(1e9 * s.stamp), s.stamp - back * (k > 2), cloud(DRIVERS["velodyne"](s))) for k, s in enumerate(drive)
    ]
    sequence = open_sequence(write_bag(tmp_path / "log.mcap", {"/points": later}))
    for got, true in zip(sequence, drive, strict=True):
        np.testing.assert_array_equal(got.points, true.xyz)
        np.testing.assert_allclose(got.time, true.time, atol=3e-6)
    np.testing.assert_allclose(np.diff(sequence.stamps), 0.1, atol=1e-3)
    assert any("the clock jumps back at 1 scans" in words for words in sequence.warnings)


def test_a_split_bag_is_one_drive_though_each_part_has_a_folder(tmp_path, drive):
    messages = [(round(1e9 * s.stamp), s.stamp, cloud(DRIVERS["velodyne"](s))) for s in drive]
    for k in range(3):
        write_bag(tmp_path / f"part_{k}", {"/points": messages[2 * k : 2 * k + 2]})
    assert_same(open_sequence(tmp_path), drive)
