"""Every codec: what is written comes back, in order, and damaged files are told."""

import numpy as np
import pytest
import trimesh

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.readers.codecs import CODECS, read_columns
from automos.readers.columns import to_scan
from automos.readers.pcd import read_header

KINDS = [
    ("a.pcd", {"encoding": "ascii"}),
    ("a.pcd", {"encoding": "binary"}),
    ("a.pcd", {"encoding": "binary_compressed"}),
    ("a.ply", {"encoding": "ascii"}),
    ("a.ply", {"encoding": "binary_little_endian"}),
    ("a.ply", {"encoding": "binary_big_endian"}),
    ("a.npy", {}),
    ("a.xyz", {}),
]
IDS = [" ".join((name, *options.values())) for name, options in KINDS]


def read_scan(path, codec=None):
    return to_scan(read_columns(path, codec or path.suffix[1:]), path)


@pytest.mark.parametrize(("name", "options"), KINDS, ids=IDS)
def test_every_column_comes_back_as_written(tmp_path, write_points, columns, name, options):
    write_points(tmp_path / name, columns, **options)
    scan = read_scan(tmp_path / name)
    np.testing.assert_array_equal(scan.points, np.column_stack([columns[axis] for axis in "xyz"]))
    np.testing.assert_array_equal(scan.intensity, columns["intensity"])
    np.testing.assert_array_equal(scan.ring, columns["ring"])
    np.testing.assert_allclose(scan.time, np.linspace(0, 0.1, 500), atol=1e-8)
    assert scan.points.flags.c_contiguous
    assert scan.points.dtype == np.float32


@pytest.mark.parametrize(("name", "options"), KINDS, ids=IDS)
def test_rows_that_are_no_measurement_stay_in_their_place(tmp_path, write_points, name, options):
    bad = np.array([1.0, np.nan, 0.0, np.inf, -np.inf, 2.0], np.float32)
    write_points(tmp_path / name, dict.fromkeys("xyz", bad), **options)
    scan = read_scan(tmp_path / name)
    np.testing.assert_array_equal(scan.points, np.column_stack([bad] * 3))
    np.testing.assert_array_equal(scan.is_valid, [True, False, False, False, False, True])


@pytest.mark.parametrize(("name", "options"), KINDS, ids=IDS)
def test_a_scan_of_no_points_is_an_empty_scan(tmp_path, write_points, name, options):
    write_points(tmp_path / name, {axis: np.zeros(0, np.float32) for axis in "xyz"}, **options)
    assert read_scan(tmp_path / name).points.shape == (0, 3)


def test_an_empty_bin_file_is_an_empty_scan(tmp_path):
    (tmp_path / "a.bin").touch()
    assert read_scan(tmp_path / "a.bin").points.shape == (0, 3)


@pytest.mark.parametrize(("name", "options"), KINDS[:-1], ids=IDS[:-1])
@pytest.mark.parametrize("keep", [0.9, 0.5, 0.02])
def test_a_file_cut_short_is_told_by_name(tmp_path, write_points, columns, name, options, keep):
    path = tmp_path / name
    write_points(path, columns, **options)
    raw = path.read_bytes()
    path.write_bytes(raw[: int(keep * len(raw))])
    with pytest.raises(InputError) as error:
        read_scan(path)
    assert str(path) in str(error.value)


@pytest.mark.parametrize("name", ["a.pcd", "a.ply", "a.npy", "a.xyz"])
def test_a_file_that_is_something_else_is_told_by_name(tmp_path, name):
    (tmp_path / name).write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)))
    with pytest.raises(InputError, match=name):
        read_scan(tmp_path / name)


@pytest.mark.parametrize("codec", CODECS)
def test_a_file_that_is_gone_is_told_by_name(tmp_path, codec):
    with pytest.raises(InputError, match=r"gone\.x cannot be read: No such file"):
        read_columns(tmp_path / "gone.x", codec)


# ---------------------------------------------------------------------------------------------------------- bin
@pytest.mark.parametrize(("codec", "width"), [("bin", 4), ("bin3", 3), ("bin5", 5), ("bin6", 6)])
def test_bin_columns_are_as_many_as_the_codec_says(tmp_path, codec, width):
    rows = np.arange(10 * width, dtype=np.float32).reshape(10, width)
    rows.tofile(tmp_path / "a.bin")
    scan = read_scan(tmp_path / "a.bin", codec)
    np.testing.assert_array_equal(scan.points, rows[:, :3])
    if width == 3:
        assert scan.intensity is None
    else:
        np.testing.assert_array_equal(scan.intensity, rows[:, 3])
    if width >= 5:
        np.testing.assert_array_equal(scan.ring, rows[:, 4])


# ---------------------------------------------------------------------------------------------------------- pcd
def test_a_pcd_header_gives_the_viewpoint_as_a_transform(tmp_path, write_points, columns):
    # a quarter turn about z: w = z = sqrt(1/2); x then points along y.
    write_points(tmp_path / "a.pcd", columns, viewpoint="1 2 3 0.70710678 0 0 0.70710678")
    expected = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(read_header(tmp_path / "a.pcd").viewpoint, expected, atol=1e-7)


def test_a_viewpoint_that_is_nowhere_is_told(tmp_path):
    header = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nVIEWPOINT 0 -2147483649 0 1 0 0 0\nDATA ascii\n"
    (tmp_path / "a.pcd").write_text(f"{header}1 2 3\n")
    with pytest.raises(InputError, match=r"a\.pcd has a PCD header .*VIEWPOINT is at .* m"):
        read_header(tmp_path / "a.pcd")


@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
def test_padding_and_fields_of_several_values_do_not_shift_the_others(tmp_path, encoding, pack_lzf):
    # Fields as PCL writes a PointXYZI with a histogram: x y z _ h[3] intensity, all float32.
    rows = np.arange(2 * 9, dtype=np.float32).reshape(2, 9)
    header = (
        "VERSION .7\nFIELDS x y z _ h intensity\nSIZE 4 4 4 1 4 4\nTYPE F F F U F F\nCOUNT 1 1 1 4 3 1\n"
        f"WIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA {encoding}\n"
    ).encode()
    if encoding == "ascii":
        body = "".join(
            " ".join([*(f"{v:g}" for v in row[:3]), "0 0 0 0", *(f"{v:g}" for v in row[4:8])]) + "\n" for row in rows
        ).encode()
    elif encoding == "binary":
        body = b"".join(row[:3].tobytes() + bytes(4) + row[4:8].tobytes() for row in rows)
    else:
        raw = b"".join([*(rows[:, i].tobytes() for i in range(3)), bytes(8), rows[:, 4:7].tobytes()])
        raw += rows[:, 7].tobytes()
        body = np.array([len(pack_lzf(raw)), len(raw)], "<u4").tobytes() + pack_lzf(raw)
    (tmp_path / "a.pcd").write_bytes(header + body)
    scan = read_scan(tmp_path / "a.pcd")
    np.testing.assert_array_equal(scan.points, rows[:, :3])
    np.testing.assert_array_equal(scan.intensity, rows[:, 7])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"FIELDS x y z", b"FIELDS a b c", "no column x, y, z; its columns are: a, b, c"),
        (b"SIZE 4 4 4", b"SIZE 4 4", "header that cannot be understood"),
        (b"TYPE F F F", b"TYPE Q F F", "header that cannot be understood"),
        (b"FIELDS x y z", b"FIELDS x y x", "cannot be understood: x, y or z is there twice"),
        (b"WIDTH 3", b"WIDTH many", "header that cannot be understood"),
        (b"FIELDS x", b"FIELDS " + b"x " * 5000, "cannot be understood: 500[0-9] fields"),
        (b"DATA binary", b"DATA zipped", "DATA is zipped"),
        (b"WIDTH 3", b"WIDTH 4", "WIDTH 4, HEIGHT 1 and POINTS do not agree"),
    ],
)
def test_a_damaged_pcd_header_is_told(tmp_path, write_points, old, new, message):
    path = tmp_path / "a.pcd"
    write_points(path, {axis: np.ones(3, np.float32) for axis in "xyz"})
    path.write_bytes(path.read_bytes().replace(old, new))
    with pytest.raises(InputError, match=message):
        read_scan(path)


# ---------------------------------------------------------------------------------------------------------- ply
@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_ply_files_of_another_library_are_read(tmp_path, encoding):
    points = np.random.default_rng(1).normal(size=(50, 3))
    cloud = trimesh.PointCloud(points, colors=np.full((50, 4), 7, np.uint8))
    exported = trimesh.exchange.ply.export_ply(cloud, encoding=encoding)
    (tmp_path / "a.ply").write_bytes(exported)
    np.testing.assert_allclose(read_scan(tmp_path / "a.ply").points, points, atol=1e-6)


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_elements_before_and_after_the_vertices_are_skipped(tmp_path, write_points, columns, encoding):
    path = tmp_path / "a.ply"
    camera = b"1 2\n" if encoding == "ascii" else np.array([1, 2], "<f4").tobytes()
    before = "element camera 1\nproperty float u\nproperty float v\n"
    write_points(path, columns, encoding=encoding, before=before, body_before=camera)
    faces = b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    face = b"3 0 1 2\n" if encoding == "ascii" else b"\3" + np.arange(3, dtype="<i4").tobytes()
    path.write_bytes(path.read_bytes().replace(b"end_header\n", faces) + face)
    np.testing.assert_array_equal(read_scan(path).points[:, 0], columns["x"])


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_a_ply_file_of_no_points_may_end_with_the_word_that_ends_its_header(tmp_path, write_points, encoding):
    path = tmp_path / "a.ply"
    write_points(path, {axis: np.zeros(0, np.float32) for axis in "xyz"}, encoding=encoding)
    assert path.read_bytes().endswith(b"end_header\n")
    path.write_bytes(path.read_bytes()[:-1])
    assert read_scan(path).points.shape == (0, 3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"ply\n", b"plx\n", "does not start with 'ply'"),
        (b"element vertex", b"element node", "no element 'vertex'"),
        (b"property float x", b"property list uchar int x", "lists in its vertices"),
        (b"property float x", b"property quad x", "cannot be understood: 'property quad x'"),
        (b"property float y", b"property float x", "cannot be understood: 'property float x'"),
        (
            b"property float y",
            b"\n".join(b"property float p%d" % i for i in range(5000)),
            "cannot be understood: 'property",
        ),
        (b"property float x", b"PROPERTY float x", "cannot be understood: 'PROPERTY float x'"),
        (b"binary_little_endian", b"zipped", "PLY format 'zipped'"),
    ],
)
def test_a_damaged_ply_header_is_told(tmp_path, write_points, old, new, message):
    path = tmp_path / "a.ply"
    write_points(path, {axis: np.ones(3, np.float32) for axis in "xyz"})
    path.write_bytes(path.read_bytes().replace(old, new))
    with pytest.raises(InputError, match=message):
        read_scan(path)


KINDS_OF_BYTES = [
    (".pcd", "binary"),
    (".pcd", "binary_compressed"),
    (".ply", "binary_little_endian"),
    (".ply", "binary_big_endian"),
]


@pytest.mark.parametrize(("suffix", "encoding"), KINDS_OF_BYTES)
def test_bytes_that_came_in_between_points_are_told_be_they_less_than_a_point(
    tmp_path, write_points, columns, suffix, encoding
):
    path = tmp_path / f"a{suffix}"
    write_points(path, columns, encoding=encoding)
    whole = path.read_bytes()
    for padding in (b"\n", bytes(4096), b"\0"):
        path.write_bytes(whole + padding)
        np.testing.assert_array_equal(read_scan(path).points[:, 0], columns["x"])
    path.write_bytes(whole[:-4000] + b"xyz" + whole[-4000:])
    with pytest.raises(InputError, match=r"a\.p.. (holds 3 bytes more|cannot be unpacked)"):
        read_scan(path)


@pytest.mark.parametrize("encoding", ["binary", "binary_compressed"])
@pytest.mark.parametrize("surplus", [b"x", bytes(range(256)) * 3, b"\n" * 40 + b"remarks", bytes(3880)])
def test_what_lies_behind_the_points_of_a_pcd_file_does_no_harm(tmp_path, write_points, columns, encoding, surplus):
    path = tmp_path / "a.pcd"
    write_points(path, columns, encoding=encoding)
    path.write_bytes(path.read_bytes() + surplus)
    np.testing.assert_array_equal(read_scan(path).points[:, 0], columns["x"])


def test_a_pcd_file_that_was_copied_as_text_is_told(tmp_path, write_points, columns):
    path = tmp_path / "a.pcd"
    write_points(path, columns)
    head, body = path.read_bytes().split(b"DATA binary\n")
    path.write_bytes(head + b"DATA binary\n" + body.replace(b"\n", b"\r\n"))
    assert b"\n" in body
    with pytest.raises(InputError, match=r"a\.pcd holds \d+ bytes more .* copied as text"):
        read_scan(path)


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_what_lies_behind_the_vertices_must_end_where_the_file_does(tmp_path, write_points, columns, encoding):
    path = tmp_path / "a.ply"
    write_points(path, columns, encoding=encoding)
    faces = b"element face 2\nproperty list uchar short of\nproperty uchar red\nend_header\n"
    order = ">" if "big" in encoding else "<"
    of = [b"\2" + np.arange(2, dtype=order + "i2").tobytes() + b"\7", b"\0\7"]
    behind = b"2 0 1 7\n0 7\n" if encoding == "ascii" else b"".join(of)
    whole = path.read_bytes().replace(b"end_header\n", faces) + behind
    path.write_bytes(whole)
    np.testing.assert_array_equal(read_scan(path).points[:, 0], columns["x"])
    fewer = whole.replace(b"element vertex 500", b"element vertex 250")
    for damaged in (fewer, whole[:-4], whole + behind):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"a\.ply (holds|is cut short)"):
            read_scan(path)


# ------------------------------------------------------------------------------------------------- npy and text
@pytest.mark.parametrize("dtype", ["<f8", ">f4", "<f2", "<i4"])
def test_a_plain_numpy_array_is_x_y_z_intensity(tmp_path, dtype):
    rows = np.arange(12).reshape(3, 4)
    np.save(tmp_path / "a.npy", rows.astype(dtype))
    scan = read_scan(tmp_path / "a.npy")
    np.testing.assert_array_equal(scan.points, rows[:, :3])
    np.testing.assert_array_equal(scan.intensity, rows[:, 3])
    assert scan.points.dtype.isnative


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((5, 2)), r"shape \(5, 2\)"),
        (np.zeros(5), r"shape \(5,\)"),
        (np.array([["a", "b", "c"]]), "points are numbers"),
        (np.array([[object(), 1, 2]]), "a.npy holds objects of Python, which are not read; save its numbers"),
        (np.array({"points": [[1.0, 2.0, 3.0]]}, object), "a.npy holds objects of Python, which are not read"),
    ],
)
def test_an_array_that_holds_no_points_is_told(tmp_path, array, message):
    np.save(tmp_path / "a.npy", array, allow_pickle=True)
    with pytest.raises(InputError, match=message):
        read_scan(tmp_path / "a.npy")


@pytest.mark.parametrize(
    "text",
    [
        "1 2 3 4\n5 6 7 8\n",
        "1,2,3,4\r\n5,6,7,8\r\n",
        "1;2;3;4\n5;6;7;8",
        "\n1\t2\t3\t4\n\n5\t6\t7\t8\n",
        "# made by hand\n1 2 3 4\n# half way\n5 6 7 8 # last\n",
        "x,y,z,Intensity\n1,2,3,4\n5,6,7,8\n",
        "//Z X Y Scalar_Intensity\n3 1 2 4\n7 5 6 8\n",
        "ring i x y z\n0 4 1 2 3\n0 8 5 6 7\n",
        '"x","y","z","intensity"\n1,2,3,4\n5,6,7,8\n',
        "# made by hand\n\n# x y z ring intensity\n1 2 3 0 4\n5 6 7 0 8\n",
        "# made by hand\n# y up\nx,y,z,ring,intensity\n1,2,3,0,4\n5,6,7,0,8\n",
    ],
)
def test_text_may_be_divided_and_named_in_many_ways(tmp_path, text):
    (tmp_path / "a.csv").write_text(text)
    scan = read_scan(tmp_path / "a.csv", "xyz")
    np.testing.assert_array_equal(scan.points, [[1, 2, 3], [5, 6, 7]])
    np.testing.assert_array_equal(scan.intensity, [4, 8])


@pytest.mark.parametrize(
    "header",
    [
        "x,y,z,signal photons,channel,raw timestamp",
        '"Point:0","Point:1","Point:2","Signal Photons","Channel","Raw Timestamp"',
        "Points_m_XYZ:0,Points_m_XYZ:1,Points_m_XYZ:2,intensity,laser_id,adjustedtime",
        "X (m),Y (m),Z (m),Intensity [0-255],Ring (#),Time (ns)",
        "X;Y;Z;Reflectivity;Laser ID;Timestamp (us)",
        "pos_x\tpos_y\tpos_z\tintensity\tbeam id\tgps time",
        "sep=;\nx;y;z;i;ring;t",
        "# lidar.position.x, y, z, i, ring, t",
        '"x" "y" "z" "intensity" "ring" "time"',
        " Coordinate X , Coordinate Y , Coordinate Z , signal , ring-id , time_ns ",
    ],
)
def test_columns_have_the_names_that_programs_give_them(tmp_path, header):
    mark = next((mark for mark in "\t;," if mark in header), " ")
    if header.startswith("# lidar"):
        header = header.replace("lidar.position.x", "position.x")
    rows = [[1.5, 2.5, 0.5, 7, 3, 1000], [-1.5, 4, 0.25, 8, 4, 2000], [3, 5, 1, 9, 5, 4000]]
    text = "\n".join([header, *(mark.join(map(str, row)) for row in rows)])
    (tmp_path / "a.csv").write_text(text)
    scan = read_scan(tmp_path / "a.csv", "xyz")
    np.testing.assert_array_equal(scan.points, np.array(rows)[:, :3])
    np.testing.assert_array_equal(scan.intensity, [7, 8, 9])
    np.testing.assert_array_equal(scan.ring, [3, 4, 5])
    np.testing.assert_allclose(scan.time / scan.time[-1], [0.0, 1.0 / 3.0, 1.0])


def test_a_column_of_row_numbers_without_a_name_is_left_out(tmp_path):
    (tmp_path / "a.csv").write_text(",x,y,z\n0,1.5,2.5,0.5\n1,3,4,5\n")
    assert read_scan(tmp_path / "a.csv", "xyz").points.tolist() == [[1.5, 2.5, 0.5], [3, 4, 5]]


def test_columns_of_text_and_arrays_may_be_named(tmp_path):
    (tmp_path / "a.csv").write_text("east,north,up,amplitude\n1,2,3,4\n5,6,7,8\n")
    scan = to_scan(read_columns(tmp_path / "a.csv", "xyz", "y,x,z,intensity"), tmp_path)
    np.testing.assert_array_equal(scan.points, [[2, 1, 3], [6, 5, 7]])
    np.save(tmp_path / "a.npy", np.arange(10.0).reshape(2, 5))
    scan = to_scan(read_columns(tmp_path / "a.npy", "npy", "time,x,y,z,intensity"), tmp_path)
    np.testing.assert_array_equal(scan.points, [[1, 2, 3], [6, 7, 8]])
    with pytest.raises(InputError, match=r"a\.npy has 5 columns, and --columns names 4"):
        read_columns(tmp_path / "a.npy", "npy", "x,y,z,intensity")


def test_a_file_that_names_its_columns_is_given_no_others(tmp_path, write_points, columns):
    write_points(tmp_path / "a.pcd", columns)
    with pytest.raises(InputError, match="names its columns itself; leave --columns out"):
        read_columns(tmp_path / "a.pcd", "pcd", "x,y,z")


@pytest.mark.parametrize(
    "shape",
    [
        "4xN", "image", "planes", "archive", "archive of columns", "archive of one", "archive of rows",
        "archive of two", "archive of another name",
    ],
)  # fmt: skip
def test_arrays_lie_in_many_ways(tmp_path, shape):
    rows = np.random.default_rng(0).normal(size=(240, 4)).astype(np.float32)
    path = tmp_path / ("a.npz" if shape.startswith("archive") else "a.npy")
    match shape:
        case "4xN":
            np.save(path, rows.T)
        case "image":
            np.save(path, rows.reshape(12, 20, 4))
        case "planes":
            np.save(path, rows.T.reshape(4, 12, 20))
        case "archive":
            np.savez_compressed(path, points=rows, pose=np.eye(4))
        case "archive of columns":
            np.savez(path, x=rows[:, 0], y=rows[:, 1], z=rows[:, 2], intensity=rows[:, 3], stamp=np.zeros(1))
        case "archive of rows":
            np.savez(path, **{name: rows[:, k : k + 1].T for k, name in enumerate("xyzi")})
        case "archive of two":
            np.savez(path, points=rows[:, :3], intensity=rows[:, 3:].T)
        case "archive of another name":
            np.savez(path, of_the_roof=rows, mount=np.eye(4), camera=np.ones((3, 3)))
        case "archive of one":
            np.savez(path, whatever=rows)
    scan = read_scan(path, "npy")
    np.testing.assert_array_equal(scan.points, rows[:, :3])
    np.testing.assert_array_equal(scan.intensity, rows[:, 3])


def test_an_archive_whose_points_are_not_told_from_others_or_that_is_cut_is_told(tmp_path):
    np.savez(tmp_path / "a.npz", first=np.zeros((5, 3)), second=np.zeros((6, 3)))
    with pytest.raises(InputError, match=r"a\.npz holds the arrays first, second; call the one of points 'points'"):
        read_scan(tmp_path / "a.npz", "npy")
    np.savez(tmp_path / "b.npz", points=np.ones((500, 3)))
    (tmp_path / "b.npz").write_bytes((tmp_path / "b.npz").read_bytes()[:-900])
    with pytest.raises(InputError, match=r"b\.npz"):
        read_scan(tmp_path / "b.npz", "npy")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2 3\n4 5\n", "not a table of numbers"),
        ("1 2 3\n4 five 6\n", "not a table of numbers"),
        ("x y z i\n1 2 3\n", "names 4 columns in its first line but has 3"),
        ("x y z i 1 2 3 4 5 6 7 8", "names x, y or z twice, or a column by a number, in its first line"),
        ("x y z x\n1 2 3 4\n", "names x, y or z twice, or a column by a number, in its first line"),
        ("east north up\n1 2 3\n", "no column x, y, z; its columns are: east, north, up"),
        ("1 2\n3 4\n", r"shape \(2, 2\)"),
    ],
)
def test_text_that_holds_no_points_is_told(tmp_path, text, message):
    (tmp_path / "a.xyz").write_text(text)
    with pytest.raises(InputError, match=message):
        read_scan(tmp_path / "a.xyz")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1,5;2.5;0,5", "divides numbers by commas and by something else"),
        ("1,5 2,5 0,5", "divides numbers by commas and by something else"),
        ("1.5,,2.5,0.5", "has cells without a number"),
        ("x,y,z\n,1.5,2.5,0.5", "has cells without a number"),
        (",x,y\n1.5,2.5,0.5", "has no column z"),
        ("1;2;3\n;4;5;6", "has cells without a number"),
    ],
)
def test_text_whose_columns_would_be_taken_for_others_is_told(tmp_path, text, said):
    (tmp_path / "0.csv").write_text(text + "\n")
    with pytest.raises(InputError, match=rf"0\.csv {said}"):
        open_sequence(tmp_path)[0]


@pytest.mark.parametrize(
    "line",
    [
        "1.5;2.5;0.5",
        "1,5;2,5;0,5",
        "1,5; 2,5; 0,5;",
        "1.5, 2.5, 0.5",
        "1.5 , 2.5 ,0.5",
        "1.5,2.5,0.5,",
        " 1.5\t2.5  0.5 ",
    ],
)
def test_text_divided_in_one_way_is_read_even_where_a_scan_is_a_single_point(tmp_path, line):
    for i in range(6):
        (tmp_path / f"{i}.csv").write_text(line + "\n")
    sequence = open_sequence(tmp_path)
    assert [scan.points.tolist() for scan in sequence] == [[[1.5, 2.5, 0.5]]] * 6


def test_columns_whose_names_differ_by_their_case_alone_are_told_and_other_letters_are_other_names(tmp_path):
    (tmp_path / "0.csv").write_text("x y z Z\n1 2 3 9\n")
    with pytest.raises(InputError, match=r"0\.csv (has z twice|names x, y or z twice)"):
        open_sequence(tmp_path)[0]
    with pytest.raises(InputError, match=r"has z twice \(z, Z\)"):
        to_scan({name: np.ones(1) for name in ("x", "y", "z", "Z")}, tmp_path)
    scan = to_scan({name: np.full(1, k) for k, name in enumerate(("\u0437", "x", "y", "z"))}, tmp_path)
    assert scan.points.tolist() == [[1.0, 2.0, 3.0]]


@pytest.mark.parametrize("text", ["x,y,z,intensity\n1,2,3,4\n", "1,2,3,4\n"])
def test_text_may_begin_with_the_mark_that_spreadsheets_write(tmp_path, text):
    (tmp_path / "a.csv").write_text(text, encoding="utf-8-sig")
    columns = read_columns(tmp_path / "a.csv", "xyz")
    assert {name: column.tolist() for name, column in columns.items()} == {
        "x": [1],
        "y": [2],
        "z": [3],
        "intensity": [4],
    }
