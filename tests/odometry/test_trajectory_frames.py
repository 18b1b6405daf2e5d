import numpy as np
import pytest

from automos.core.array_sequence import ArraySequence
from automos.core.errors import InputError
from automos.core.geometry import make_transform
from automos.core.scan import Scan, Sequence
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.trajectory import SequenceFrames, Trajectory, make_frame

POINTS = np.array([[10, 0, 0], [np.nan, 0, 0], [0, 10, 0], [0, 0, 0], [0, 0, 5]], np.float32)
TIMES = np.array([0.0, 0.02, 0.1, 0.05, 0.05], np.float32)
IS_REPEAT = np.array([False, True, False, True, True])


def trajectory(timing) -> Trajectory:
    poses = np.array([np.eye(4), make_transform(t=[2.0, 0, 0])])
    motion = np.tile([2.0, 0, 0, 0, 0, 0], (2, 1)) * timing.share
    return Trajectory(poses, np.array([5.0, 5.1]), motion, timing, make_transform(t=[0, 0, 1.8]), {"warnings": []})


def test_a_frame_holds_the_valid_points_at_mid_sweep_with_their_places_in_the_scan():
    frame = make_frame(Scan(POINTS, time=TIMES), trajectory(SweepTiming("file", duration=0.1, share=1.0)), 1)
    np.testing.assert_array_equal(frame.kept, [0, 2, 4])
    assert frame.n_points == 5
    np.testing.assert_allclose(frame.points, [[9, 0, 0], [1, 10, 0], [0, 0, 5]], atol=1e-5)
    np.testing.assert_allclose(frame.sweep_time, [-0.5, 0.5, 0.0], atol=1e-6)
    np.testing.assert_allclose(frame.points_level[2], [2, 0, 6.8], atol=1e-5)
    assert frame.stamp == pytest.approx(5.1)


def test_a_compensated_scans_points_are_the_users_own():
    frame = make_frame(Scan(POINTS[[0, 2, 4]]), trajectory(SweepTiming()), 0)
    np.testing.assert_array_equal(frame.points, POINTS[[0, 2, 4]])
    assert frame.sweep_time is None


def test_a_scan_without_points_is_a_frame_without_points():
    frame = make_frame(Scan(np.zeros((0, 3), np.float32)), trajectory(SweepTiming("azimuth", turn=1, share=1.0)), 0)
    assert frame.points.shape == (0, 3)
    assert frame.n_points == 0


def test_frames_of_a_sequence_are_made_one_by_one():
    frames = SequenceFrames(ArraySequence([POINTS, POINTS]), trajectory(SweepTiming()))
    assert len(frames) == 2
    np.testing.assert_allclose(frames[1].origin_level, [2.0, 0.0, 1.8])


@pytest.mark.parametrize("rows", [[0, 1, 2, 3, 4, 0], [1, 1, 2, 3, 4]], ids=["a point more", "a point of no use"])
def test_a_scan_that_changes_while_it_is_labelled_is_told(rows):
    scans = [Scan(POINTS, name="000000"), Scan(POINTS, name="000001")]
    sequence = type("Written", (Sequence,), {"__len__": lambda self: 2, "__getitem__": lambda self, i: scans[i]})()
    frames = SequenceFrames(sequence, trajectory(SweepTiming()))
    assert len(frames[1].points) == len(frames[1].points) == 3
    scans[1] = Scan(POINTS[rows])
    with pytest.raises(InputError, match=r"scan 000001 had 5 points \(3 valid\) and now has .*: the recording"):
        frames[1]
    assert len(frames[0].points) == 3


def test_a_trajectory_survives_being_taken_apart():
    before = trajectory(SweepTiming("azimuth", turn=-1, seam_deg=180.0, share=0.5))
    after = Trajectory.from_arrays(before.to_arrays())
    assert after.timing == before.timing
    assert after.diagnostics == before.diagnostics
    for name in ("T_world_sensor", "stamps", "sweep_motion", "T_level_world"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))


def test_a_trajectory_of_unequal_parts_is_refused():
    with pytest.raises(ValueError, match="stamps must be"):
        Trajectory(np.eye(4)[None], np.zeros(2), np.zeros((1, 6)), SweepTiming(), np.eye(4))


def test_a_repeated_scan_is_where_and_when_the_first_one_was():
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, 0, 3] = 2.0
    found = Trajectory(poses, np.array([0.0, 0.1]), np.ones((2, 6)), SweepTiming(), np.eye(4))
    whole = found.with_repeats(IS_REPEAT)
    np.testing.assert_allclose(whole.T_world_sensor[:, 0, 3], [0.0, 0.0, 2.0, 2.0, 2.0])
    np.testing.assert_allclose(whole.stamps, [0.0, 0.001, 0.1, 0.101, 0.102])
    assert len(whole) == 5


def test_stamps_of_scans_that_are_repeated_very_often_increase():
    found = Trajectory(np.tile(np.eye(4), (2, 1, 1)), np.array([0.0, 0.1]), np.ones((2, 6)), SweepTiming(), np.eye(4))
    is_repeat = np.ones(302, bool)
    is_repeat[[0, -1]] = False  # a driver that stood for half a minute
    assert (np.diff(found.with_repeats(is_repeat).stamps) > 0.0).all()
