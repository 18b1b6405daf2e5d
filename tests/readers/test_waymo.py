"""Segments in the published layout, written by pyarrow: a street as a LiDAR sees it that turns on a moving vehicle."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from street_log import OBJECTS, assert_points_lie_in_their_boxes, assert_same_truth
from worlds import ROADSIDE, TRAFFIC, cast

from automos.core.errors import InputError, MissingExtraError
from automos.core.geometry import inverse, make_transform, transform
from automos.readers import find_recordings, open_sequence

arrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")

SEGMENT = "10023947602400723454_1120_000_1140_000"
START = 1_550_000_000_000_000
HEIGHT, WIDTH, N = 16, 240, 8
BLOCKS = (*ROADSIDE, *TRAFFIC)
ELEVATION = np.radians(np.linspace(-18.0, 3.0, HEIGHT))  # as in the table, from the bottom up
T_VEHICLE_LASER = make_transform(Rotation.from_euler("zyx", [2.6, 0.01, -0.005]).as_matrix(), [1.43, 0.05, 1.9])
ORIGIN_OF_MAP = make_transform(Rotation.from_euler("zyx", [0.7, 0.01, 0.02]).as_matrix(), [320.0, -150.0, 25.0])


def vehicle_at(seconds):
    """Return T_ground_vehicle of a drive at 4 m/s in a curve."""
    yaw = 0.2 * seconds
    return make_transform(Rotation.from_euler("z", yaw).as_matrix(), [4.0 * seconds, 0.4 * seconds**2, 0.0])


def range_image(frame):
    """Return what the laser sees in a turn: ranges, pixel poses (H, W, 6), and the block that each pixel hit."""
    distance, pose = np.zeros((HEIGHT, WIDTH)), np.zeros((HEIGHT, WIDTH, 6))
    hit = np.zeros((HEIGHT, WIDTH), int)
    turned = np.arctan2(T_VEHICLE_LASER[1, 0], T_VEHICLE_LASER[0, 0])
    for column in range(WIDTH):
        T_ground_vehicle = vehicle_at(0.1 * (frame + column / WIDTH))
        azimuth = np.pi - 2.0 * np.pi * (column + 0.5) / WIDTH - turned
        e = ELEVATION[::-1]
        rays = np.stack([np.cos(e) * np.cos(azimuth), np.cos(e) * np.sin(azimuth), np.sin(e)], axis=1)
        T = T_ground_vehicle @ T_VEHICLE_LASER
        found, hit[:, column] = cast(BLOCKS, T[:3, 3], rays @ T[:3, :3].T, 0.1 * frame)
        distance[:, column] = np.where(found < 75.0, found, -1.0)
        T_world_vehicle = ORIGIN_OF_MAP @ T_ground_vehicle
        angles = Rotation.from_matrix(T_world_vehicle[:3, :3]).as_euler("xyz")
        pose[:, column] = [*angles, *T_world_vehicle[:3, 3]]
    return distance, pose, hit


def write_table(root, component, columns):
    (root / component).mkdir(parents=True, exist_ok=True)
    path = root / component / f"{SEGMENT}.parquet"
    parquet.write_table(arrow.table(columns), path, row_group_size=7, compression="brotli")
    return path


def images(name, arrays):
    return {
        f"{name}.values": arrow.array([a.astype("f4").ravel() for a in arrays], arrow.list_(arrow.float32())),
        f"{name}.shape": arrow.array([list(a.shape) for a in arrays], arrow.list_(arrow.int32(), 3)),
    }


def transforms(poses):
    return arrow.array([np.ravel(T) for T in poses], arrow.list_(arrow.float64(), 16))


def write_segment(root, boxes=True):
    """Write the tables; return per frame the ranges of both returns, the pixel poses and the blocks hit."""
    micros = START + 100_000 * np.arange(N)
    seen, rows = [], {"micros": [], "laser": [], "first": [], "second": []}
    for frame in range(N):
        distance, pose, hit = range_image(frame)
        behind = np.where((np.arange(WIDTH) % 5 == 0) & (distance > 0), distance + 3.0, -1.0)
        zone = np.where(np.arange(WIDTH) < 20, 1.0, -1.0) * np.ones((HEIGHT, 1))
        pixels = [np.stack([d, np.full(d.shape, 0.25), np.zeros(d.shape), zone], axis=-1) for d in (distance, behind)]
        seen.append((distance, behind, pose, hit))
        for laser in (1, 2, 3):  # top, and two of the four that look near
            rows["micros"].append(micros[frame])
            rows["laser"].append(laser)
            rows["first"].append(pixels[0] if laser == 1 else np.ones((4, 6, 4)))
            rows["second"].append(pixels[1] if laser == 1 else np.ones((4, 6, 4)))
    keys = {"key.frame_timestamp_micros": np.array(rows["micros"]), "key.laser_name": np.array(rows["laser"], "i1")}
    name = "[LiDARComponent].range_image_return"
    write_table(root, "lidar", keys | images(f"{name}1", rows["first"]) | images(f"{name}2", rows["second"]))
    keys = {"key.frame_timestamp_micros": micros, "key.laser_name": np.ones(N, "i1")}
    poses = images("[LiDARPoseComponent].range_image_return1", [pose for _, _, pose, _ in seen])
    write_table(root, "lidar_pose", keys | poses)
    T_world_vehicle = [ORIGIN_OF_MAP @ vehicle_at(0.1 * frame) for frame in range(N)]
    vehicle = {"[VehiclePoseComponent].world_from_vehicle.transform": transforms(T_world_vehicle)}
    write_table(root, "vehicle_pose", {"key.frame_timestamp_micros": micros} | vehicle)
    calibration = {
        "key.laser_name": np.array([2, 1], "i1"),
        "[LiDARCalibrationComponent].extrinsic.transform": transforms([np.eye(4), T_VEHICLE_LASER]),
        "[LiDARCalibrationComponent].beam_inclination.min": [-1.5, ELEVATION[0]],
        "[LiDARCalibrationComponent].beam_inclination.max": [0.5, ELEVATION[-1]],
        "[LiDARCalibrationComponent].beam_inclination.values": [None, ELEVATION],
    }
    write_table(root, "lidar_calibration", calibration)
    if boxes:
        write_table(root, "lidar_box", box_columns(micros))
    return seen


def box_columns(micros):
    """Return a row for each object in each frame, in the vehicle's frame at that time."""
    rows = []
    for frame, time in enumerate(micros):
        T_vehicle_ground = inverse(vehicle_at(0.1 * frame))
        turn = np.arctan2(T_vehicle_ground[1, 0], T_vehicle_ground[0, 0])
        for k, block in enumerate(OBJECTS):
            center = np.array([np.array(block.center) + 0.1 * frame * np.array(block.velocity)])
            rows.append(
                (
                    time,
                    f"object_{k}",
                    *transform(T_vehicle_ground, center)[0],
                    *np.add(block.size, 0.1),
                    block.yaw + turn,
                )
            )
    named = dict(
        zip(("time", "id", "cx", "cy", "cz", "sx", "sy", "sz", "heading"), zip(*rows, strict=True), strict=True)
    )
    columns = {"key.frame_timestamp_micros": np.array(named["time"]), "key.laser_object_id": list(named["id"])}
    for part, of in (("center", "c"), ("size", "s")):
        columns |= {f"[LiDARBoxComponent].box.{part}.{axis}": np.array(named[of + axis]) for axis in "xyz"}
    return columns | {"[LiDARBoxComponent].box.heading": np.array(named["heading"])}


@pytest.fixture(scope="module")
def segment(tmp_path_factory):
    """Return the path of a segment and what was written into it."""
    root = tmp_path_factory.mktemp("waymo")
    return root / "training" / SEGMENT, write_segment(root / "training")


def test_segments_are_found_from_their_split_or_root(segment):
    path, _ = segment
    assert find_recordings(path.parent) == find_recordings(path.parent.parent) == find_recordings(path) == [path]
    assert find_recordings(path.parent.parent, "waymo") == [path]
    sequence = open_sequence(path)
    assert (sequence.name, len(sequence), sequence.is_compensated) == (SEGMENT, N, True)
    assert sequence.names[1] == str(START + 100_000)
    np.testing.assert_allclose(sequence.stamps, 1e-6 * START + 0.1 * np.arange(N), atol=1e-6)


def test_pixels_keep_their_place_and_lie_where_the_ray_ended_at_the_frames_time(segment):
    path, seen = segment
    for frame, (scan, (first, second, _, _)) in enumerate(zip(open_sequence(path), seen, strict=True)):
        assert len(scan) == 2 * HEIGHT * WIDTH
        distance = np.concatenate([first.ravel(), second.ravel()])
        np.testing.assert_array_equal(scan.is_valid, distance > 0)
        np.testing.assert_array_equal(scan.ring.reshape(2, HEIGHT, WIDTH)[:, :, 7], [np.arange(HEIGHT)] * 2)
        np.testing.assert_array_equal(scan.intensity, np.float32(0.25))
        points = scan.points.reshape(2, HEIGHT, WIDTH, 3)
        T_sensor_vehicle = make_transform(t=-T_VEHICLE_LASER[:3, 3])
        for image, row, column in ((0, 3, 0), (0, 14, 120), (0, 15, 239), (1, 12, 60), (1, 15, 235)):
            r = (first, second)[image][row, column]
            azimuth = np.pi - 2.0 * np.pi * (column + 0.5) / WIDTH - np.arctan2(*T_VEHICLE_LASER[1::-1, 0])
            e = ELEVATION[::-1][row]
            end = r * np.array([[np.cos(e) * np.cos(azimuth), np.cos(e) * np.sin(azimuth), np.sin(e)]])
            T_ground_laser = vehicle_at(0.1 * (frame + column / WIDTH)) @ T_VEHICLE_LASER
            T = T_sensor_vehicle @ inverse(vehicle_at(0.1 * frame)) @ T_ground_laser
            expected = transform(T, end)[0] if r > 0 else np.zeros(3)
            # single precision of poses 350 m from the map's origin
            np.testing.assert_allclose(points[image, row, column], expected, atol=2e-3)


def test_the_ground_is_flat_though_the_vehicle_moved_while_it_looked(segment):
    path, seen = segment
    first, _, _, hit = seen[3]
    is_ground = (hit == -1) & (first > 0)
    points = open_sequence(path)[3].points.reshape(2, HEIGHT, WIDTH, 3)[0]
    assert is_ground.sum() > 500
    np.testing.assert_allclose(points[is_ground, 2], -T_VEHICLE_LASER[2, 3], atol=1e-4)


def test_reference_poses_are_of_the_scans_frame(segment):
    path, _ = segment
    T_vehicle_sensor = make_transform(t=T_VEHICLE_LASER[:3, 3])
    T = np.stack([vehicle_at(0.1 * frame) @ T_vehicle_sensor for frame in range(N)])
    np.testing.assert_allclose(open_sequence(path).reference_poses, inverse(T[0]) @ T, atol=1e-6)


def test_boxes_are_truth_but_in_zones_that_nobody_labelled(segment):
    path, seen = segment
    sequence = open_sequence(path)
    moves = np.array([any(block.velocity) for block in BLOCKS] + [False])  # the last entry is the ground
    for frame, (_, _, _, hit) in enumerate(seen):
        labels = sequence.truth(frame).reshape(2, HEIGHT, WIDTH)
        assert not labels[:, :, :20].any()
        first = labels[0, :, 20:].ravel()
        is_return = sequence[frame].is_valid[: HEIGHT * WIDTH].reshape(HEIGHT, WIDTH)[:, 20:].ravel()
        true = np.where(moves[hit], 251, 9)[:, 20:].ravel()[is_return]
        assert_same_truth(first[is_return], true, least_told=0.6)
        assert_points_lie_in_their_boxes(sequence, frame)


def test_rows_are_the_same_in_any_order_in_threads_and_in_other_processes(segment):
    path, _ = segment
    sequence = open_sequence(path)
    in_order = [scan.points for scan in sequence]
    copy = pickle.loads(pickle.dumps(sequence))
    for index in (5, 0, 7, 2, 2, 3, -1):
        np.testing.assert_array_equal(copy[index].points, in_order[index])
    with ThreadPoolExecutor(2) as pool:
        for got, points in zip(pool.map(copy.__getitem__, range(N)), in_order, strict=True):
            np.testing.assert_array_equal(got.points, points)
    assert copy.fingerprint() == sequence.fingerprint()


def test_a_segment_without_boxes_has_no_truth(tmp_path):
    write_segment(tmp_path / "testing", boxes=False)
    assert open_sequence(tmp_path / "testing").truth(0) is None


def test_what_is_missing_or_damaged_is_told_with_its_file(tmp_path):
    write_segment(tmp_path)
    path = tmp_path / SEGMENT
    table = tmp_path / "lidar_pose" / f"{SEGMENT}.parquet"
    whole = table.read_bytes()
    table.write_bytes(whole[:-100])
    with pytest.raises(InputError, match=r"lidar_pose/.*parquet is damaged or of another layout .*; download it again"):
        open_sequence(path)
    table.unlink()
    with pytest.raises(InputError, match=r"lidar_pose/.*parquet is missing; the recording needs it: download it too"):
        open_sequence(path)
    rows = parquet.read_table(tmp_path / "vehicle_pose" / f"{SEGMENT}.parquet")
    table.write_bytes(whole)
    write_table(tmp_path, "vehicle_pose", rows.slice(0, N - 1).to_pydict())
    with pytest.raises(InputError, match=rf"vehicle_pose/.* has no row for the scan of {START + 700_000}"):
        open_sequence(path)
    lidar = parquet.read_table(tmp_path / "lidar" / f"{SEGMENT}.parquet")
    write_table(tmp_path, "vehicle_pose", rows.to_pydict())
    write_table(tmp_path, "lidar", {name: lidar[name] for name in lidar.column_names[:2]})
    with pytest.raises(InputError, match=r"lidar/.*parquet is damaged or of another layout|has no column"):
        open_sequence(path)[0]


def test_boxes_of_objects_that_are_named_by_lists_are_told_with_their_file(tmp_path):
    write_segment(tmp_path)
    boxes = parquet.read_table(tmp_path / "lidar_box" / f"{SEGMENT}.parquet").to_pydict()
    names = boxes["key.laser_object_id"]
    write_table(
        tmp_path, "lidar_box", {**boxes, "key.laser_object_id": [[name] * (k % 3) for k, name in enumerate(names)]}
    )
    with pytest.raises(InputError, match=r"lidar_box/.*parquet is damaged"):
        open_sequence(tmp_path / SEGMENT).truth(0)


def test_without_the_extra_the_command_to_install_it_is_named(segment, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow.parquet", None)
    with pytest.raises(MissingExtraError, match=r"pip install '.*\[arrow\]'"):
        open_sequence(segment[0])
