import numpy as np
from worlds import record, rider, street, van

from automos.core.geometry import make_transform
from automos.core.labels import Label
from automos.network.rivals import flow_labels, movable_labels
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.trajectory import Trajectory


def test_what_may_move_moves_whether_the_truth_names_classes_or_instances():
    truth = np.array([10, 30, 252, 40, 50, 9, 9 | 7 << 16, 251 | 8 << 16, 0, 70], np.uint32)
    wanted = [True, True, True, False, False, False, True, True, False, False]
    assert (movable_labels(truth) == Label.MOVING).tolist() == wanted


def known(world) -> Trajectory:
    """Return the true trajectory of a world."""
    n = len(world.sequence)
    T_level_world = make_transform(t=[0.0, 0.0, 1.8])
    return Trajectory(world.poses, 0.1 * np.arange(n), np.zeros((n, 6)), SweepTiming(), T_level_world)


def test_a_threshold_on_flow_finds_what_crosses_and_leaves_what_stands():
    world = street(4, traffic=(rider(7.0, -2.0, yaw=np.pi / 2, speed=6.0),))
    labels = flow_labels(world.sequence, known(world), 3)
    is_moving = world.truth[3] == Label.MOVING
    found, false = (labels[is_moving] == Label.MOVING).mean(), (labels[~is_moving] == Label.MOVING).mean()
    assert found > 0.15  # the way to the nearest point shows motion only where a surface does not slide along itself
    assert false < 0.05


def test_the_first_scan_has_no_flow():
    world = record((van(8.0, 0.0, speed=5.0),), np.stack([make_transform(t=[0, 0, 1.8])] * 2))
    labels = flow_labels(world.sequence, known(world), 0)
    assert set(labels) == {Label.STATIC}
