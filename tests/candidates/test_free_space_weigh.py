import numpy as np
import pytest

from automos.candidates.free_space_vote import BLOCKED, HIT, THROUGH, WEAK
from automos.candidates.free_space_weigh import ONE, find_open, find_seen_through, sum_votes, weaken_lone, weigh_looks


def net_of(before, after, stay_weight=0.25):
    """Net evidence of one point from votes before and after, in time order."""
    votes = np.array([ONE * v for v in (*before, *after)], np.int8)[:, None]
    net, through, hits = np.zeros(1, np.float32), np.zeros(1, np.uint8), np.zeros(1, np.uint8)
    sum_votes(votes, len(before), stay_weight, net, through, hits)
    return float(net[0]), int(through[0]), int(hits[0])


@pytest.mark.parametrize(
    ("before", "after", "net"),
    [
        ([1, 1, 1], [1, 1, 1], 6.0),  # passed through
        ([-1, -1], [-1, -1], -1.0),  # always there: a quarter for each hit
        ([-1, -1, -1, -1], [-1, 1, 1, 1], 3.0 - 5 * 0.25),  # waited, then left
        ([1, 1, -1], [-1, -1], 2.0 - 3 * 0.25),  # came, and stayed
        ([1, -1, 1, -1], [-1, 1, -1, 1], 1.0 + 1.0 - 4 * 0.25),  # foliage: nothing adds up
        ([-1, 1, 1], [1, 1], 2.0 + 1.0 - 0.25),  # another thing was there before: 1 more against the see-throughs
        ([], [], 0.0),
    ],
)
def test_votes_are_weighed_as_coming_and_leaving(before, after, net):
    assert net_of(before, after)[0] == pytest.approx(net)


def test_see_throughs_and_hits_are_counted():
    assert net_of([1, -1, 0], [0.5, -1])[1:] == (2, 2)


def vote_of(code, other_range=10.0, own_range=10.0, height=5.0, row_height=0.006, miss=0.0):
    votes = np.zeros(1, np.int8)
    ranges, own, heights, misses = (np.array([v], np.float32) for v in (other_range, own_range, height, miss))
    pitch, near = np.float32(row_height), 0.25
    weigh_looks(np.array([code], np.uint8), ranges, misses, own, heights, pitch, near, 0.5, np.arange(1), votes)
    return votes[0] / ONE


def test_a_hit_a_see_through_and_a_blocked_look_weigh_minus_one_one_and_nothing():
    assert [vote_of(code) for code in (HIT, THROUGH, BLOCKED)] == [-1.0, 1.0, 0.0]


def test_a_see_through_from_four_times_as_far_weighs_half():
    assert vote_of(THROUGH, other_range=40.0) == pytest.approx(0.5, abs=0.02)


def test_a_see_through_just_above_the_ground_weighs_by_rows():
    # Rows are 0.006 * 10 m = 6 cm apart there: 3 cm above the ground is a quarter of two rows.
    assert vote_of(THROUGH, height=0.03) == pytest.approx(0.25, abs=0.02)


def test_far_below_a_guessed_ground_height_means_nothing():
    assert vote_of(THROUGH, height=-2.0) == 1.0


def test_a_weak_see_through_counts_half_and_not_from_nearby():
    assert vote_of(WEAK) == pytest.approx(0.5)
    assert vote_of(WEAK, other_range=3.9) == 0.0


def test_points_hit_by_all_asked_are_closed():
    votes = np.array([[-ONE, -ONE, ONE, 0], [-ONE, 0, -ONE, 0], [ONE, ONE, ONE, ONE]], np.int8)
    is_asked = np.array([True, True, False])
    assert find_open(votes, is_asked, 2).tolist() == [1, 2, 3]


def test_a_row_of_rays_that_passed_half_a_metre_off_counts_half():
    assert vote_of(THROUGH, miss=0.5) == pytest.approx(0.5, abs=0.02)


def test_lone_points_are_believed_less_and_hits_as_before():
    votes = np.array([[ONE, ONE], [-ONE, ONE]], np.int8)
    ids = find_seen_through(votes)
    weaken_lone(votes, ids, np.array([False, True]), 0.5)
    assert ids.tolist() == [0, 1]
    assert votes.tolist() == [[ONE // 2, ONE], [-ONE, ONE]]
