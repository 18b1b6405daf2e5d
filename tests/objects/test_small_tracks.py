"""What is followed long and well enough to be a body."""

import numpy as np

from automos.core.upright_boxes import Boxes
from automos.objects.detections import Detections
from automos.objects.terms import Segments, segment_terms
from automos.objects.tracking import is_small
from automos.objects.tracks import Tracks


def segments(n_scans, *n_points):
    """In every scan segments of so many points."""
    n = len(n_points)
    boxes = Boxes(np.zeros((n, 3)), np.ones((n, 3)), np.zeros(n), np.ones(n))
    found = Detections.of_objects(boxes, np.array(n_points), *np.zeros((2, n)))
    return Segments.of_scans([segment_terms(found)] * n_scans)


def test_a_body_shows_enough_points_for_enough_time_in_one_sight():
    # Thrice ten points in half a second; a hundred in a tenth; as often, but lost in between.
    sights = [(0, 0), (0, 2), (0, 5), (1, 1), (1, 2), (2, 1), (2, 2), (2, 6), (2, 7)]
    track, scan = np.array(sights).T
    scan[1:3] = 1, 2  # without a break
    stamps = np.array([0.0, 0.2, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
    parts = Tracks.of_segments(track, scan, track, np.zeros(len(sights)))
    seen_each = segments(len(stamps), 10.0, 50.0, 50.0)
    seen = np.array([30 * 0.5, 100 * 0.3, 100 * 0.3])
    for enough in (10.0, 20.0, 29.0, 31.0):
        np.testing.assert_array_equal(is_small(parts, 3, seen_each, stamps, enough), seen < enough)


def test_what_is_lost_between_two_sights_is_judged_by_each_alone():
    parts = Tracks.of_segments(np.zeros(4, int), np.array([0, 1, 5, 6]), np.zeros(4, int), np.zeros(4))
    seen, stamps = segments(7, 100.0), 0.1 * np.arange(7)
    assert not is_small(parts, 1, seen, stamps, 19.0)[0]
    assert is_small(parts, 1, seen, stamps, 21.0)[0]


def test_a_car_s_length_of_way_says_as_much_as_a_second():
    # A hundred points in each of four scans a tenth of a second apart: 120 for the time, and the metres gone over 4.5.
    parts = Tracks.of_segments(np.zeros(4, int), np.arange(4), np.zeros(4, int), np.zeros(4))
    seen, stamps = segments(4, 100.0), 0.1 * np.arange(4)
    for way, known in ((0.0, 120.0), (1.0, 120.0), (9.0, 800.0)):
        parts.center[:, 0] = np.linspace(0.0, way, 4)
        assert not is_small(parts, 1, seen, stamps, known - 1.0)[0]
        assert is_small(parts, 1, seen, stamps, known + 1.0)[0]
