"""How much an observation is worth."""

import numpy as np

from automos.objects.looks import LOOK, looks, share_first_looks


def test_scans_count_by_the_time_between_them():
    first, times = np.array([0, 3, 3, 5]), np.r_[0.0, 0.1 * LOOK, 5.0 * LOOK, 1.0, 1.0 + 0.5 * LOOK]
    np.testing.assert_allclose(looks(first, times), [1.0, 0.1, 1.0, 1.0, 0.5])


def test_new_tracks_share_their_first_look():
    first, times = np.array([0, 3, 5]), np.r_[0.0, 0.5 * LOOK, 1.5 * LOOK, 0.0, 0.5 * LOOK]
    worth = looks(first, times)
    share_first_looks(worth, first, times, np.array([True, False]))
    np.testing.assert_allclose(worth, [0.75, 0.75, 1.0, 1.0, 0.5])
