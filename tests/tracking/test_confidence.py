"""Confidence per point, case by case."""

import numpy as np
import pytest

from automos.scan import GROUND, OBJECT
from automos.tracking.confidence import point_confidence

TRACKS = np.array([0.7, 0.9])
"""How sure the verdicts on two tracks are."""


@pytest.mark.parametrize(
    ("is_moving", "owner", "log_odds", "kind", "expected"),
    [
        (True, 1, 5.0, OBJECT, 0.9),
        (True, 1, 0.0, GROUND, 0.9),
        (False, 0, 3.0, OBJECT, 0.7),
        (False, 0, 0.0, GROUND, 1.0),
        (False, -1, 0.0, OBJECT, 0.982),
        (False, -1, 2.0, OBJECT, 0.5),
        (False, -1, -3.0, OBJECT, 1.0),
        (False, -1, 0.0, GROUND, 1.0),
    ],
    ids=[
        "on a moving object",
        "a wheel that was taken for ground, on a moving object",
        "on an object that stays",
        "ground",
        "of no object, seen once",
        "of no object, seen through",
        "of no object, hit again",
        "ground beside nothing",
    ],
)
def test_each_kind_of_point_by_hand(is_moving, owner, log_odds, kind, expected):
    found = point_confidence(
        np.array([is_moving]), np.array([owner], np.int32), TRACKS, np.array([log_odds], np.float16),
        np.array([kind], np.uint8),
    )  # fmt: skip
    assert found[0] / 255.0 == pytest.approx(expected, abs=0.003)


def test_without_tracks_everything_is_as_sure_as_its_evidence():
    none, kind = np.full(3, -1, np.int32), np.full(3, OBJECT, np.uint8)
    found = point_confidence(none >= 0, none, np.zeros(0), np.full(3, -4.0, np.float16), kind)
    assert (found == 255).all()
