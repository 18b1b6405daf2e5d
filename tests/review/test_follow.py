"""A segment is followed through a recording scan by scan."""

from collections import Counter

import numpy as np

from automos.core.upright_boxes import Boxes
from automos.objects.detections import Detections
from automos.review.follow import FIRST_WINDOW, follow_segment
from automos.settings import Settings

N, LAST, AWAY = 600, 399, range(200, 204)
STAMPS = 0.1 * np.arange(N)
SETTINGS = Settings().tracking


class Road:
    """A car at 10 m/s, hidden in four scans and gone after `LAST`, and a post; counts who asks for which scan."""

    def __init__(self):
        self.asked = Counter()

    def __call__(self, scan):
        self.asked[scan] += 1
        there = [[40.0, 8.0, 1.0]] + [[1.0 * scan, 0.0, 1.0]] * (scan <= LAST and scan not in AWAY)
        n = np.full(len(there), 50.0)
        sizes = np.tile([4.0, 2.0, 1.5], (len(there), 1))
        return Detections.of_objects(Boxes(np.array(there), sizes, 0.0 * n, 0.0 * n + 1.0), n, n, 0.0 * n)


def test_a_car_is_followed_to_both_ends_also_where_it_is_out_of_sight():
    path = follow_segment(Road(), STAMPS, 100, 1, SETTINGS)
    assert list(path) == list(range(LAST + 1))
    assert {scan for scan, (segment, _) in path.items() if segment < 0} == set(AWAY)
    for scan, (segment, box) in path.items():
        assert segment in (1, -1)
        assert abs(box[0] - scan) < 0.5  # one metre a scan


def test_no_scan_is_looked_at_twice_in_a_direction_however_long_the_recording():
    road = Road()
    follow_segment(road, STAMPS, 100, 1, SETTINGS)
    start = road.asked.pop(100)
    assert start == 4  # where it is, and what is around it, in either direction
    assert set(road.asked.values()) == {1}


def test_what_is_gone_is_sought_for_no_longer_than_it_may_be_out_of_sight():
    road = Road()
    follow_segment(road, STAMPS, LAST - 2, 1, SETTINGS)
    assert max(road.asked) <= LAST + 10 * (FIRST_WINDOW + SETTINGS.max_gap) + 1
