"""What the segments of a scan say of whether they have moved."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import gammaln

from automos.core.upright_boxes import Boxes
from automos.objects.detections import Detections
from automos.objects.terms import (
    BODY,
    CHANCE,
    LEAST_SOLID,
    MOVED,
    PIECE,
    POROUS,
    STAYED,
    WRONG,
    Segments,
    each_for_itself,
    segment_terms,
)
from automos.objects.tracks import Tracks


def segments(*counts, part_of=-1, solidity=1.0):
    """The segments of a scan, each with the numbers of its points, of those that moved and of those that stayed."""
    n = len(counts)
    boxes = Boxes(np.zeros((n, 3)), np.ones((n, 3)), np.zeros(n), np.ones(n))
    found = Detections.of_objects(boxes, *np.array(counts, np.float64).T, solidity=np.full(n, solidity))
    return replace(found, part_of=np.full(n, part_of, np.int32) if np.isscalar(part_of) else np.array(part_of))


def said(*counts, is_asked=True, **about):
    """The evidence of the first segment."""
    return segment_terms(segments(*counts, **about), is_asked).evidence[0]


def test_the_evidence_of_a_scan_by_hand():
    def likelihood(prior):
        a, n = np.array(prior), np.array([30.0, 50.0, 20.0])
        return gammaln(a.sum()) - gammaln(a.sum() + n.sum()) + (gammaln(a + n) - gammaln(a)).sum()

    moved, stayed = np.exp(likelihood(MOVED)), np.exp(likelihood(STAYED))
    right = np.log(((1.0 - WRONG) * moved + WRONG * stayed) / ((1.0 - WRONG) * stayed + WRONG * moved))
    assert said((100, 30, 50)) == pytest.approx(BODY + right)


@pytest.mark.parametrize("counts", [(10**7, 0, 10**7), (10**7, 10**7, 0)])
def test_no_scan_says_more_than_the_odds_of_its_being_wrong(counts):
    assert abs(said(counts) - BODY) < np.log(1.0 / WRONG)


def test_unknown_points_count_only_where_others_were_asked():
    assert said((100, 0, 0), is_asked=False) == 0.0
    assert said((100, 0, 0)) != pytest.approx(BODY)


def test_while_most_is_unknown_a_few_points_say_nothing():
    share = int(CHANCE * 1000)
    assert said((1000, share, 0), is_asked=False) == said((1000, 0, share), is_asked=False) == 0.0
    more = said((1000, share + 90, share), is_asked=False)
    assert more == pytest.approx(said((90, 90, 0), is_asked=False), abs=0.2)  # of 90 points one is chance, too
    assert said((1000, share, 0)) < said((100, 100, 0))


def test_what_lets_through_the_rays_that_meet_it_and_pieces_are_seldom_bodies():
    whole, of_a_face = said((100, 0, 0)), 1.0 - 1.5 / 10.0 + 0.5 / 100.0
    for solidity, through in ((of_a_face, 0.0), (0.5 * of_a_face, 1.0), (0.0, 1.0 / LEAST_SOLID)):
        assert said((100, 0, 0), solidity=solidity) == pytest.approx(whole + POROUS * through)
    assert said((100, 0, 0), (9, 0, 0), part_of=[1, -1]) == pytest.approx(whole + PIECE)


PASSED = segments((1000, 300, 700), (300, 300, 0), part_of=[-1, 0])
"""A parked car and who passes it closely: one segment, and the piece that was cut out of it."""


def tracks(*rows):
    """Rows of track, scan and segment."""
    columns = np.array(sorted(rows)).T
    return Tracks.of_segments(*columns, np.zeros(len(rows)))


def test_who_passes_a_parked_car_says_nothing_of_it():
    alone = segments((300, 300, 0))
    seen = Segments.of_scans([segment_terms(found) for found in (alone, PASSED, alone)])
    found = each_for_itself(seen, tracks((0, 1, 0), (1, 0, 0), (1, 1, 1), (1, 2, 0)))
    assert found.terms.evidence[1] == pytest.approx(said((700, 0, 700)))
    assert found.terms.evidence[[0, 2, 3]].tolist() == seen.terms.evidence[[0, 2, 3]].tolist()


def test_of_several_pieces_those_that_are_things_of_their_own_are_left_out():
    both = segments((1000, 500, 500), (300, 300, 0), (200, 200, 0), part_of=[-1, 0, 0])
    seen = Segments.of_scans([segment_terms(found) for found in (segments((300, 300, 0)), both)] * 2)
    walker = [(1, 0, 0), (1, 1, 1), (1, 2, 0)]
    found = each_for_itself(seen, tracks((0, 1, 0), *walker, (2, 1, 2), (2, 3, 2)))
    assert found.terms.evidence[1] == pytest.approx(said((700, 200, 500)))
    assert found.terms.evidence[5] == pytest.approx(said((1000, 500, 500)))


def test_an_edge_that_is_nothing_but_a_piece_speaks_for_its_whole():
    seen = Segments.of_scans([segment_terms(found) for found in (PASSED, PASSED)])
    found = each_for_itself(seen, tracks((0, 0, 0), (0, 1, 0), (1, 0, 1), (1, 1, 1)))
    assert found.terms.evidence.tolist() == seen.terms.evidence.tolist()


def test_an_edge_with_which_a_body_sets_off_speaks_for_it_though_it_goes_on_alone():
    alone = segments((300, 300, 0))
    seen = Segments.of_scans([segment_terms(found) for found in (PASSED, alone, alone)])
    found = each_for_itself(seen, tracks((0, 0, 0), (1, 0, 1), (1, 1, 0), (1, 2, 0)))
    assert found.terms.evidence.tolist() == seen.terms.evidence.tolist()


def test_what_stood_there_before_is_the_body_itself_and_its_edge_speaks_for_it():
    stood, alone = segments((700, 0, 700)), segments((300, 300, 0))
    stood.has_stayed[:] = True
    scans = [segment_terms(found) for found in (stood, PASSED, alone)]
    seen = Segments.of_scans(scans)
    found = each_for_itself(seen, tracks((0, 1, 0), (1, 0, 0), (1, 1, 1), (1, 2, 0)))
    assert found.terms.evidence.tolist() == seen.terms.evidence.tolist()
    assert found.terms.evidence[1] > found.terms.evidence[0]


def test_segments_are_numbered_from_scan_to_scan():
    nothing, one = segment_terms(Detections.nothing()), segment_terms(segments((9, 0, 0)))
    seen = Segments.of_scans([one, nothing, segment_terms(PASSED)])
    assert seen.begins.tolist() == [0, 1, 1, 3]
    assert seen.terms.part_of.tolist() == [-1, -1, 1]
    assert seen.of(tracks((0, 0, 0), (0, 1, -1), (0, 2, 1))).tolist() == [0, -1, 2]


def test_the_ends_of_a_box_are_its_corners_farthest_to_the_left_and_to_the_right():
    boxes = Boxes(
        np.array([[10.0, 0.0, 0.0], [0.0, 10.0, 0.0]]), np.array([[4.0, 2.0, 1.5]] * 2), np.zeros(2), np.ones(2)
    )
    found = Detections.of_objects(boxes, *np.ones((3, 2)), sensor=(0.0, 0.0))
    ahead, beside = segment_terms(found).ends
    assert np.allclose(ahead, [[8.0, 1.0], [8.0, -1.0]])  # of what is seen from behind, at its rear
    assert np.allclose(beside, [[-2.0, 9.0], [2.0, 9.0]])


def test_what_is_hidden_or_cut_out_of_something_has_no_end_there():
    boxes = Boxes(np.full((3, 3), 9.0), np.ones((3, 3)), np.zeros(3), np.ones(3))
    found = Detections.of_objects(boxes, *np.ones((3, 3)), hidden=np.array([[True, False], [False, True], [False] * 2]))
    ends = segment_terms(replace(found, part_of=np.array([-1, -1, 0], np.int32))).ends
    assert np.isnan(ends[..., 0]).tolist() == [[True, False], [False, True], [True, True]]
