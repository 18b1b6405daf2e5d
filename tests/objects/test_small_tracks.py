"""What is followed long and well enough to be a body."""

import numpy as np

from automos.objects.tracking import is_small
from automos.objects.tracks import Tracks


def test_a_body_shows_enough_points_for_enough_time_in_one_sight():
    # Thrice ten points in half a second; a hundred in a tenth; as often, but lost in between.
    sights = [(0, 0), (0, 2), (0, 5), (1, 1), (1, 2), (2, 1), (2, 2), (2, 6), (2, 7)]
    track, scan = np.array(sights).T
    scan[1:3] = 1, 2  # without a break
    stamps = np.array([0.0, 0.2, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
    parts = Tracks.of_segments(track, scan, track, np.zeros(len(sights)))
    n_points = [np.array([10.0, 50.0, 50.0])] * len(stamps)
    seen = np.array([30 * 0.5, 100 * 0.3, 100 * 0.3])
    for enough in (10.0, 20.0, 29.0, 31.0):
        np.testing.assert_array_equal(is_small(parts, 3, n_points, stamps, enough), seen < enough)


def test_what_is_lost_between_two_sights_is_judged_by_each_alone():
    parts = Tracks.of_segments(np.zeros(4, int), np.array([0, 1, 5, 6]), np.zeros(4, int), np.zeros(4))
    n_points, stamps = [np.array([100.0])] * 7, 0.1 * np.arange(7)
    assert not is_small(parts, 1, n_points, stamps, 19.0)[0]
    assert is_small(parts, 1, n_points, stamps, 21.0)[0]
