import numpy as np
import pytest

from automos.core.labels import Label
from automos.writers.edits import EditedBox
from automos.writers.relabel import Change, relabel

UNKNOWN, STATIC, MOVING = range(3)
BOX = EditedBox((10.0, 0.0, 1.0), (4.0, 2.0, 2.0), 0.0, MOVING)
"""From x 8 to 12, y -1 to 1, z 0 to 2."""
POINTS = np.array(
    [
        [9.0, 0.0, 1.0],  # 0: in the box's rear half
        [11.0, 0.0, 1.0],  # 1: in its front half
        [9.0, 0.0, 0.1],  # 2: at its bottom
        [13.0, 0.0, 1.0],  # 3: a metre before it
        [30.0, 0.0, 1.0],  # 4: elsewhere
        [np.nan, 0.0, 0.0],  # 5: no return
    ],
    np.float32,
)
VALID = np.isfinite(POINTS).all(axis=1)
MOVER = [251, 251, 9, 9, 9, 0], [7, 7, 0, 0, 0, 0]
STANDER = [9, 9, 9, 9, 9, 0], [0] * 6


def as_verdict(verdict, box=BOX):
    return EditedBox(box.center, box.size, box.yaw, verdict)


def shifted(x):
    return EditedBox((10.0 + x, 0.0, 1.0), BOX.size, 0.0, MOVING)


@pytest.mark.parametrize(
    ("start", "before", "after", "labels", "instances"),
    [
        # nothing was done: nothing changes, whatever the labels are
        (MOVER, BOX, BOX, [251, 251, 9, 9, 9, 0], [7, 7, 0, 0, 0, 0]),
        (STANDER, BOX, BOX, [9, 9, 9, 9, 9, 0], [0] * 6),
        (MOVER, BOX, as_verdict(STATIC), [9, 9, 9, 9, 9, 0], [0] * 6),
        (MOVER, BOX, as_verdict(UNKNOWN), [0, 0, 9, 9, 9, 0], [0] * 6),
        (MOVER, BOX, None, [9, 9, 9, 9, 9, 0], [0] * 6),
        # the ground under the box stays
        (STANDER, as_verdict(STATIC), BOX, [251, 251, 9, 9, 9, 0], [7, 7, 0, 0, 0, 0]),
        (STANDER, None, BOX, [251, 251, 9, 9, 9, 0], [7, 7, 0, 0, 0, 0]),
        (STANDER, None, as_verdict(STATIC), [9, 9, 9, 9, 9, 0], [0] * 6),
        (STANDER, as_verdict(STATIC), as_verdict(UNKNOWN), [0, 0, 9, 9, 9, 0], [0] * 6),
        # two metres on: the rear half is given back, what lies ahead is taken
        (MOVER, BOX, shifted(2.0), [9, 251, 9, 251, 9, 0], [0, 7, 0, 7, 0, 0]),
    ],
)
def test_a_correction_changes_the_points_it_concerns_and_no_others(start, before, after, labels, instances):
    label, instance = (np.array(part) for part in start)
    got = relabel(POINTS, VALID, label.astype(np.uint16), instance, [Change(7, before, after)])
    assert got[0].tolist() == labels
    assert got[1].tolist() == instances
    assert (label.tolist(), instance.tolist()) == start


def test_points_of_another_object_that_moves_stay_its_own():
    label, instance = np.array([251, 251, 9, 9, 9, 0], np.uint16), np.array([5, 7, 0, 0, 0, 0])
    got = relabel(POINTS, VALID, label, instance, [Change(8, None, BOX)])
    assert got[1].tolist() == [5, 7, 0, 0, 0, 0]
    # unless that one was removed by the same correction, in whatever order
    changes = [Change(5, BOX, None), Change(7, BOX, None), Change(8, None, BOX)]
    for order in (changes, changes[::-1]):
        assert relabel(POINTS, VALID, label, instance, order)[1].tolist() == [8, 8, 0, 0, 0, 0]


def test_what_moves_without_a_track_goes_with_the_box_it_is_in():
    label = np.array([251, 9, 9, 251, 251, 0], np.uint16)
    got = relabel(POINTS, VALID, label, np.zeros(6, int), [Change(7, BOX, as_verdict(STATIC))])
    assert got[0].tolist() == [9, 9, 9, 251, 251, Label.UNLABELED]


def test_rounding_is_no_change_and_a_full_turn_neither():
    rounded = EditedBox((10.004, 0.0, 1.0), (4.0, 1.996, 2.0), 2 * np.pi - 0.001, MOVING)
    assert Change(7, BOX, rounded).kinds == []
    assert Change(7, BOX, shifted(0.02)).kinds == ["moved"]
    assert Change(7, BOX, EditedBox(BOX.center, BOX.size, 0.02, STATIC)).kinds == ["moved", "verdict"]
    assert Change(7, None, BOX).kinds == ["added"]
    assert Change(7, BOX, None).kinds == ["removed"]
