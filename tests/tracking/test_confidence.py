"""Confidence per point, case by case."""

import numpy as np

from automos.scan import GROUND, OBJECT
from automos.tracking.confidence import point_confidence


def test_each_kind_of_point_by_hand():
    track = np.array([-1, -1, -1, -1, 1], np.int32)
    score = np.array([0, 128, 255, 128, 255], np.uint8)
    kind = np.array([OBJECT, OBJECT, OBJECT, GROUND, OBJECT], np.uint8)
    found = point_confidence(track, np.array([0.1, 0.9]), score, kind) / 255.0
    np.testing.assert_allclose(found, [1.0, 0.75, 0.5, 1.0, 0.9], atol=0.003)


def test_without_tracks_everything_is_static():
    none = np.full(3, -1, np.int32)
    found = point_confidence(none, np.zeros(0), np.zeros(3, np.uint8), np.full(3, OBJECT, np.uint8))
    assert (found == 255).all()
