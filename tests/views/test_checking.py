"""What is said of a recording before it is labelled: it must be true."""

import json
import re
import zipfile

import numpy as np
import pytest
from bags import _message, cloud, write_bag, write_mcap
from point_writers import write_pcd, write_points
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation
from sweeps import moved, points_of, pose, sweep
from typer.testing import CliRunner

from automos.cli import app
from automos.core.errors import AutomosError
from automos.readers import bag_messages, codecs, folder, open_sequence
from automos.views.checking import LOOKS, check

KIND = "sensor_msgs/msg/PointCloud2"
FAR = pose(100.0, -140.2, 220.7, -3.1)
DRIVE = [pose(x=0.5 * i) for i in range(12)]


@pytest.fixture(scope="module")
def scans():
    return [sweep(T, seed=i) for i, T in enumerate(DRIVE)]


def write_bins(folder, scans, names=("x", "y", "z", "intensity"), kind="<f4"):
    folder.mkdir(parents=True)
    for i, columns in enumerate(scans):
        np.column_stack([columns[name] for name in names]).astype(kind).tofile(folder / f"{i:06d}.bin")
    return folder


def write_pcds(folder, scans, T=None, surplus=b""):
    folder.mkdir()
    for i, columns in enumerate(scans):
        numbers = {name: columns[name] for name in ("x", "y", "z", "intensity")}
        write_pcd(folder / f"{i}.pcd", numbers if T is None else moved(numbers, T @ DRIVE[i]))
        with (folder / f"{i}.pcd").open("ab") as file:
            file.write(surplus)
    return folder


def write_times(folder, step=0.1):
    (folder / "times.txt").write_text("\n".join(f"{step * i:.3f}" for i in range(len(DRIVE))))
    return folder


def messages(scans, big_endian=False, T=None):
    placed = scans if T is None else [moved(one, T @ at) for one, at in zip(scans, DRIVE, strict=True)]
    clouds = [{name: column for name, column in one.items() if name != "time"} for one in placed]
    return [(10**8 * i, 0.1 * i, cloud(one, 1, big_endian)) for i, one in enumerate(clouds, 1)]


def packed(path, raw=b"\n\r\r\n" + bytes(60)):
    path.write_bytes(raw)
    return path


def in_two_parts(folder, scans):
    every = messages(scans)
    for k, some in enumerate((every[:6], every[6:])):
        write_bag(folder / f"drive_{k}.mcap", {"/points": some})
    return folder


def write_map_with_viewpoints(folder, scans):
    folder.mkdir()
    for i, (columns, T) in enumerate(zip(scans, FAR @ np.array(DRIVE), strict=True)):
        x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
        place = " ".join(map(str, (*T[:3, 3], w, x, y, z)))
        write_pcd(folder / f"{i}.pcd", moved({axis: columns[axis] for axis in "xyz"}, T), viewpoint=place)
    return folder


def with_gaps(columns):
    return {name: np.insert(column, np.arange(0, len(column), 3), np.nan) for name, column in columns.items()}


def write_csvs(folder, scans):
    folder.mkdir()
    for i, columns in enumerate(scans):
        rows = np.column_stack([columns[name] for name in ("x", "y", "z", "intensity")])
        np.savetxt(folder / f"{i}.csv", rows, "%.4f", ",", header="X [m],Y [m],Z [m],signal photons", comments="")
    return folder


def without_index(bag):
    """Leave a bag as its recorder does when it is killed."""
    raw, path = bag.read_bytes(), bag.with_suffix(".bag.active")
    at = raw.index(b"index_pos=") + 10
    path.write_bytes(raw[:at] + bytes(8) + raw[at + 8 : int.from_bytes(raw[at : at + 8], "little")])
    bag.unlink()
    return path


def zipped(folder):
    path = folder.with_suffix(".zip")
    with zipfile.ZipFile(path, "w") as archive:
        for file in sorted(folder.iterdir()):
            archive.write(file, f"export/{file.name}")
    return path


def without_storage(bag):
    about = bag / "metadata.yaml"
    about.write_text(re.sub(r"storage_identifier: .*", 'storage_identifier: ""', about.read_text()))
    return bag


def write_angles(folder, scans):
    folder.mkdir()
    for i, columns in enumerate(scans):
        x, y, z = (columns[axis] for axis in "xyz")
        told = [np.sqrt(x * x + y * y + z * z), np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))]
        np.column_stack(told).astype("<f4").tofile(folder / f"{i}.bin")
    return folder


def with_table(folder):
    (folder / "timestamps.csv").write_text(
        "frame,time\n" + "\n".join(f"{i},{0.125 * i:.3f}" for i in range(len(DRIVE)))
    )
    return folder


def cut(folder):
    path = folder / "000004.bin"
    path.write_bytes(path.read_bytes()[:-7])
    return folder


def as_mcap(path, scans, is_ros1, profile="", text=b""):
    """Write the clouds with a definition and a profile as converters and data platforms leave them."""
    name, _, kind = KIND.partition("msg/") if is_ros1 else (KIND, "", "")
    schema = (name + kind, "ros1msg" if is_ros1 else "ros2msg", text)
    types = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    pack = types.serialize_ros1 if is_ros1 else types.serialize_cdr
    clouds = [(at, bytes(pack(_message(types, seconds, one, is_ros1), KIND))) for at, seconds, one in messages(scans)]
    return write_mcap(path, clouds, schema, "ros1" if is_ros1 else "cdr", profile)


def in_parts(path, scans):
    """Write a bag with a message for each tenth of a turn."""
    tenths = [
        (10**8 + 10**7 * (10 * i + k), 0.1 + 0.01 * (10 * i + k), cloud({name: c[rows] for name, c in one.items()}))
        for i, one in enumerate(scans)
        for k, rows in enumerate(np.array_split(np.argsort(one["time"], kind="stable"), 10))
    ]
    return write_bag(path, {"/points": tenths})


OF_MCAP = "drive can be labelled: 12 scans, a bag, .mcap with /points, 16 beams all round, 10.0 scans a second"
ALL = ("x", "y", "z", "intensity", "ring", "time")
CASES = {
    "kitti": (
        lambda f, scans: write_times(write_bins(f / "velodyne", scans).parent),
        "drive can be labelled: 12 scans, KITTI's layout (odometry, SemanticKITTI), .bin files of x,y,z,intensity, "
        "16 beams all round, 10.0 scans a second",
    ),
    "five a second": (
        lambda f, scans: write_times(write_bins(f, scans), 0.2),
        "drive can be labelled: 12 scans, a folder, .bin files of x,y,z,intensity, 16 beams all round, 5.0 scans a",
    ),
    "six columns": (
        lambda f, scans: write_bins(f, scans, ALL),
        "drive can be labelled, with 1 doubt: 12 scans, a folder, .bin files of x,y,z,intensity,ring,time, 16 beams",
    ),
    "float64": (
        lambda f, scans: write_bins(f, scans, "xyz", "<f8"),
        "drive can be labelled, with 1 doubt: 12 scans, a folder, .bin files of x:f8,y,z, 16 beams all round, no times",
    ),
    "front": (
        lambda f, scans: write_bins(f, [{n: c[one["x"] > abs(one["y"])] for n, c in one.items()} for one in scans]),
        "drive can be labelled: 12 scans, a folder, .bin files of x,y,z,intensity, 16 beams 90 degrees wide, no times",
    ),
    "pcd": (
        lambda f, scans: write_pcds(f, scans),
        "drive can be labelled: 12 scans, a folder, .pcd files, 16 beams all round, no times",
    ),
    "surplus": (
        lambda f, scans: write_pcds(f, scans, surplus=bytes(99)),
        "drive can be labelled, with 1 doubt: 12 scans, a folder, .pcd files, 16 beams all round, no times",
    ),
    "map": (
        lambda f, scans: write_pcds(f, scans, FAR),
        "drive cannot be labelled: {} has clouds in the frame of a map (world frame)",
    ),
    "empty": (
        lambda f, scans: write_bins(
            f, [one if i != 5 else {n: c[:0] for n, c in one.items()} for i, one in enumerate(scans)]
        ),
        "drive can be labelled, with 1 doubt: 12 scans, a folder, .bin files of x,y,z,intensity, 16 beams all round",
    ),
    "few": (
        lambda f, scans: write_bins(f, scans[:3]),
        "drive can be labelled, with 1 doubt: 3 scans, a folder, .bin files of x,y,z,intensity, 16 beams all round",
    ),
    "cut": (lambda f, scans: cut(write_bins(f, scans)), "drive cannot be labelled: {}/000004.bin has"),
    "bag": (
        lambda f, scans: write_bag(f.with_suffix(".bag"), {"/points": messages(scans, big_endian=True)}),
        "drive can be labelled: 12 scans, a bag, .bag with /points, 16 beams all round, 10.0 scans a second",
    ),
    "split bag": (
        in_two_parts,
        "drive_0 can be labelled: 12 scans, a bag, .mcap with /points, 16 beams all round, 10.0 scans a second",
    ),
    "two LiDARs": (
        lambda f, scans: write_bag(f.with_suffix(".bag"), dict.fromkeys(("/a", "/b"), messages(scans))),
        "drive.bag cannot be labelled: {}.bag has 2 topics of point clouds (/a, /b); give one",
    ),
    "bag of a map": (
        lambda f, scans: write_bag(f.with_suffix(".mcap"), {"/points": messages(scans, T=FAR)}),
        "drive.mcap cannot be labelled: {}.mcap/points holds clouds in a world frame ('lidar'), not in the sensor's",
    ),
    "capture": (lambda f, scans: packed(f.with_suffix(".pcapng")), "drive.pcapng cannot be labelled: {}.pcapng"),
    "gzip": (
        lambda f, scans: packed(f.with_suffix(".bag.gz"), b"\x1f\x8b" + bytes(60)),
        "drive.bag.gz cannot be labelled: {}.bag.gz is compressed (gzip)",
    ),
    "map with viewpoints": (
        write_map_with_viewpoints,
        "drive can be labelled, with 1 doubt: 12 scans, a folder, .pcd files, 16 beams all round, no times",
    ),
    "not finite": (
        lambda f, scans: write_pcds(f, list(map(with_gaps, scans))),
        "drive can be labelled: 12 scans, a folder, .pcd files, 16 beams all round, no times",
    ),
    "table": (
        write_csvs,
        "drive can be labelled: 12 scans, a folder, .csv files, 16 beams all round, no times",
    ),
    "times in a table": (
        lambda f, scans: with_table(write_bins(f, scans)),
        "drive can be labelled: 12 scans, a folder, .bin files of x,y,z,intensity, 16 beams all round, 8.0 scans a",
    ),
    "zip": (
        lambda f, scans: zipped(write_bins(f, scans)),
        "drive can be labelled: 12 scans, an archive, .bin files of x,y,z,intensity, 16 beams all round, no times",
    ),
    "bag of a recorder that was killed": (
        lambda f, scans: without_index(write_bag(f.with_suffix(".bag"), {"/points": messages(scans)})),
        "drive can be labelled: 12 scans, a bag, .active with /points, 16 beams all round, 10.0 scans",
    ),
    "bag without the name of its storage": (
        lambda f, scans: without_storage(write_bag(f, {"/points": messages(scans)})),
        "drive can be labelled: 12 scans, a bag, .mcap with /points, 16 beams all round, 10.0 scans a second",
    ),
    "mcap of ROS 1": (lambda f, scans: as_mcap(f.with_suffix(".mcap"), scans, True, "ros1"), OF_MCAP),
    "mcap without profile": (lambda f, scans: as_mcap(f.with_suffix(".mcap"), scans, False), OF_MCAP),
    "mcap with a stub of a definition": (
        lambda f, scans: as_mcap(f.with_suffix(".mcap"), scans, False, "ros2", KIND.encode()),
        OF_MCAP,
    ),
    "parts of turns": (
        lambda f, scans: in_parts(f.with_suffix(".bag"), scans),
        "drive can be labelled, with 1 doubt: 12 scans, a bag, .bag with /points, 16 beams all round, 10.0 scans a",
    ),
    "angles": (write_angles, "drive cannot be labelled: {} holds ranges and angles, as it seems"),
    **{
        kind: (lambda f, scans, kind=kind: packed(f.with_suffix(f".{kind}")), f"drive.{kind} cannot be labelled: ")
        for kind in ("e57", "lvx", "osf")
    },
    "nothing": (lambda f, scans: f.mkdir() or f, "drive cannot be labelled: {} is empty"),
    "absent": (lambda f, scans: f, "drive cannot be labelled: {} does not exist"),
}


@pytest.mark.parametrize("case", CASES)
def test_the_first_line_is_true(tmp_path, scans, case):
    write, line = CASES[case]
    (found,) = check(place := write(tmp_path / "drive", scans))
    assert found.first_line.startswith(line.format(tmp_path / "drive"))
    assert found.lines()[0] == found.first_line
    if found.exit_code < 2:
        sequence = open_sequence(place)
        assert (found.scans, found.points) == (len(sequence), int(np.median([len(scan) for scan in sequence])))
        assert found.doubts[: len(sequence.warnings)] == sequence.warnings
    else:
        with pytest.raises(AutomosError) as told:
            [scan.points for scan in open_sequence(place)]
        assert str(told.value) in found.first_line


def test_what_is_in_the_points_is_counted(tmp_path, scans):
    rows = points_of(scans[0])
    rows[::4] = np.nan
    rows[1::4] = 0.0
    (tmp_path / "drive").mkdir()
    for i in range(12):
        np.save(tmp_path / "drive" / f"{i}.npy", rows)
    (found,) = check(tmp_path / "drive")
    assert found.share_not_finite == pytest.approx(0.25, abs=1e-3)
    assert found.share_without_return == pytest.approx(0.25, abs=1e-3)
    assert found.copies == 11
    assert found.sweep is found.period is None
    assert found.fields == []
    assert [words.split(",")[0] for words in found.assumed][:1] == ["10 scans a second"]
    assert any("once more" in words for words in found.doubts)


def test_gaps_times_and_what_comes_along_are_found(tmp_path, scans):
    folder = write_bins(tmp_path / "drive", scans, ALL)
    (folder / "times.txt").write_text("\n".join(f"{0.1 * i + 0.5 * (i > 5):.2f}" for i in range(12)))
    (folder / "labels").mkdir()
    for i, columns in enumerate(scans):
        np.full(len(columns["x"]), 9, np.uint32).tofile(folder / "labels" / f"{i:06d}.label")
    (found,) = check(folder)
    assert (found.gaps, found.beams, found.sensor, found.clock) == (1, 16, "VLP-16", "times.txt")
    assert found.period == pytest.approx(0.1)
    assert found.sweep == pytest.approx(0.1, abs=2e-3)
    assert found.brings == ["labels to compare with"]
    assert found.fields == ["intensity", "time", "ring"]


def test_few_scans_of_many_are_read(tmp_path, scans, monkeypatch):
    folder = write_bins(tmp_path / "drive", scans[:2] * 100)
    (tmp_path / "drive" / "times.txt").write_text("\n".join(f"{0.1 * i:.1f}" for i in range(200)))
    kind, read = type(open_sequence(folder)), []
    one = kind.__getitem__

    def counted(self, index):
        read.append(index)
        return one(self, index)

    monkeypatch.setattr(kind, "__getitem__", counted)
    assert check(folder)[0].scans == 200
    assert len(read) <= LOOKS


def test_the_command_prints_a_screen_or_json_and_leaves_with_what_it_found(tmp_path, scans):
    good = write_times(write_bins(tmp_path / "drive", scans))
    done = CliRunner().invoke(app, ["check", str(good)])
    assert done.exit_code == 0
    assert done.output.startswith("drive can be labelled: 12 scans")
    assert len(done.output.splitlines()) < 25
    odd = write_bins(tmp_path / "odd", scans, ALL)
    assert CliRunner().invoke(app, ["check", str(odd)]).exit_code == 1
    told = CliRunner().invoke(app, ["check", str(odd), "--columns", ",".join(ALL), "--json"])
    assert told.exit_code == 0
    (found,) = json.loads(told.output)
    assert (found["can_be_labelled"], found["scans"], found["exit_code"]) == (True, 12, 0)
    assert CliRunner().invoke(app, ["check", str(tmp_path / "none")]).exit_code == 2


@pytest.mark.filterwarnings("error")
def test_a_sensor_that_looks_up_only_is_told_without_a_word_of_the_libraries(tmp_path, scans):
    for k in range(3):
        up = np.abs(np.random.default_rng(k).normal(0.0, 1.0, (4000, 4))) * [1.0, 1.0, 9.0, 1.0] + [0.0, 0.0, 6.0, 0.0]
        up.astype("<f4").tofile(tmp_path / f"{k}.bin")
    (found,) = check(tmp_path)
    assert found.scans == 3


def test_several_recordings_are_told_one_by_one(tmp_path, scans):
    write_bins(tmp_path / "fleet" / "a" / "velodyne", scans)
    cut(write_bins(tmp_path / "fleet" / "b" / "velodyne", scans))
    a, b = check(tmp_path / "fleet")
    assert (a.name, a.exit_code, b.name, b.exit_code) == ("a", 0, "b", 2)


def test_what_label_takes_as_several_recordings_is_told_as_several(tmp_path, scans):
    for name in ("a", "b"):
        write_times(write_bins(tmp_path / "both" / name, scans))
    done = CliRunner().invoke(app, ["check", str(tmp_path / "both")])
    assert done.exit_code == 0
    assert [line.partition(":")[0] for line in done.output.splitlines() if " can be labelled" in line] == [
        "a can be labelled", "b can be labelled",
    ]  # fmt: skip


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("kitti_0005", "154 scans, {}, 64 beams all round, 10.0 scans a second"),
        ("kitti_0027", "100 scans, {}, 64 beams all round, 10.0 scans a second"),
        ("lyft_5hz", "125 scans, {}, about 40 beams all round, 5.0 scans a second"),
        ("room_vlp16", "138 scans, {}, 16 beams 290 degrees wide, 10.0 scans a second"),
        ("yard_avia", "47 scans, {}, no fixed beams, 80 degrees wide, no times"),
        ("handheld_xt32", "30 scans, {}, about 32 beams all round, no times"),
    ],
)
def test_the_first_line_is_true_of_real_recordings(recording_of, name, line):
    (found,) = check(recording_of(name))
    what = "KITTI's layout (odometry, SemanticKITTI), .bin files of x,y,z,intensity"
    assert found.first_line == f"{name} can be labelled: {line.format(what)}"


@pytest.mark.slow
@pytest.mark.parametrize("has_times", [True, False], ids=["times", "no times"])
@pytest.mark.parametrize("of_points", [(), ("time", "ring")], ids=["plain", "times of points"])
@pytest.mark.parametrize("kind", ["bin", "pcd", "ply", "npy", "bag"])
def test_of_a_thousand_scans_headers_and_at_most_twenty_are_read(
    tmp_path, scans, monkeypatch, kind, of_points, has_times
):
    few = {name: scans[0][name][::4] for name in ("x", "y", "z", "intensity", *of_points)}
    place, read = tmp_path / f"drive{'.mcap' * (kind == 'bag')}", []
    if kind == "bag":
        write_bag(place, {"/points": [(10**9 + 10**8 * i, 1 + 0.1 * i, cloud(few)) for i in range(1000)]})
        whole = bag_messages.read_message
        monkeypatch.setattr(bag_messages, "read_message", lambda *given: read.append(given) or whole(*given))
    else:
        place.mkdir()
        for i in range(1000):
            path = place / f"{i:06d}.{kind}"
            few["x"] = few["x"] + 1e-4  # no scan is another once more
            if kind == "bin":
                np.column_stack([*few.values()]).astype("<f4").tofile(path)  # its columns are seen in four beginnings
            else:
                write_points(path, few)
        if has_times:
            (place / "times.txt").write_text("\n".join(f"{0.1 * i:.1f}" for i in range(1000)))
        one = codecs.read_columns
        monkeypatch.setattr(folder, "read_columns", lambda path, *given: read.append(path) or one(path, *given))
    assert check(place)[0].scans == 1000
    assert LOOKS // 2 < len(read) <= LOOKS  # those that open_sequence looks at, and those that are shown
