import numpy as np
import pytest

from automos.core.array_sequence import ArraySequence
from automos.core.geometry import make_transform
from automos.core.scan import MIN_RANGE, Frame, Scan


def points(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n, 3)).astype(np.float32)


@pytest.mark.parametrize("shape", [(5, 4), (5,), (3, 5)])
def test_points_of_another_shape_are_refused(shape):
    with pytest.raises(ValueError, match=r"points must be \(N, 3\)"):
        Scan(np.zeros(shape, np.float32))


@pytest.mark.parametrize("column", ["intensity", "time", "ring"])
def test_columns_of_another_length_are_refused(column):
    with pytest.raises(ValueError, match=rf"{column} must be \(5,\), got shape \(4,\)"):
        Scan(points(5), **{column: np.zeros(4)})


def test_points_that_are_no_measurement_are_not_valid():
    rows = [[1, 0, 0], [0, 0, 0], [np.nan, 1, 1], [1, np.inf, 1], [-np.inf, 0, 0], [0, 0, MIN_RANGE / 2], [0, -2, 0]]
    np.testing.assert_array_equal(Scan(np.array(rows, np.float32)).is_valid, [True, *[False] * 5, True])


def test_a_scan_without_points_is_a_scan():
    assert len(Scan(np.zeros((0, 3), np.float32))) == 0
    assert Scan(np.zeros((0, 3), np.float32)).is_valid.shape == (0,)


def test_plain_arrays_become_scans_with_or_without_intensity():
    sequence = ArraySequence([np.arange(6).reshape(2, 3), np.arange(8).reshape(2, 4)])
    assert sequence[0].points.dtype == np.float32
    assert sequence[0].intensity is None
    np.testing.assert_array_equal(sequence[1].points, [[0, 1, 2], [4, 5, 6]])
    np.testing.assert_array_equal(sequence[1].intensity, [3, 7])
    assert sequence.names == ["000000", "000001"]
    assert [len(scan) for scan in sequence] == [2, 2]


@pytest.mark.parametrize("shape", [(3, 2), (4,), (2, 3, 3)])
def test_an_array_that_is_no_scan_is_named_by_its_place(shape):
    with pytest.raises(ValueError, match="scan 1 must be"):
        ArraySequence([np.zeros((2, 3)), np.zeros(shape)])


def test_stamps_are_those_given_or_those_of_all_scans_or_none():
    scans = [Scan(points(4), stamp=0.5), Scan(points(4), stamp=0.7)]
    np.testing.assert_array_equal(ArraySequence(scans).stamps, [0.5, 0.7])
    np.testing.assert_array_equal(ArraySequence(scans, stamps=[1, 2]).stamps, [1.0, 2.0])
    assert ArraySequence([*scans, Scan(points(4))]).stamps is None
    assert ArraySequence([]).stamps is None
    with pytest.raises(ValueError, match=r"stamps must be \(2,\)"):
        ArraySequence(scans, stamps=[1, 2, 3])


def test_scans_keep_their_own_names_where_each_has_another():
    named = [Scan(points(2), name=name) for name in ("000010", "000011")]
    assert ArraySequence(named).names == ["000010", "000011"]
    assert ArraySequence([named[0], named[0]]).names == ["000000", "000001"]
    assert ArraySequence([named[0], Scan(points(2))]).names == ["000000", "000001"]


def changed(column: str) -> ArraySequence:
    """Return the recording below with one number of `column` changed."""
    columns = {"points": points(9), "time": np.linspace(0, 0.1, 9, dtype=np.float32)}
    stamps, is_compensated, cut = np.array([0.0, 0.1]), False, 4
    match column:
        case "points":
            columns["points"][7, 1] += 1e-3
        case "time":
            columns["time"][7] -= 1e-3
        case "stamps":
            stamps[1] = 0.2
        case "is_compensated":
            is_compensated = True
        case "cut":
            cut = 5
    parts = (slice(0, cut), slice(cut, 9))
    scans = [Scan(columns["points"][part], time=columns["time"][part]) for part in parts]
    return ArraySequence(scans, stamps, is_compensated=is_compensated)


@pytest.mark.parametrize("column", ["points", "time", "stamps", "is_compensated", "cut"])
def test_the_fingerprint_changes_with_everything_that_shapes_labels(column):
    assert changed("nothing").fingerprint() == changed("nothing").fingerprint()
    assert changed(column).fingerprint() != changed("nothing").fingerprint()


def test_a_frames_values_return_to_their_places_in_the_users_scan():
    frame = Frame(points(3), np.array([0, 2, 5]), 6, np.eye(4), 0.0)
    np.testing.assert_array_equal(frame.scatter(np.array([7, 8, 9])), [7, 0, 8, 0, 0, 9])
    np.testing.assert_array_equal(frame.scatter(np.array([7, 8, 9]), fill=-1), [7, -1, 8, -1, -1, 9])
    assert frame.scatter(np.ones((3, 2), np.float32)).shape == (6, 2)
    assert frame.scatter(np.array([7, 8, 9], np.int16)).dtype == np.int16


def test_a_frames_points_in_the_level_frame_by_hand():
    T_level_sensor = make_transform([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [10.0, 0.0, 2.0])
    frame = Frame(np.array([[1, 2, 3]], np.float32), np.array([0]), 1, T_level_sensor, 0.0)
    np.testing.assert_allclose(frame.points_level, [[8, 1, 5]])
    np.testing.assert_array_equal(frame.origin_level, [10, 0, 2])


def test_a_point_of_a_merged_cloud_is_a_measurement_by_its_distance_from_its_own_lidar():
    mounts = np.stack([np.eye(4), make_transform(t=[3.0, 0.0, 0.0])])
    cloud = np.array([[3, 0, 0], [3, 0, 0], [0, 0, 0], [0, 0, 0]], np.float32)
    scan = Scan(cloud, sensor=np.array([0, 1, 0, 1], np.uint8), T_scan_sensor=mounts)
    np.testing.assert_array_equal(scan.is_valid, [True, False, False, True])


@pytest.mark.parametrize(
    ("sensor", "mounts", "why"),
    [
        (np.zeros(5, np.uint8), None, "go together"),
        (None, np.eye(4)[None], "go together"),
        (np.full(5, 2, np.uint8), np.stack([np.eye(4)] * 2), "names number 2, but T_scan_sensor holds 2"),
        (np.zeros(5, np.uint8), np.empty((0, 4, 4)), "names number 0, but T_scan_sensor holds 0"),
        (np.zeros(5, np.uint8), np.eye(4), r"must be \(K, 4, 4\)"),
        (np.zeros(4, np.uint8), np.eye(4)[None], r"sensor must be \(5,\)"),
    ],
)
def test_sensors_and_mounts_that_do_not_fit_are_refused(sensor, mounts, why):
    with pytest.raises(ValueError, match=why):
        Scan(points(5), sensor=sensor, T_scan_sensor=mounts)


def test_what_no_sensor_sees_is_not_valid():
    far = [[1e4, 0.0, 0.0], [3e4, 0.0, 0.0], [6e18, 1.0, 1.0], [0.0, -3e38, 0.0], [1.0, np.inf, 0.0]]
    assert Scan(np.array(far, np.float32)).is_valid.tolist() == [True, False, False, False, False]


def test_columns_become_what_they_are_documented_to_be():
    scan = Scan(
        points(3).astype(np.float64)[::-1], time=np.arange(3), ring=[0, 1, 65535], intensity=[True, False, True]
    )
    assert scan.points.flags.c_contiguous
    assert [column.dtype for column in (scan.points, scan.time, scan.ring)] == ["float32", "float32", "uint16"]
    np.testing.assert_array_equal(scan.intensity, [1.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        ("points", None, "points must be real numbers, got object"),
        ("points", np.zeros((5, 3), complex), "points must be real numbers, got complex128"),
        ("points", [[1.0, 2.0, 3.0], [1.0]], "points must be one array of numbers"),
        ("time", ["a"] * 5, "time must be real numbers"),
        ("ring", [0, 1, 2, 3, -1], "ring must be whole numbers that uint16 holds, got -1 to 3"),
        ("ring", [0.5] * 5, "ring must be whole numbers that uint16 holds"),
        ("sensor", [256] * 5, "sensor must be whole numbers that uint8 holds"),
        ("T_scan_sensor", np.full((1, 4, 4), np.nan), "sensor and T_scan_sensor go together"),
        ("stamp", "noon", "stamp seconds, got '' and 'noon'"),
        ("stamp", np.zeros(2), "stamp seconds, got '' and array"),
        ("stamp", np.datetime64("2020"), "stamp seconds, got '' and np.datetime64"),
        ("name", None, "name is a text and its stamp seconds, got None and None"),
    ],
)  # fmt: skip
def test_what_is_no_column_is_told(column, values, message):
    with pytest.raises(ValueError, match=message):
        Scan(**{"points": points(5), column: values})


def test_the_rotations_of_rounded_mounts_are_made_exact():
    T = np.eye(4)
    T[:2, :2] = [[0.71, -0.71], [0.71, 0.71]]  # 45 degrees, to two decimals
    mount = Scan(points(5), sensor=np.zeros(5), T_scan_sensor=T[None]).T_scan_sensor[0]
    np.testing.assert_allclose(mount[:3, :3] @ mount[:3, :3].T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(mount[:2, :2], T[:2, :2], atol=0.004)


def test_mounts_that_are_no_transforms_are_told():
    with pytest.raises(ValueError, match="T_scan_sensor holds a transform that is none"):
        Scan(points(5), sensor=np.zeros(5), T_scan_sensor=np.full((1, 4, 4), np.nan))


def test_names_that_no_file_can_have_do_not_become_names_of_results():
    assert ArraySequence([Scan(points(4), name="../a"), Scan(points(4), name="b")]).names == ["000000", "000001"]
    assert ArraySequence([Scan(points(4), name="a"), Scan(points(4), name="b")]).names == ["a", "b"]
