"""Movers and tracks: hand-computed cases, and invariances."""

import numpy as np
import pytest

from automos.evaluation.objects import OUTCOMES, association, count_tracks, movers_of, outcomes, scores_of_objects
from automos.evaluation.overlaps import NO_TRACK, NOT_MOVING, STANDS, Overlaps, count_overlaps, pooled

CAR, VAN = 1 << 16 | 252, 2 << 16 | 252


def label(instance, semantic):
    return np.uint32(instance << 16 | semantic)


def table(*rows):
    """Return overlaps of rows (scan, mover, track, points)."""
    return Overlaps(*np.array(rows, np.int64).reshape(-1, 4).T)


def rows_of(overlaps):
    return sorted(zip(*(column.tolist() for column in overlaps.to_arrays().values()), strict=True))


def test_points_of_a_scan_are_counted_by_mover_and_track():
    truth = [CAR, CAR, CAR, 9, 9, 10 | 7 << 16, 0, 251]
    prediction = [251, 251, 9, 251, 9, 251, 251, 251]
    found = count_overlaps(5, prediction, truth, [4, 0, 0, 4, 0, 6, 4, 4])
    # unknown truth, moving points without an instance, and what rightly stands are in no row
    expected = [
        *((5, CAR, 4, 1), (5, CAR, NO_TRACK, 1), (5, CAR, NOT_MOVING, 1)),
        *((5, STANDS, 4, 1), (5, STANDS, 6, 1)),
    ]
    assert rows_of(found) == sorted(expected)


def test_each_moving_object_has_its_own_recall():
    truth = np.repeat([label(1, 252), label(2, 254), label(3, 10), label(0, 251)], [4, 2, 5, 3])
    prediction = np.array([251, 251, 251, 9] + [0, 251] + [251] * 8)
    movers = movers_of(count_overlaps(0, prediction, truth, np.zeros(14, int)))
    # the parked car (10) and the moving points without instance are not moving objects
    np.testing.assert_array_equal(movers.label >> 16, [1, 2])
    np.testing.assert_array_equal(movers.n_points, [4, 2])
    np.testing.assert_array_equal(movers.recall, [0.75, 0.5])


def test_objects_of_different_classes_may_share_an_instance_id():
    movers = movers_of(count_overlaps(0, [251, 9], [label(1, 252), label(1, 254)], [0, 0]))
    np.testing.assert_array_equal(movers.recall, [1.0, 0.0])


def test_a_recording_without_movers_has_none():
    found = count_overlaps(0, [9, 251], [9, 0], [0, 1])
    assert len(movers_of(found)) == len(found) == 0
    assert np.isnan(association(movers_of(found)))


def test_a_mover_is_whole_missed_split_or_merged():
    whole, missed, split, merged, bare = (k << 16 | 252 for k in range(1, 6))
    found = movers_of(
        table(
            *((0, whole, 1, 80), (0, whole, NOT_MOVING, 20), (0, STANDS, 1, 20)),
            *((0, missed, 2, 49), (0, missed, NOT_MOVING, 51)),
            *((0, split, 3, 79), (1, split, 4, 21)),
            *((0, merged, 5, 100), (1, whole, 5, 26)),
            (0, bare, NO_TRACK, 100),
        )
    )
    assert [OUTCOMES[k] for k in found.outcome] == ["split", "missed", "split", "merged", "split"]
    np.testing.assert_allclose(found.share, [80 / 126, 0.49, 0.79, 1.0, 0.0])
    np.testing.assert_allclose(found.purity, [0.8, 1.0, 1.0, 100 / 126, 0.0])
    np.testing.assert_array_equal(found.n_scans, [2, 1, 2, 1, 1])
    np.testing.assert_array_equal(found.best, [1, 2, 3, 5, NO_TRACK])
    assert OUTCOMES[movers_of(table((0, whole, 1, 80), (0, whole, -1, 20), (0, STANDS, 1, 20))).outcome[0]] == "whole"


def test_association_is_the_mean_iou_of_tubes_weighted_by_points():
    # 300 points: 200 on a track of 250, 100 on one of 100
    found = movers_of(table((0, CAR, 1, 150), (1, CAR, 1, 50), (1, STANDS, 1, 50), (2, CAR, 2, 100)))
    expected = (200 * 200 / (300 + 250 - 200) + 100 * 100 / (300 + 100 - 100)) / 300
    np.testing.assert_allclose(found.association, expected)
    assert association(found) == pytest.approx(expected)
    assert np.isnan(association(movers_of(table((0, CAR, 1, 299)))))
    assert outcomes(found, 300) == {"whole": 0, "missed": 0, "split": 1, "merged": 0}


def test_tracks_are_on_the_mover_that_has_most_of_their_points_or_elsewhere():
    found = count_tracks(
        table(
            *((0, CAR, 1, 10), (1, CAR, 2, 10), (0, STANDS, 2, 9)),
            *((0, CAR, 3, 5), (0, STANDS, 3, 5), (0, STANDS, 4, 7)),
            *((0, VAN, 5, 4), (0, VAN, NO_TRACK, 4), (0, STANDS, NO_TRACK, 9), (0, VAN, NOT_MOVING, 50)),
        )
    )
    assert (found.on_movers, found.covered, found.elsewhere, found.per_mover) == (3, 2, 2, 1.5)
    assert (found.unowned_on, found.moving_on) == (4, 33)
    assert (found.unowned_elsewhere, found.moving_elsewhere) == (9, 30)


def test_neither_the_order_of_scans_nor_the_numbers_of_tracks_matter():
    rng = np.random.default_rng(3)
    keys = np.unique(rng.integers([[0], [0], [-1]], [[8], [5], [6]], (3, 90)), axis=1)
    mover = np.where(keys[1] > 0, keys[1] << 16 | 252, 0)
    found = Overlaps(keys[0], mover, keys[2], rng.integers(1, 500, keys.shape[1]))
    other_tracks = np.where(found.track > 0, 1000 - 7 * found.track, found.track)
    shuffled = Overlaps(100 - found.scan, found.mover, other_tracks, found.n_points)[rng.permutation(len(found))]
    ours, theirs = scores_of_objects(found), scores_of_objects(shuffled)
    assert ours.pop("movers") == theirs.pop("movers")
    assert ours == pytest.approx(theirs, nan_ok=True)


def test_recordings_pooled_share_no_mover_and_no_track():
    one = table((0, CAR, 1, 100), (0, STANDS, 1, 5), (1, CAR, NOT_MOVING, 3), (1, VAN, NO_TRACK, 4))
    both = pooled([one, one])
    assert rows_of(pooled([one])) == rows_of(one)
    assert len(movers_of(both)) == 4
    counts, once = count_tracks(both), count_tracks(one)
    assert (counts.on_movers, counts.unowned_on) == (2 * once.on_movers, 2 * once.unowned_on)
    ours, theirs = scores_of_objects(both), scores_of_objects(one)
    assert [ours[k] for k in ("hota", "ass_a", "idf1")] == pytest.approx([theirs[k] for k in ("hota", "ass_a", "idf1")])


@pytest.mark.recordings
def test_a_real_recording_scores_as_another_program_counts_it(recordings):
    """Truth, cut, joined, left out and made up: the figures are those of an independent script on the same labels."""
    parts = []
    for i, path in enumerate(sorted((recordings / "sequences" / "lyft_5hz" / "labels").glob("*.label"))):
        truth = np.fromfile(path, np.uint32)
        ids, is_moving, row = (truth >> 16).astype(int), truth & 0xFFFF == 251, np.arange(len(truth))
        track = np.select([ids % 4 == 1, ids % 4 == 2], [ids + 100 * (i >= 60), 200], ids)
        track = np.where(row % 7, np.where(is_moving, track, 300 + row // 20000), NO_TRACK)
        says = np.where(np.where(is_moving, ids % 5 != 0, row % 200 == 0), 251, 9)
        parts.append(count_overlaps(i, says, truth, track))
    found = Overlaps.concatenate(parts)
    movers, tracks = movers_of(found), count_tracks(found)
    assert outcomes(movers, 300) == {"whole": 11, "missed": 3, "split": 5, "merged": 1}
    assert outcomes(movers, 3000) == {"whole": 6, "missed": 1, "split": 4, "merged": 0}
    assert association(movers) == pytest.approx(0.544, abs=5e-4)
    assert (tracks.on_movers, tracks.covered, tracks.elsewhere, tracks.moving_elsewhere) == (22, 17, 4, 36300)
    assert tracks.unowned_on / tracks.moving_on == pytest.approx(0.143, abs=5e-4)
    assert tracks.unowned_elsewhere / tracks.moving_elsewhere == pytest.approx(0.144, abs=5e-4)
