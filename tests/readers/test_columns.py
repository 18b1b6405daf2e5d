from pathlib import Path

import numpy as np
import pytest

from automos.readers import open_sequence
from automos.readers.columns import find_time_unit, time_column, to_scan

XYZ = {axis: np.arange(4, dtype=np.float32) for axis in "xyz"}


@pytest.mark.parametrize(
    "times",
    [
        pytest.param(np.array([0.0, 0.05, 0.1, 0.025], np.float32), id="seconds from the first point"),
        pytest.param(np.array([-0.1, -0.05, 0.0, -0.075], np.float32), id="seconds before the last point"),
        pytest.param(1.7e9 + np.array([0.0, 0.05, 0.1, 0.025]), id="seconds since 1970"),
        pytest.param(np.array([0.0, 50.0, 100.0, 25.0], np.float32), id="milliseconds"),
        pytest.param(np.array([0, 50_000, 100_000, 25_000], np.uint32), id="microseconds"),
        pytest.param(np.array([0, 50_000_000, 100_000_000, 25_000_000], np.uint32), id="nanoseconds"),
        pytest.param(
            np.array([0, 50, 100, 25], np.uint64) * 10**6 + 1_700_000_000 * 10**9, id="ns since 1970, integer"
        ),
        pytest.param(1.7e18 + np.array([0.0, 5e7, 1e8, 2.5e7]), id="ns since 1970, float"),
    ],
)
@pytest.mark.parametrize("name", ["t", "time", "timestamp", "offset_time", "Timestamp", "t_ns", "Time_us"])
def test_times_of_any_unit_and_origin_become_seconds_after_the_first_point(times, name):
    scan = to_scan({**XYZ, name: times}, Path("a.pcd"))
    # float64 nanoseconds since 1970 are whole multiples of 256 ns
    np.testing.assert_allclose(scan.time, [0.0, 0.05, 0.1, 0.025], atol=3e-7)


@pytest.mark.parametrize("span", [0.003, 0.05, 0.1, 0.2, 1.0, 2.0])
def test_the_unit_of_time_is_found_for_every_sweep_of_a_sensor(span):
    for unit in (1.0, 1e-3, 1e-6, 1e-9):
        assert find_time_unit(np.array([0.0, span * 0.999 / unit])) == unit


def test_times_that_never_change_are_no_times():
    assert to_scan({**XYZ, "t": np.zeros(4)}, Path("a")).time is None
    assert to_scan({**XYZ, "t": np.zeros(4), "timestamp": np.arange(4) * 0.01}, Path("a")).time is not None


def test_points_without_a_time_get_that_of_the_first_point():
    times = np.array([np.nan, 10.0, 10.1, 10.05])
    np.testing.assert_allclose(to_scan({**XYZ, "time": times}, Path("a")).time, [0.0, 0.0, 0.1, 0.05], atol=1e-6)


@pytest.mark.parametrize("name", ["intensity", "i", "I", "reflectivity", "scalar_Intensity", "Remission"])
def test_intensity_goes_by_many_names(name):
    np.testing.assert_array_equal(to_scan({**XYZ, name: np.arange(4)}, Path("a")).intensity, [0, 1, 2, 3])


def test_intensity_goes_before_reflectivity():
    scan = to_scan({**XYZ, "reflectivity": np.zeros(4), "intensity": np.ones(4)}, Path("a"))
    np.testing.assert_array_equal(scan.intensity, [1, 1, 1, 1])


@pytest.mark.parametrize("name", ["ring", "line", "channel"])
@pytest.mark.parametrize("dtype", [np.uint8, np.int32, np.float32])
def test_rings_are_beam_numbers_of_any_type(name, dtype):
    ring = to_scan({**XYZ, name: np.array([3, 0, 63, 31], dtype)}, Path("a")).ring
    assert ring.dtype == np.uint16
    np.testing.assert_array_equal(ring, [3, 0, 63, 31])


@pytest.mark.parametrize("values", [[0.5, 1, 2, 3], [-1, 0, 1, 2], [np.nan, 0, 1, 2], [0, 1, 2, 70000]])
def test_a_ring_that_is_no_beam_number_is_no_ring(values):
    assert to_scan({**XYZ, "ring": np.array(values)}, Path("a")).ring is None


@pytest.mark.parametrize("kind", ["i1", "i2", ">i4"])
def test_times_of_either_sign_span_more_than_their_type_holds(kind):
    most = np.iinfo(kind).max
    times = np.linspace(-most, most, 100).astype(kind)
    column = time_column({"t": times})
    assert int(column.max()) - int(column.min()) == column.max() - column.min() == 2 * most


def test_dates_and_texts_beside_the_points_are_passed_over(tmp_path):
    kinds = [
        ("x", "f4"),
        ("y", "f4"),
        ("z", "f4"),
        ("timestamp", "M8[us]"),
        ("ring", "U4"),
        ("sensor", "U4"),
        ("time_stamp", "f4"),
    ]
    rows = np.ones(50, kinds)
    rows["time_stamp"], rows["ring"] = np.linspace(0.0, 0.1, 50), "a"
    for i in range(2):
        np.save(tmp_path / f"{i}.npy", rows)
    scan = open_sequence(tmp_path)[1]
    np.testing.assert_array_equal(scan.time, rows["time_stamp"])
    assert scan.ring is None
