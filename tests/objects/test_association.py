from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from automos.core.upright_boxes import Boxes
from automos.objects import filter as kalman
from automos.objects.association import ANOTHER, Objects, assign, association_cost, cost_of_none, motion_cost
from automos.objects.detections import Detections
from automos.settings import AssociationSettings, FilterSettings, GateSettings

OPEN = {"max_distance": 100.0, "max_overlap_cost": 1.0, "max_volume_cost": 1.0}


def box(x=0.0, size=(1.0, 1.0, 1.0)) -> Boxes:
    return Boxes(np.array([[x, 0.0, 0.0]]), np.array([size], float), np.zeros(1), np.ones(1))


def cost(a: Boxes, b: Boxes, **settings) -> float:
    return float(association_cost(a, b, AssociationSettings(**settings))[0, 0])


# ----------------------------------------------------------------------------------------------------- cost, gates
def test_the_cost_by_hand():
    # 0.5 m apart; overlap 0.5 of 1 + 2 - 0.5; volumes 1 and 2
    a, b = box(), box(0.5, (1.0, 1.0, 2.0))
    assert cost(a, b) == pytest.approx(0.5 + (1.0 - 0.2) + 0.5)
    assert cost(a, a) == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("a", "b", "gate"),
    [
        (box(size=(10, 2, 2)), box(1.99, (10, 2, 2)), None),
        (box(size=(10, 2, 2)), box(2.01, (10, 2, 2)), "max_distance"),
        (box(), box(0.90), None),  # overlap 0.1 / 1.9: cost 0.947
        (box(), box(0.91), "max_overlap_cost"),  # 0.09 / 1.91: 0.953
        (box(), box(size=(1, 1, 3.3)), None),  # 1 / 3.3: cost 0.697
        (box(), box(size=(1, 1, 3.4)), "max_volume_cost"),  # 0.706
        (box(size=(1, 1, 3.4)), box(), "max_volume_cost"),
    ],
    ids=["near", "far", "overlapping", "hardly overlapping", "three times as large", "too large", "too small"],
)
def test_each_gate_closes_by_itself(a, b, gate):
    assert np.isfinite(cost(a, b)) == (gate is None)
    for name, value in OPEN.items():
        assert np.isfinite(cost(a, b, **{name: value})) == (gate in (None, name))


def test_a_flat_box_fits_nothing():
    assert cost(box(size=(1, 1, 0)), box(size=(1, 1, 0))) == np.inf


@pytest.mark.parametrize(("n_tracked", "n_detected"), [(0, 0), (0, 3), (2, 0), (2, 3)])
def test_a_row_is_a_track_and_a_column_a_detection(n_tracked, n_detected):
    parts = [Boxes.concatenate([box(float(i)) for i in range(n)]) for n in (n_tracked, n_detected)]
    assert association_cost(*parts, AssociationSettings()).shape == (n_tracked, n_detected)


# --------------------------------------------------------------------------------------------- cost of the default
def cost_of_seeing(before: Boxes, now: Boxes, sights: float = 10.0) -> float:
    """Return what it costs that something stood where `before` is and is seen as `now` a tenth of a second later."""
    noise, count, nothing = FilterSettings(), np.full(1, 100.0), np.zeros(1)
    belief = kalman.start(before, noise, noise.initial_velocity_variance)
    for _ in range(10):
        belief = kalman.update(kalman.predict(belief, 0.1, noise), before, noise)
    belief.mean[:, kalman.VELOCITY] = 0.0
    belief = kalman.predict(belief, 0.1, noise)
    one = np.zeros(1, np.int64)
    objects = Objects(
        belief.mean, belief.covariance, one, nothing, one + 1, nothing + sights, nothing + 10.0, np.full(1, 0.5), count
    )
    return float(motion_cost(objects, Detections.of_objects(now, count, nothing, nothing), noise, GateSettings())[0, 0])


@pytest.mark.parametrize(
    ("before", "now", "is_possible"),
    [
        (box(size=(14.2, 1.5, 3.8)), box(2.5, (16.0, 2.4, 3.8)), True),
        (box(size=(4, 2, 1.5)), box(2.0, (4, 2, 1.5)), True),
        (box(size=(4, 2, 1.5)), box(4.0, (4, 2, 1.5)), False),
        (box(size=(14.2, 1.5, 3.8)), box(2.5, (1.0, 1.0, 1.8)), False),
    ],
    ids=["an end comes into sight", "half a car's length", "a car in its place behind", "a walker beside a lorry"],
)
def test_what_is_where_an_object_must_be_is_that_object_if_it_is_of_its_size(before, now, is_possible):
    assert np.isfinite(cost_of_seeing(before, now)) == is_possible


def test_the_nearer_of_two_that_overlap_is_the_cheaper():
    lorry = box(size=(14.0, 2.4, 3.8))
    assert cost_of_seeing(lorry, box(2.0, (15.0, 2.4, 3.8))) < cost_of_seeing(lorry, box(4.0, (15.0, 2.4, 3.8)))


# ------------------------------------------------------------------------------------------------------ assignment
def test_whose_place_is_known_is_preferred_to_one_that_could_be_anywhere():
    # Two tracks of one thing, of which one was missed for a while: it does not take turns with the other one.
    noise = FilterSettings()
    covariance = np.array([0.1, 1.0])[:, None, None] * np.eye(10)
    mean = kalman.start(Boxes.concatenate([box(0.3), box(0.0)]), noise, 100.0).mean
    two, count = np.zeros(2, np.int64), np.array([50.0])
    objects = Objects(
        mean, covariance, two, np.zeros(2), two, *np.full((2, 2), 10.0), np.full(2, 0.5), np.full(2, 50.0)
    )
    found = Detections.of_objects(box(0.0), count, np.zeros(1), np.zeros(1))
    known, vague = motion_cost(objects, found, noise, GateSettings())[:, 0]
    r = noise.measurement_variance
    assert vague - known == pytest.approx(2.0 * np.log((1.0 + r) / (0.1 + r)) - 0.3**2 / (0.1 + r))
    assert known < vague


def best_by_brute_force(table: np.ndarray) -> tuple[int, float]:
    """Return the most pairs possible and the least cost of so many, by trying all."""
    n_rows, n_columns = table.shape
    for n_pairs in range(min(n_rows, n_columns), 0, -1):
        costs = [
            table[list(rows), list(columns)].sum()
            for rows in combinations(range(n_rows), n_pairs)
            for columns in permutations(range(n_columns), n_pairs)
        ]
        if np.isfinite(min(costs)):
            return n_pairs, min(costs)
    return 0, 0.0


@given(st.integers(0, 10**6), st.integers(1, 5), st.integers(1, 5), st.sampled_from([0.0, 0.4, 0.8]))
def test_the_assignment_has_the_most_pairs_and_then_the_least_cost(seed, n_rows, n_columns, forbidden):
    rng = np.random.default_rng(seed)
    # a few very dear pairs, which a greedy or a soft assignment would leave out
    table = np.where(rng.random((n_rows, n_columns)) < 0.2, 50.0, rng.random((n_rows, n_columns)))
    table[rng.random(table.shape) < forbidden] = np.inf
    rows, columns = assign(table)
    n_pairs, least = best_by_brute_force(table)
    assert len(rows) == len(columns) == n_pairs
    assert len(set(rows)) == len(set(columns)) == n_pairs
    assert table[rows, columns].sum() == pytest.approx(least)


def test_two_dear_pairs_go_before_one_cheap_pair():
    rows, columns = assign(np.array([[0.1, 50.0], [50.0, np.inf]]))
    assert sorted(zip(rows.tolist(), columns.tolist(), strict=True)) == [(0, 1), (1, 0)]


def test_two_dear_pairs_do_not_go_before_a_cheap_one_and_its_alternative():
    table, dear = np.array([[1.0, 18.0], [19.0, np.inf]]), np.full((2, 1), 20.0)
    assert [pair.tolist() for pair in assign(table, dear)] == [[0], [0]]
    assert sorted(assign(table, 2.0 * dear)[1].tolist()) == [0, 1]
    assert len(assign(table + 20.0, dear)[0]) == 0


@given(st.integers(0, 10**6), st.integers(1, 4), st.integers(1, 4))
def test_with_an_alternative_the_cost_of_all_is_least(seed, n_rows, n_columns):
    rng = np.random.default_rng(seed)
    table = np.where(rng.random((n_rows, n_columns)) < 0.3, np.inf, rng.uniform(0.0, 30.0, (n_rows, n_columns)))
    none = rng.uniform(10.0, 30.0, (n_rows, 1))
    rows, columns = assign(table, none)
    saved = np.pad(np.minimum(table - none, 0.0), ((0, 0), (0, n_rows)))  # to have none is to have one of the padding
    best = min(saved[range(n_rows), p].sum() for p in permutations(range(n_rows + n_columns), n_rows))
    assert (table[rows, columns] - none[rows, 0]).sum() == pytest.approx(best)


def test_what_was_seen_in_few_scans_is_seen_now_with_their_share():
    seldom, always = (cost_of_seeing(box(), box(0.3), sights) for sights in (1.0, 10.0))
    assert seldom - always == pytest.approx(2.0 * np.log((11.0 / 12.0) / (2.0 / 12.0)))


def test_that_what_was_always_seen_is_not_seen_now_is_the_dearer():
    two, one, mean = np.zeros(2, np.int64), np.zeros((2, 1)), np.zeros((2, 10))
    scans, sights = np.array([10.0, 10.0]), np.array([10.0, 1.0])
    objects = Objects(mean, mean[:, :, None], two, one, two, sights, scans, one, one)
    expected = ANOTHER - 2.0 * np.log([[1.0 / 12.0], [10.0 / 12.0]])
    np.testing.assert_allclose(cost_of_none(objects), expected)


@pytest.mark.parametrize("shape", [(0, 0), (0, 3), (2, 0), (2, 3)])
def test_where_no_pair_is_allowed_none_is_made(shape):
    rows, columns = assign(np.full(shape, np.inf))
    assert len(rows) == len(columns) == 0
