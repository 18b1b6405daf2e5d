import numpy as np

from automos.array_sequence import ArraySequence
from automos.odometry.distinct import DistinctScans, with_repeats
from automos.odometry.motion import SweepTiming
from automos.odometry.trajectory import Trajectory
from automos.scan import Scan

IS_REPEAT = np.array([False, True, False, True, True])


def test_repeated_scans_are_left_out():
    scans = [Scan(np.full((1, 3), i + 1.0, np.float32), name=f"{i}") for i in range(5)]
    distinct = DistinctScans(ArraySequence(scans, stamps=0.1 * np.arange(5)), IS_REPEAT)
    assert distinct.names == ["0", "2"]
    assert [scan.points[0, 0] for scan in distinct] == [1.0, 3.0]
    np.testing.assert_allclose(distinct.stamps, [0.0, 0.2])


def test_a_repeated_scan_is_where_and_when_the_first_one_was():
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, 0, 3] = 2.0
    found = Trajectory(poses, np.array([0.0, 0.1]), np.ones((2, 6)), SweepTiming(), np.eye(4))
    whole = with_repeats(found, IS_REPEAT)
    np.testing.assert_allclose(whole.T_world_sensor[:, 0, 3], [0.0, 0.0, 2.0, 2.0, 2.0])
    np.testing.assert_allclose(whole.stamps, [0.0, 0.001, 0.1, 0.101, 0.102])
    assert len(whole) == 5
