"""HOTA and IDF1, by hand. (Over random tables they agree with the package trackeval to 2e-16.)"""

import numpy as np
import pytest

from automos.evaluation.overlaps import NO_TRACK, NOT_MOVING, STANDS, Overlaps, detections, hota, identity


def table(*rows):
    return Overlaps(*np.array(rows, np.int64).reshape(-1, 4).T)


def test_one_track_that_is_the_mover_is_perfect():
    perfect = table((0, 1, 7, 30), (1, 1, 7, 9), (1, 2, 8, 4))
    assert hota(detections(perfect)) == pytest.approx({"hota": 1.0, "det_a": 1.0, "ass_a": 1.0})
    assert identity(detections(perfect)) == {"idf1": 1.0}


def test_a_track_that_ends_half_way_halves_the_association():
    # four scans, two on each of two tracks: every match has 2 of 4 + 2 - 2 detections in common
    halves = table((0, 1, 7, 10), (1, 1, 7, 10), (2, 1, 8, 10), (3, 1, 8, 10))
    assert hota(detections(halves)) == pytest.approx({"hota": np.sqrt(0.5), "det_a": 1.0, "ass_a": 0.5})
    assert identity(detections(halves))["idf1"] == pytest.approx(2 * 2 / 8)


def test_a_track_that_covers_part_of_it_matches_up_to_that_similarity():
    part = table((0, 1, 7, 60), (0, 1, NOT_MOVING, 40))  # IoU 0.6: of the 19 thresholds, 0.05 to 0.6 match
    found = hota(detections(part))
    assert found["det_a"] == pytest.approx(12 / 19)
    assert found["hota"] == pytest.approx(12 / 19)
    assert identity(detections(part)) == {"idf1": 1.0}
    assert identity(detections(table((0, 1, 7, 49), (0, STANDS, 7, 51)))) == {"idf1": 0.0}


def test_false_and_missed_detections_count_in_detection_alone():
    found = hota(detections(table((0, 1, 7, 10), (1, 1, NO_TRACK, 10), (1, STANDS, 8, 10))))
    assert found["det_a"] == pytest.approx(1 / 3)
    assert found["ass_a"] == pytest.approx(1 / 2)  # the mover has two detections


def test_nothing_to_score_is_nan():
    nothing = table((0, STANDS, NO_TRACK, 5))
    assert np.isnan([*hota(detections(nothing)).values(), *identity(detections(nothing)).values()]).all()
    assert hota(detections(table((0, 1, NOT_MOVING, 5))))["hota"] == 0.0
