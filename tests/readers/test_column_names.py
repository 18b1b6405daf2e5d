"""What columns of points are called, and the units in their names."""

import time
from pathlib import Path

import numpy as np
import pytest

from automos.core.errors import InputError
from automos.readers.column_names import by_plain_names, called, plain_names
from automos.readers.columns import to_scan


@pytest.mark.parametrize("spelled", ["x [{}]", "X({})", "x_{}", "Points_{}_XYZ:0", "pos_x ({})"])
@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("km", 1000.0)])
def test_a_unit_in_the_name_of_a_coordinate_is_obeyed_however_near_the_points_are(spelled, unit, metres):
    name = spelled.format(unit)
    others = [
        name.replace(":0", f":{k}").replace("x", axis).replace("X(", f"{axis}(") for k, axis in ((1, "y"), (2, "z"))
    ]
    counts = np.array([100, 200, 300])
    found = by_plain_names(dict.fromkeys((name, *others), counts), Path("a.csv"))
    assert sorted(found) == ["x", "y", "z"]
    for axis in "xyz":
        np.testing.assert_allclose(found[axis], metres * counts)


def test_what_stands_before_all_axes_is_left_out_before_the_others():
    assert plain_names(["lidar_x", "lidar_y", "lidar_z", "lidar_ring", "pose"]) == ["x", "y", "z", "ring", "pose"]
    assert plain_names(["x", "y", "z", "nx", "ny", "nz"]) == ["x", "y", "z", "nx", "ny", "nz"]
    columns = {f"velo_{name}": np.arange(4.0) for name in ("x", "y", "z", "intensity", "ring", "t")}
    scan = to_scan(columns, Path("a.pcd"))
    assert all(column is not None for column in (scan.intensity, scan.ring, scan.time))


@pytest.mark.parametrize("name", ["timeOffset", "relative_time", "t_offset", "Time Stamp [us]", "offset_time_ns"])
@pytest.mark.parametrize("ring", ["laserID", "Laser Channel", "ring_index", "Row"])
def test_words_of_a_name_may_be_divided_or_not(name, ring):
    columns = dict.fromkeys(("x", "y", "z", ring), np.arange(4.0)) | {name: np.arange(4.0) * 1000}
    scan = to_scan(columns, Path("a.csv"))
    assert scan.ring.tolist() == [0, 1, 2, 3]
    assert scan.time[-1] > 0


NAMES = {
    "time": "point_time_offset relative_timestamp dt delta_t timestampNs t_rel_s time_from_start stamp_usec",
    "intensity": "return_intensity intensity_raw signal_photons refl amplitude calibrated_reflectivity",
    "ring": "laser_number vertical_channel line_id scan_ring layer beam_index row_index",
}
OTHERS = "timestamp_type first_return beam_azimuth scan_id id range velocity time_valid return_type index channels"


@pytest.mark.parametrize("meaning", NAMES)
def test_words_that_change_nothing_may_stand_around_what_a_column_is_and_no_others(meaning):
    for name in NAMES[meaning].split():
        scan = to_scan({**dict.fromkeys("xyz", np.arange(4.0)), name: np.arange(4.0)}, Path("a.csv"))
        given = {known: getattr(scan, known) is not None for known in NAMES}
        assert given == {known: known == meaning for known in NAMES}, name
    for name in OTHERS.split():
        scan = to_scan({**dict.fromkeys("xyz", np.arange(4.0)), name: np.arange(4.0)}, Path("a.csv"))
        assert getattr(scan, meaning) is None, name


def test_the_name_that_says_least_else_comes_first():
    assert called(["gps_time", "adjusted_time", "timestamp", "t"], "time") == [
        "t", "timestamp", "adjusted_time", "gps_time",
    ]  # fmt: skip
    begin = time.process_time()
    assert called(["secs" * 10_000 + "x", "pointraw" * 10_000], "time") == []
    assert time.process_time() - begin < 1.0


@pytest.mark.parametrize("names", [("sec", "nsec"), ("t_sec", "t_nsec"), ("timestampSec", "timestampNanosec")])
@pytest.mark.parametrize("kind", ["u4", "f8"])
def test_a_clock_in_two_parts_goes_on_where_the_second_does(names, kind):
    parts = np.array([[1_700_000_000] * 2 + [1_700_000_001] * 2, [950_000_000, 990_000_000, 30_000_000, 45_000_000]])
    columns = {**dict.fromkeys("xyz", np.arange(4.0)), **dict(zip(names, parts.astype(kind), strict=True))}
    np.testing.assert_allclose(to_scan(columns, Path("a.csv")).time, [0.0, 0.04, 0.08, 0.095], atol=1e-6)


def test_coordinates_of_the_first_of_two_returns_are_taken():
    assert plain_names(["X1 (m)", "Y1 (m)", "Z1 (m)", "X2 (m)"]) == ["x", "y", "z", "x2"]
    assert plain_names(["x", "y", "z", "x1", "y1", "z1"]) == ["x", "y", "z", "x1", "y1", "z1"]


def test_points_of_several_scans_in_a_file_are_told():
    columns = dict.fromkeys("xyz", np.arange(4.0))
    assert len(to_scan({**columns, "Frame": np.full(4, 7)}, Path("a.csv"))) == 4
    with pytest.raises(InputError, match=r"a.csv holds the points of 2 scans; write a file for each"):
        to_scan({**columns, "Frame": np.array([7, 7, 8, 8])}, Path("a.csv"))


def test_other_units_and_coordinates_that_are_there_twice_are_refused():
    with pytest.raises(InputError, match="another unit than metres"):
        by_plain_names(dict.fromkeys(["x (ft)", "y (ft)", "z (ft)"], np.zeros(3)), Path("a.csv"))
    with pytest.raises(InputError, match="has x twice"):
        by_plain_names(dict.fromkeys(["x", "X", "y", "z"], np.zeros(3)), Path("a.csv"))


def test_very_many_names_are_read_in_a_moment():
    names = [f"column {k}" for k in range(100_000)]
    begin = time.process_time()
    assert plain_names(["lidar_x", "lidar_y", "lidar_z", *names])[:3] == ["x", "y", "z"]
    assert time.process_time() - begin < 10.0  # half a second; hours, if each name looked at all the others
