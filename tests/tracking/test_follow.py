"""Following objects: fast from the second scan, through gaps, without swapping neighbours."""

import numpy as np
import pytest

from automos.detections import Detections
from automos.settings import FollowSettings
from automos.tracking.follow import follow_objects
from automos.upright_boxes import Boxes


def seen(*things, size=(4.0, 1.8, 1.5), n_points=80):
    """Detections at x, y, with a share of moved points each."""
    center = np.array([[x, y, 0.75] for x, y, _ in things]).reshape(-1, 3)
    n = np.full(len(things), float(n_points))
    moved = n * np.array([share for *_, share in things])
    boxes = Boxes(center, np.tile(size, (len(things), 1)), np.zeros(len(n)), np.ones(len(n)))
    return Detections.of_objects(boxes, n, moved, n - moved)


def follow(scans, period=0.1):
    return follow_objects([(period * i, found) for i, found in enumerate(scans)], FollowSettings())


@pytest.mark.parametrize("speed", [1.0, 15.0, 35.0])
@pytest.mark.parametrize("period", [0.05, 0.1, 0.2])
def test_one_object_is_one_track_whatever_its_speed_and_the_sensors_rate(speed, period):
    tracks = follow([seen((speed * period * i, 0.0, 1.0)) for i in range(12)], period)
    assert len(tracks) == 1
    assert tracks.velocity[-1, 0] == pytest.approx(speed, rel=0.02)


def test_a_parked_car_is_not_taken_for_the_next_in_its_row():
    # The first car is hidden when the second, 5 m on, comes into view.
    tracks = follow([seen((0.0, 0.0, 0.0)), seen((5.0, 0.0, 0.0))])
    assert len(tracks) == 2


@pytest.mark.parametrize(("n_hidden", "n_tracks"), [(0, 1), (5, 1), (10, 2)])
def test_an_object_is_found_again_within_the_gap(n_hidden, n_tracks):
    x = 1.0 * np.arange(20)
    scans = [seen((x[i], 0.0, 1.0)) if not 8 <= i < 8 + n_hidden else seen() for i in range(20)]
    assert len(follow(scans)) == n_tracks


def test_objects_that_meet_keep_their_tracks():
    scans = [seen((i - 10.0, 0.0, 1.0), (10.0 - i, 2.5, 1.0)) for i in range(20)]
    tracks = follow(scans)
    assert len(tracks) == 2
    for k in range(2):
        x = tracks.center[tracks.rows_of(k), 0]
        assert abs(x[-1] - x[0]) > 15.0


def test_no_detections_are_no_tracks():
    assert len(follow([seen(), seen()])) == 0
    assert len(follow([])) == 0
