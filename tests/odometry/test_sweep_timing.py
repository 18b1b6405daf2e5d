import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from automos.core.geometry import make_transform, transform
from automos.core.scan import Scan
from automos.odometry.point_order import PointOrder
from automos.odometry.sweep_timing import SweepTiming, azimuth_times, recorded_duration, sweep_times

AROUND = np.array([[1, 0, 0], [0, 1, 0], [-1, 1e-4, 0], [0, -1, 0]], np.float32)  # 0, 90, 180, 270 degrees


@pytest.mark.parametrize(
    ("turn", "seam_deg", "expected"),
    [
        (1, 180.0, [0.0, 0.25, 0.5, -0.25]),
        (-1, 180.0, [0.0, -0.25, -0.5, 0.25]),
        (1, 0.0, [-0.5, -0.25, 0.0, 0.25]),
        (-1, 90.0, [-0.25, -0.5, 0.25, 0.0]),
    ],
    ids=["counter-clockwise from the back", "clockwise from the back", "from the front", "from the left"],
)
def test_the_azimuth_tells_when_in_the_sweep_a_point_was_measured(turn, seam_deg, expected):
    times = azimuth_times(AROUND, turn, seam_deg)
    off = np.abs(times - expected)
    np.testing.assert_allclose(np.minimum(off, 1.0 - off), 0.0, atol=1e-4)  # either end of the sweep at the seam


def test_times_from_the_file_are_fractions_of_the_usual_sweep_and_never_outside_it():
    scan = Scan(np.ones((4, 3), np.float32), time=np.array([0.0, 0.05, 0.1, 0.13], np.float32))
    times = sweep_times(scan, SweepTiming("file", duration=0.1, share=1.0))
    np.testing.assert_allclose(times, [-0.5, 0.0, 0.5, 0.5], atol=1e-6)


@pytest.mark.parametrize(
    ("times", "duration"),
    [([0.0, 0.05, 0.1], 0.1), ([np.nan, 0.1, np.inf], 0.1), ([np.inf] * 3, None), ([0.0, 1e30, -np.inf], None)],
)
def test_times_that_are_no_times_within_a_sweep_tell_not_how_long_it_took(times, duration):
    found = recorded_duration(Scan(np.ones((3, 3), np.float32), time=np.array(times, np.float32)))
    assert found == (None if duration is None else pytest.approx(duration))


def test_a_compensated_sweep_has_no_times():
    assert sweep_times(Scan(AROUND, time=np.zeros(4, np.float32)), SweepTiming()) is None


def test_each_of_several_lidars_turns_about_its_own_axis():
    # The second one is mounted beside the first and turned by 90 degrees; both measure straight ahead at mid-sweep.
    beside = make_transform(Rotation.from_euler("z", 90.0, degrees=True).as_matrix(), [1.0, -2.0, 0.5])
    mounts, ahead = np.stack([np.eye(4), beside]), np.array([[4.0, 0.0, 0.0]], np.float32)
    points = np.concatenate([transform(mount, ahead) for mount in mounts])
    scan = Scan(points, sensor=np.array([0, 1], np.uint8), T_scan_sensor=mounts)
    timing = SweepTiming("azimuth", turn=-1, seam_deg=180.0, share=1.0)
    np.testing.assert_allclose(sweep_times(scan, timing), 0.0, atol=1e-6)
    assert sweep_times(Scan(points), timing)[1] == pytest.approx(-np.degrees(np.arctan2(2.0, 1.0)) / 360.0, abs=1e-3)


def test_each_of_several_lidars_begins_where_it_is():
    """Both turn once from the first point to the last, the second one from 120 degrees on."""
    turned = np.linspace(0.0, 1.0, 20_000, endpoint=False)
    azimuth = 2.0 * np.pi * np.concatenate([turned, turned + 1.0 / 3.0])
    points = 10.0 * np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(len(azimuth))]).astype(np.float32)
    mounts = np.tile(np.eye(4), (2, 1, 1))
    scan = Scan(points, sensor=np.repeat(np.uint8([0, 1]), len(turned)), T_scan_sensor=mounts)
    order = PointOrder(turn=1, turns=1.0, turns_per_scan=1.0, start=0.0)
    times = sweep_times(scan, SweepTiming("order", turn=1, share=1.0, order=order))
    np.testing.assert_allclose(times, np.tile(turned, 2) - 0.5, atol=0.01)
