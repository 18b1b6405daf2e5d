"""Data sets in the layouts in which they are published: points, times and poses are those of the street."""

import gzip
import json
import pickle

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from street_log import street_log
from test_nuscenes import write_tables

from automos.core.errors import InputError
from automos.core.geometry import inverse, make_transform, transform
from automos.readers import find_recordings, kind_of, nuscenes, open_sequence

FAR = make_transform(Rotation.from_euler("z", 0.4).as_matrix(), [4.6e5, 5.4e6, 170.0])
"""Where the street lies on the Earth."""


def assert_same_street(sequence, log, tolerance=1e-4):
    assert len(sequence) == len(log.scans)
    np.testing.assert_allclose(sequence.stamps, log.stamps, atol=1e-5)
    np.testing.assert_allclose(sequence.reference_poses, log.poses, atol=2e-4)
    for got, true in zip(sequence, log.scans, strict=True):
        np.testing.assert_allclose(got.points, true.points, atol=tolerance)
        np.testing.assert_allclose(got.intensity, true.intensity)


# ------------------------------------------------------------------------------------------------------- Boreas
def write_boreas(folder, log):
    (folder / "lidar").mkdir(parents=True)
    (folder / "applanix").mkdir()
    rows = ["GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading,angvel_z,angvel_y,angvel_x"]
    for scan, T in zip(log.scans, FAR @ log.T_ground_sensor, strict=True):
        micros = round(1e6 * scan.stamp)
        cloud = np.column_stack([scan.points, scan.intensity, scan.ring, scan.time])
        cloud.astype("<f4").tofile(folder / "lidar" / f"{micros}.bin")
        # their rotations are those to the sensor: x, y, z after each other, each turning the frame
        roll, pitch, heading = Rotation.from_matrix(T[:3, :3].T).as_euler("xyz")
        numbers = (*T[:3, 3], 0, 0, 0, roll, pitch, heading, 0, 0, 0)
        rows.append(f"{micros}," + ",".join(f"{value:.9f}" for value in numbers))
    (folder / "applanix" / "lidar_poses.csv").write_text("\n".join(rows) + "\n")
    return folder


def test_a_drive_of_boreas(tmp_path):
    log = street_log()
    write_boreas(tmp_path / "boreas-2020-11-26-13-58", log)
    assert kind_of(tmp_path) == "Boreas"
    sequence = open_sequence(tmp_path)
    assert_same_street(sequence, log)
    np.testing.assert_array_equal(sequence[3].ring, log.scans[3].ring)
    np.testing.assert_allclose(sequence[3].time, log.scans[3].time - log.scans[3].time.min(), atol=1e-6)


# ---------------------------------------------------------------------------------------------------- KITTI-360
T_VELO_CAMERA = make_transform(Rotation.from_euler("xyz", [90, 1, 89], degrees=True).as_matrix(), [0.77, 0.27, -0.82])
T_POSE_CAMERA = make_transform(Rotation.from_euler("xyz", [3, 88, -2], degrees=True).as_matrix(), [1.57, 0.0, 0.3])


def times_of(log, divider):
    return "\n".join(str(np.datetime64(int(n), "ns")).replace("T", divider) for n in log.nanoseconds) + "\n"


def row(T):
    return " ".join(f"{value:.12g}" for value in T[:3].ravel())


def test_a_drive_of_kitti_360_whose_poses_are_of_some_frames(tmp_path):
    log, name = street_log(), "2013_05_28_drive_0000_sync"
    drive = tmp_path / "data_3d_raw" / name
    (drive / "velodyne_points" / "data").mkdir(parents=True)
    for k, scan in enumerate(log.scans):
        cloud = np.column_stack([scan.points, scan.intensity]).astype("<f4")
        cloud.tofile(drive / "velodyne_points" / "data" / f"{k:010d}.bin")
    (drive / "velodyne_points" / "timestamps.txt").write_text(times_of(log, " "))
    (tmp_path / "calibration").mkdir()
    (tmp_path / "calibration" / "calib_cam_to_velo.txt").write_text(row(T_VELO_CAMERA) + "\n")
    pose_lines = [f"image_0{k}: {row(T_POSE_CAMERA if k == 0 else np.eye(4))}" for k in range(4)]
    (tmp_path / "calibration" / "calib_cam_to_pose.txt").write_text("\n".join(pose_lines) + "\n")
    (tmp_path / "data_poses" / name).mkdir(parents=True)
    T = FAR @ log.T_ground_sensor @ T_VELO_CAMERA @ inverse(T_POSE_CAMERA)
    kept = [0, 1, 2, 3, 5, 6, 7, 8, 10, 11]  # where the car hardly moved, none was published
    (tmp_path / "data_poses" / name / "poses.txt").write_text("\n".join(f"{k} {row(T[k])}" for k in kept) + "\n")
    assert find_recordings(tmp_path) == [drive]
    sequence = open_sequence(tmp_path)
    np.testing.assert_allclose(sequence.reference_poses[kept], log.poses[kept], atol=1e-3)
    np.testing.assert_allclose(sequence.reference_poses, log.poses, atol=0.02)
    np.testing.assert_allclose(sequence.stamps, log.stamps, atol=1e-6)
    assert sequence.is_compensated is False
    np.testing.assert_array_equal(sequence[4].points, log.scans[4].points)


# ----------------------------------------------------------------------------------------------------------- VBR
def write_truth(path, log):
    turns = Rotation.from_matrix(log.T_ground_sensor[:, :3, :3]).as_quat()
    rows = np.column_stack([log.stamps, log.T_ground_sensor[:, :3, 3], turns])
    np.savetxt(path, rows, fmt="%.9f", header="timestamp tx ty tz qx qy qz qw")


def test_a_drive_of_vbr_as_its_converter_writes_it(tmp_path):
    log = street_log()
    drive = tmp_path / "campus_train0_00_kitti"
    (drive / "ouster_points" / "data").mkdir(parents=True)
    for k, scan in enumerate(log.scans):
        cloud = np.column_stack([scan.points, scan.intensity]).astype("<f4")
        cloud.tofile(drive / "ouster_points" / "data" / f"{k:010d}.bin")
    (drive / "ouster_points" / "timestamps.txt").write_text(times_of(log, "T"))
    write_truth(drive / "campus_train0_gt.txt", log)
    assert_same_street(open_sequence(tmp_path), log)


def test_bags_of_vbr_have_the_poses_beside_them(tmp_path):
    pytest.importorskip("rosbags")
    from bags import cloud, write_bag

    log = street_log()
    clouds = [
        (
            round(1e9 * stamp),
            stamp,
            cloud({**dict(zip("xyz", scan.points.T, strict=True)), "intensity": scan.intensity}),
        )
        for stamp, scan in zip(log.stamps, log.scans, strict=True)
    ]
    write_bag(tmp_path / "campus_train0_00.bag", {"/ouster/points": clouds})
    write_truth(tmp_path / "campus_train0_gt.txt", log)
    np.testing.assert_allclose(open_sequence(tmp_path / "campus_train0_00.bag").reference_poses, log.poses, atol=1e-4)
    (tmp_path / "campus_train0_gt.txt").rename(tmp_path / "campus_train1_gt.txt")
    assert open_sequence(tmp_path / "campus_train0_00.bag").reference_poses is None


# ------------------------------------------------------------------------------------------------------- PandaSet
class Index:
    pass


class DataFrame:
    pass


class BlockManager:
    def __init__(self, *parts):
        self.parts = parts

    def __reduce__(self):  # as since version 1.3
        return BlockManager, self.parts


class OldManager:
    def __getstate__(self):
        return ([], [], [], {"0.14.1": {"axes": self.axes, "blocks": self.blocks}})


class Block:
    def __init__(self, *parts):
        self.parts = parts

    def __reduce__(self):
        return _unpickle_block, (*self.parts, 2)


class Names:
    def __init__(self, names):
        self.names = names

    def __reduce__(self):
        return _new_Index, (Index, {"data": np.array(self.names, object), "name": None})


def _new_Index(cls, d):
    raise AssertionError("it is not run")


def _unpickle_block(values, place, ndim):
    raise AssertionError("it is not run")


HOMES = {
    "DataFrame": b"pandas.core.frame\nDataFrame", "Index": b"pandas.core.indexes.base\nIndex",
    "_new_Index": b"pandas.core.indexes.base\n_new_Index",
    "_unpickle_block": b"pandas._libs.internals\n_unpickle_block",
    "BlockManager": b"pandas.core.internals.managers\nBlockManager",
    "OldManager": b"pandas.core.internals.managers\nBlockManager",
}  # fmt: skip


def as_pandas_pickles(numbers, is_old):
    """Return the bytes that pandas makes of a table of float columns and one of whole numbers, `d`."""
    axes = [Names([*numbers]), Names(["rows"])]
    floats = np.stack([column for name, column in numbers.items() if name != "d"])
    pieces = [(floats, slice(0, len(floats), 1)), (numbers["d"][None], slice(len(floats), len(floats) + 1, 1))]
    table = DataFrame()
    if is_old:
        manager = OldManager()
        manager.axes, manager.blocks = axes, [{"values": v, "mgr_locs": at} for v, at in pieces]
        table.__dict__ = {"_data": manager, "_typ": "dataframe"}
    else:
        table.__dict__ = {"_mgr": BlockManager(tuple(Block(*piece) for piece in pieces), axes), "_typ": "dataframe"}
    raw = pickle.dumps(table, protocol=3)
    for name, home in HOMES.items():
        raw = raw.replace(f"c{__name__}\n{name}\n".encode(), b"c" + home + b"\n")
    return raw


def write_pandaset(folder, log, is_old=True):
    (folder / "lidar").mkdir(parents=True)
    poses = []
    for k, (scan, T) in enumerate(zip(log.scans, FAR @ log.T_ground_sensor, strict=True)):
        there = transform(T, scan.points.astype(float))
        numbers = {**dict(zip("xyz", there.T, strict=True)), "i": scan.intensity.astype(float)}
        numbers |= {"t": scan.stamp + scan.time.astype(float), "d": np.zeros(len(scan), np.int64)}
        both = {name: np.concatenate([column, column[:50]]) for name, column in numbers.items()}
        both["d"][len(scan) :] = 1  # of the other LiDAR
        (folder / "lidar" / f"{k:02d}.pkl.gz").write_bytes(gzip.compress(as_pandas_pickles(both, is_old), 1))
        x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
        poses.append({"position": dict(zip("xyz", T[:3, 3], strict=True)), "heading": {"w": w, "x": x, "y": y, "z": z}})
    (folder / "lidar" / "poses.json").write_text(json.dumps(poses))
    (folder / "lidar" / "timestamps.json").write_text(json.dumps(log.stamps.tolist()))
    return folder


@pytest.mark.parametrize("name", ["poses.json", "timestamps.json"])
def test_a_drive_of_pandaset_without_its_poses_or_times_is_told_which_file_it_lacks(tmp_path, name):
    (write_pandaset(tmp_path / "001", street_log()) / "lidar" / name).unlink()
    with pytest.raises(InputError, match=rf"001/lidar/{name} cannot be read: No such file"):
        open_sequence(tmp_path / "001")


@pytest.mark.parametrize("is_old", [True, False])
def test_a_drive_of_pandaset_is_taken_back_into_the_frame_of_its_sensor(tmp_path, is_old):
    log = street_log()
    write_pandaset(tmp_path / "001", log, is_old)
    sequence = open_sequence(tmp_path)
    assert_same_street(sequence, log, tolerance=1e-3)
    assert sequence.is_compensated
    np.testing.assert_allclose(sequence[2].time, log.scans[2].time - log.scans[2].time.min(), atol=1e-5)


class Stranger:
    def __reduce__(self):
        return (print, ("this would have run",))


def test_nothing_in_a_pickle_is_run(tmp_path, capsys):
    write_pandaset(tmp_path / "001", street_log())
    for stranger in (Stranger(), {"x": Stranger()}, b"no pickle"):
        content = stranger if isinstance(stranger, bytes) else pickle.dumps(stranger)
        (tmp_path / "001" / "lidar" / "00.pkl.gz").write_bytes(gzip.compress(content))
        with pytest.raises(InputError, match=r"00.pkl.gz is no table of points of PandaSet \(.*\); download it again"):
            open_sequence(tmp_path)[0]
    assert capsys.readouterr().out == ""


def test_a_drive_of_pandaset_without_some_of_its_poses_is_told(tmp_path):
    poses = write_pandaset(tmp_path / "001", street_log()) / "lidar" / "poses.json"
    poses.write_text(json.dumps(json.loads(poses.read_text())[:-1]))
    with pytest.raises(InputError, match="holds 12 scans, 12 times and 11 poses"):
        open_sequence(tmp_path)
    poses.write_text('[{"position": {"x": 0}}]')
    with pytest.raises(InputError, match="holds damaged poses or times"):
        open_sequence(tmp_path)


# ----------------------------------------------------------------------------------------------------- TruckScenes
def test_each_of_the_six_lidars_of_truckscenes_is_a_recording(tmp_path):
    from point_writers import write_pcd

    log = street_log()
    root = write_tables(tmp_path, log, version="v1.0-mini")
    tables = root / "v1.0-mini"

    def rewritten(name, change):
        rows = json.loads((tables / f"{name}.json").read_text())
        (tables / f"{name}.json").write_text(json.dumps(change(rows)))

    rewritten("sensor", lambda rows: [{**r, "channel": "LIDAR_LEFT"} if "LIDAR" in r["channel"] else r for r in rows]
              + [{"token": "s-rear", "channel": "LIDAR_REAR", "modality": "lidar"}])  # fmt: skip

    def as_pcd(rows):
        for each in rows:
            if each["calibrated_sensor_token"] == "c-lidar":
                scan = next(s for s in log.scans if round(1e6 * s.stamp) == each["timestamp"])
                each["filename"] = each["filename"].replace(".pcd.bin", ".pcd").replace("LIDAR_TOP/", "LIDAR_LEFT/")
                (root / each["filename"]).parent.mkdir(parents=True, exist_ok=True)
                micros = (round(1e6 * scan.stamp) + 1e6 * scan.time.astype(float)).astype("u8")
                columns = {**dict(zip("xyz", scan.points.T, strict=True)), "intensity": scan.intensity.astype("f4")}
                write_pcd(root / each["filename"], {**columns, "timestamp": micros})
        return rows

    rewritten("sample_data", as_pcd)
    nuscenes._read.cache_clear()
    assert [path.parts[-2:] for path in find_recordings(tmp_path)] == [
        ("scene-0061", "LIDAR_LEFT"), ("scene-0061", "LIDAR_REAR")]  # fmt: skip
    sequence = open_sequence(tables / "scene-0061" / "LIDAR_LEFT")
    assert sequence.name == "scene-0061_LIDAR_LEFT"
    assert_same_street(sequence, log)
    assert sequence.truth(0) is not None
    np.testing.assert_allclose(sequence[2].time, log.scans[2].time, atol=2e-6)
    with pytest.raises(InputError, match="has no sweeps of the LIDAR_REAR"):
        open_sequence(tables / "scene-0061" / "LIDAR_REAR")
