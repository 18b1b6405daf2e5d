import numpy as np
import pytest
from worlds import street

from automos import load_settings
from automos.geometry import inverse, se3_log
from automos.odometry.motion import SweepTiming
from automos.online.inquiry import Inquiry
from automos.online.odometry import CausalOdometry
from automos.scan import Scan
from automos.simulation import simulate

SETTINGS = load_settings("default").odometry


def follow(scans, **kwargs):
    odometry = CausalOdometry(SETTINGS, 16, **kwargs)
    return [odometry.step(scan) for scan in scans]


def chained(moved):
    poses = [np.eye(4)]
    for step in moved[1:]:
        poses.append(poses[-1] @ step.T_last_this)
    return np.array(poses)


def test_a_slow_drive_is_found_though_rings_lie_on_rings_at_rest():
    world = street(20)
    error = se3_log(inverse(world.poses) @ chained(follow(world.sequence, is_compensated=True)))
    assert np.linalg.norm(error[:, :3], axis=1).max() < 0.03
    assert np.degrees(np.linalg.norm(error[:, 3:], axis=1)).max() < 0.1


def test_a_start_in_full_flight_is_found():
    world = simulate("avenue", "VLP-16", n_scans=26, seed=5)
    moved = follow([Scan(scan.points, stamp=scan.stamp) for scan in world], timing=SweepTiming())
    true = np.linalg.norm(np.diff(world.reference_poses[-3:, :3, 3], axis=0), axis=1)
    assert true.min() > 0.8  # metres a scan
    found = np.linalg.norm([step.T_last_this[:3, 3] for step in moved[-2:]], axis=1)
    np.testing.assert_allclose(found, true, rtol=0.1)
    assert [i for i, step in enumerate(moved) if step.remade] in ([], [19])


@pytest.fixture(scope="module")
def sweeps():
    """Return raw sweeps of a moving sensor whose points have no times."""
    world = simulate("city", "VLP-16", n_scans=44, seed=3)
    return [Scan(scan.points, stamp=scan.stamp) for scan in world]


def test_timing_is_taken_over_when_its_time_has_come_and_the_last_scans_are_made_anew(sweeps):
    moved = follow(sweeps)
    known = [i for i, step in enumerate(moved) if step.timing.source != "none"]
    assert known == list(range(known[0], len(sweeps)))
    remade = [i for i, step in enumerate(moved) if step.remade]
    assert remade == known[:1]
    again = moved[known[0]].remade
    assert [r.stamp for r in again] == [scan.stamp for scan in sweeps[: known[0]]]
    assert {r.timing for r in again} == {moved[known[0]].timing}
    # as the scan that comes then sees them, they lie behind it, ever nearer
    away = [np.linalg.norm(r.T_now_then[:3, 3]) for r in again]
    assert np.all(np.diff(away) < 0.0)
    assert away[-1] < 1.0


def test_an_answer_never_comes_sooner_however_fast_it_was_found():
    inquiry = Inquiry(2.0)
    assert inquiry.answer(100.0) is None
    inquiry.ask(lambda: "first", 5.0)
    inquiry.ask(lambda: "second", 6.0)  # one is enough
    assert inquiry.answer(7.0 - 0.01) is None
    assert inquiry.answer(7.0) == inquiry.answer(100.0) == "first"
