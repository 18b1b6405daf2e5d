import numpy as np
import pytest

from automos.evidence.look_through import BLOCKED, HIT, THROUGH, WEAK
from automos.evidence.votes import ONE, count_hits, sum_votes, weigh_looks


def net_of(before, after, stay_weight=0.25):
    """Net evidence of one point from votes before and after, in time order."""
    votes = np.array([ONE * v for v in (*before, *after)], np.int8)[:, None]
    return float(sum_votes(votes, len(before), stay_weight)[0])


@pytest.mark.parametrize(
    ("before", "after", "net"),
    [
        ([1, 1, 1], [1, 1, 1], 6.0),  # passed through
        ([-1, -1], [-1, -1], -1.0),  # always there: a quarter for each hit
        ([-1, -1, -1, -1], [-1, 1, 1, 1], 3.0 - 5 * 0.25),  # waited, then left
        ([1, 1, -1], [-1, -1], 2.0 - 3 * 0.25),  # came, and stayed
        ([1, -1, 1, -1], [-1, 1, -1, 1], 1.0 + 1.0 - 4 * 0.25),  # foliage: nothing adds up
        ([-1, 1, 1], [1, 1], 2.0 + 1.0 - 0.25),  # another thing was there before: 1 more against the votes for free
        ([], [], 0.0),
    ],
)
def test_votes_are_weighed_as_coming_and_leaving(before, after, net):
    assert net_of(before, after) == pytest.approx(net)


def test_hits_are_counted():
    assert count_hits(np.array([[ONE, 0], [-ONE, ONE], [-ONE, 32]], np.int8)).tolist() == [2, 0]


def vote_of(code, other_range=10.0, own_range=10.0, height=5.0, row_height=0.006, trust=1.0):
    ranges, own, heights = (np.array([v], np.float32) for v in (other_range, own_range, height))
    about = (ranges, own, heights, np.array([trust]))
    return weigh_looks(np.array([code], np.uint8), *about, np.float32(row_height))[0] / ONE


def test_a_hit_a_free_space_observation_and_a_blocked_look_weigh_minus_one_one_and_nothing():
    assert [vote_of(code) for code in (HIT, THROUGH, BLOCKED)] == [-1.0, 1.0, 0.0]


def test_a_place_observed_free_from_four_times_as_far_weighs_half():
    assert vote_of(THROUGH, other_range=40.0) == pytest.approx(0.5, abs=0.02)


def test_a_place_observed_free_just_above_the_ground_weighs_by_rows():
    # Rows are 0.006 * 10 m = 6 cm apart there: 3 cm above the ground is a quarter of two rows.
    assert vote_of(THROUGH, height=0.03) == pytest.approx(0.25, abs=0.02)


def test_far_below_a_guessed_ground_height_means_nothing():
    assert vote_of(THROUGH, height=-2.0) == 1.0


def test_a_weak_free_space_observation_does_not_count_from_nearby():
    assert vote_of(WEAK) == 1.0
    assert vote_of(WEAK, other_range=3.9) == 0.0


def test_what_no_neighbouring_ray_has_met_is_believed_less_and_its_hits_as_before():
    assert vote_of(THROUGH, trust=0.25) == pytest.approx(0.25)
    assert vote_of(HIT, trust=0.25) == -1.0
