import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from street_log import OBJECTS, assert_points_lie_in_their_boxes, assert_same_points, assert_same_truth, street_log

from automos.core.errors import InputError, MissingExtraError
from automos.core.geometry import inverse, make_transform, transform
from automos.readers import open_sequence
from automos.readers.box_truth import DrawnTruth
from automos.views.checking import check

pyarrow = pytest.importorskip("pyarrow")
feather = pytest.importorskip("pyarrow.feather")

T_EGO_SENSOR = make_transform(Rotation.from_euler("z", 0.3).as_matrix(), [1.35, 0.0, 1.8])


def write(path, **columns):
    path.parent.mkdir(parents=True, exist_ok=True)
    feather.write_feather(pyarrow.table(columns), path, compression="zstd")


def poses_as_columns(T):
    q = Rotation.from_matrix(T[:, :3, :3]).as_quat()
    return {f"q{a}": q[:, i] for i, a in enumerate("xyzw")} | {f"t{a}_m": T[:, i, 3] for i, a in enumerate("xyz")}


def write_log(folder, log, drop=()):
    """Write a log as Argoverse 2 publishes them: points, boxes and poses in the vehicle's frame, half floats."""
    T_city_ego = log.T_ground_sensor @ inverse(T_EGO_SENSOR)
    rows = {name: [] for name in ("timestamp_ns", "track_uuid", "category", "length_m", "width_m", "height_m")}
    T_ego_box = []
    for i, (scan, t) in enumerate(zip(log.scans, log.nanoseconds, strict=True)):
        points = transform(T_EGO_SENSOR, scan.points)
        write(
            folder / "sensors" / "lidar" / f"{t}.feather",
            **{axis: points[:, k].astype(np.float16) for k, axis in enumerate("xyz")},
            intensity=scan.intensity.astype(np.uint8),
            laser_number=scan.ring.astype(np.uint8),
            offset_ns=(scan.time.astype(float) * 1e9).astype(np.int32),
        )
        boxes = log.boxes(i)
        for k in range(len(boxes)):
            R = Rotation.from_euler("z", boxes.yaw[k]).as_matrix()
            T_ego_box.append(inverse(T_city_ego[i]) @ make_transform(R, boxes.center[k]))
            values = (t, f"uuid-{k}", "REGULAR_VEHICLE", *boxes.size[k])
            for name, value in zip(rows, values, strict=True):
                rows[name].append(value)
    write(folder / "annotations.feather", **rows, **poses_as_columns(np.array(T_ego_box)))
    write(folder / "city_SE3_egovehicle.feather", timestamp_ns=log.nanoseconds, **poses_as_columns(T_city_ego))
    sensors = np.stack([np.eye(4), T_EGO_SENSOR])
    write(
        folder / "calibration" / "egovehicle_SE3_sensor.feather",
        sensor_name=["ring_front_center", "up_lidar"],
        **poses_as_columns(sensors),
    )
    for name in drop:
        (folder / name).unlink()
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("av2") / "7fab", street_log())


def test_a_log_is_read_in_the_frame_of_its_upper_sensor_in_the_files_order(folder):
    sequence, log = open_sequence(folder.parent), street_log()
    assert (sequence.name, len(sequence), sequence.is_compensated) == ("7fab", 12, True)
    for got, true in zip(sequence, log.scans, strict=True):
        assert_same_points(got, true, atol=0.04)  # half floats have 11 bits: 3 cm at 70 m
    np.testing.assert_allclose(sequence.stamps, log.stamps, atol=1e-6)
    np.testing.assert_allclose(sequence.reference_poses, log.poses, atol=1e-9)
    assert sequence.names == [str(t) for t in log.nanoseconds]


def test_boxes_become_moving_points_with_the_same_id_in_every_scan(folder):
    sequence, log = open_sequence(folder), street_log()
    for i in range(len(sequence)):
        labels = sequence.truth(i)
        assert_same_truth(labels, log.truth[i])
        assert_points_lie_in_their_boxes(sequence, i)
    movers = [set(np.unique(sequence.truth(i)[log.truth[i] == 251] >> 16)) - {0} for i in (0, 11)]
    assert len(movers[0]) >= 3
    assert len(movers[0] & movers[1]) >= 3
    assert max(movers[0]) <= len(OBJECTS)


def test_dynamic_flags_of_the_first_sweep_are_its_truth_and_no_other_has_one(tmp_path):
    log = street_log()
    folder = write_log(tmp_path / "log", log)
    is_moving = log.truth[0] == 251
    write(folder / "flow_labels.feather", dynamic=is_moving)
    sequence = open_sequence(folder)
    np.testing.assert_array_equal(sequence.truth(0) & 0xFFFF, np.where(is_moving, 251, 9))
    assert [sequence.truth(i) for i in range(1, 12)] == [None] * 11
    write(folder / "flow_labels.feather", dynamic=is_moving[:-1])
    with pytest.raises(InputError, match=r"flow_labels.feather holds .* rows, but sweep 15.* has"):
        open_sequence(folder).truth(0)


def test_a_log_without_boxes_or_poses_has_no_truth_and_no_poses(tmp_path):
    folder = write_log(tmp_path / "log", street_log(), ("annotations.feather", "city_SE3_egovehicle.feather"))
    sequence = open_sequence(folder)
    assert sequence.truth(0) is None
    assert sequence.reference_poses is None
    assert len(sequence[0])


def test_a_column_whose_name_is_no_text_is_told(tmp_path):
    folder = write_log(tmp_path / "log", street_log())
    path = folder / "annotations.feather"
    path.write_bytes(path.read_bytes().replace(b"timestamp_ns", b"timestamp_\xff\xff"))
    with pytest.raises(InputError, match=r"annotations.feather is damaged or cut short"):
        open_sequence(folder).truth(0)


def test_rows_without_a_value_are_told(tmp_path):
    folder = write_log(tmp_path / "log", street_log())
    scan = next((folder / "sensors" / "lidar").iterdir())
    table = feather.read_table(scan)
    columns = {name: table[name].to_pylist() for name in table.column_names}
    columns["y"][7] = None
    feather.write_feather(pyarrow.table(columns), scan)
    with pytest.raises(InputError, match=f"{scan.name} has rows without y"):
        [*open_sequence(folder)]


def test_what_is_missing_or_damaged_is_told_with_the_file(tmp_path):
    folder = write_log(tmp_path / "log", street_log())
    scan = next((folder / "sensors" / "lidar").iterdir())
    scan.write_bytes(scan.read_bytes()[:1000])
    with pytest.raises(InputError, match=f"{scan.name} is damaged or cut short"):
        [*open_sequence(folder)]
    (folder / "calibration" / "egovehicle_SE3_sensor.feather").unlink()
    with pytest.raises(InputError, match=r"egovehicle_SE3_sensor.feather is missing"):
        open_sequence(folder)[2]
    (folder / "sensors" / "lidar" / "first.feather").touch()
    with pytest.raises(InputError, match=r"first.feather is not named by its time"):
        open_sequence(folder)


@pytest.mark.parametrize(
    ("file", "columns", "said"),
    [
        ("calibration/egovehicle_SE3_sensor.feather", {"sensor_name": None}, "has no column sensor_name"),
        ("city_SE3_egovehicle.feather", {"qw": None}, "has no column qw"),
        ("city_SE3_egovehicle.feather", {"timestamp_ns": ["x"]}, "timestamp_ns holds something else than numbers"),
        ("annotations.feather", {"length_m": [float("nan")]}, "has a box that is nowhere or has no size"),
        ("annotations.feather", {"track_uuid": [["a", "b"]]}, "has names that are not text"),
        ("annotations.feather", {"length_m": [[1.0]]}, "length_m holds something else than numbers"),
    ],
)
def test_columns_that_are_gone_or_of_another_kind_are_told_with_the_file(tmp_path, file, columns, said):
    folder = write_log(tmp_path / "7fab", street_log())
    table = feather.read_table(folder / file)
    for name, value in columns.items():
        table = table.drop_columns([name])
        if value is not None:
            table = table.append_column(name, pyarrow.array(value * len(table)))
    feather.write_feather(table, folder / file)
    sequence = open_sequence(folder)
    with pytest.raises(InputError, match=said) as told:
        (sequence.reference_poses, sequence.truth(0))
    assert file in str(told.value)


def test_a_column_that_is_there_twice_is_told(tmp_path):
    folder = write_log(tmp_path / "7fab", street_log())
    table = feather.read_table(folder / "annotations.feather")
    feather.write_feather(table.append_column("tx_m", table["ty_m"]), folder / "annotations.feather")
    with pytest.raises(InputError, match=r"annotations.feather has two columns of one name"):
        open_sequence(folder).truth(0)


def test_a_log_without_the_extra_names_the_command_to_install_it(folder, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow.feather", None)
    with pytest.raises(MissingExtraError, match=r"pip install '.*\[arrow\]'"):
        open_sequence(folder)[0]


@pytest.fixture(scope="session")
def av2_sample():
    """Return the root of a log of which two sweeps were published with the Argoverse 2 API."""
    named = os.environ.get("AUTOMOS_RECORDINGS")
    root = Path(named) if named else Path(__file__).resolve().parents[3] / "shared" / "data"
    if not (root / "av2_sample").is_dir():
        pytest.skip(f"{root} holds no av2_sample")
    return root / "av2_sample"


@pytest.mark.recordings
def test_the_published_sample_is_read_with_its_own_dynamic_flags_as_truth(av2_sample):
    sequence = open_sequence(av2_sample)
    assert [len(scan) for scan in sequence] == [99229, 99466]
    flags = feather.read_table(next(av2_sample.glob("*/flow_labels.feather")))["dynamic"].to_numpy()
    np.testing.assert_array_equal((sequence.truth(0) & 0xFFFF) == 251, flags)
    assert sequence.truth(1) is None
    moved = np.load(next(av2_sample.glob("*/ego_motion.npz")))["ego_motion"][0]  # from the first to the second sweep
    calibration = sequence.T_vehicle_sensor
    T_ego1_ego0 = calibration @ inverse(sequence.reference_poses[1]) @ inverse(calibration)
    np.testing.assert_allclose(T_ego1_ego0, moved, atol=2e-3)
    (found,) = check(av2_sample)
    what = "2 scans, Argoverse 2 Sensor log, about 64 beams all round, 10.0 scans a second"
    assert found.first_line == f"{found.name} can be labelled, with 1 doubt: {what}"


@pytest.mark.recordings
def test_boxes_of_the_published_sample_call_no_dynamic_point_static(av2_sample):
    sequence = open_sequence(av2_sample)
    is_dynamic = (sequence.truth(0) & 0xFFFF) == 251
    from_boxes = DrawnTruth.truth(sequence, 0) & 0xFFFF
    assert not (from_boxes[is_dynamic] == 9).any()
    assert (from_boxes[is_dynamic] == 251).mean() > 0.9
    assert (from_boxes[~is_dynamic] == 251).mean() < 0.01  # what moves at another time of the log
