import copy

import numpy as np

from automos import load_settings
from automos.detections import Detections
from automos.tracking.tracker import Tracker, as_table, track_objects
from automos.upright_boxes import Boxes

SETTINGS = load_settings("default").tracking


def cars(*x: float) -> Detections:
    """Return cars of 100 points, all seen to have moved, in a row."""
    n = len(x)
    boxes = Boxes(
        np.column_stack([x, np.zeros(n), np.ones(n)]), np.tile([4.0, 2.0, 1.5], (n, 1)), np.zeros(n), np.ones(n)
    )
    return Detections.of_objects(boxes, np.full(n, 100.0), np.full(n, 100.0), np.zeros(n))


SCANS = [(0.1 * k, cars(1.0 * k, 40.0 - 0.8 * k)) for k in range(12)]


def test_a_tracker_fed_scan_by_scan_finds_what_one_run_finds():
    tracker = Tracker(SETTINGS)
    fed = as_table([tracker.step(stamp, found) for stamp, found in SCANS])
    whole = track_objects(SCANS, SETTINGS)
    assert len(whole) == 2
    for name, column in whole.to_arrays().items():
        np.testing.assert_array_equal(getattr(fed, name), column)


def test_a_copy_goes_its_own_way():
    tracker = Tracker(SETTINGS)
    log = [tracker.step(stamp, found) for stamp, found in SCANS[:6]]
    other = copy.copy(tracker)
    for k in range(6, 9):  # another future: nothing is seen any more
        other.step(0.1 * k, cars())
    log += [tracker.step(stamp, found) for stamp, found in SCANS[6:]]
    for name, column in track_objects(SCANS, SETTINGS).to_arrays().items():
        np.testing.assert_array_equal(getattr(as_table(log), name), column)
