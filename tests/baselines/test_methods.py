"""Every method on one small world: what went by leaves, what stands stays."""

from functools import cache

import numpy as np
import pytest
from rival_worlds import GROUND, HIDDEN, MOVER, PARKED, WALLS, Yard

from automos.baselines import methods, octomap, pfreundschuh
from automos.baselines.height_images import HeightImages
from automos.baselines.methods import BASELINES, published
from automos.settings import load_settings

SCANS = range(12, 36)
"""Methods that use only the past know too little before."""

# Least recall of the mover, and what may be called moving of walls, of the wall that the mover passes before, and of a
# parked car. ERASOR's bins hold more than the mover; OctoMap takes away what rays graze along; the others do not.
EXPECTED = {
    "octomap": (0.8, 0.2, 0.05, 0.15),
    "removert": (0.8, 0.01, 0.08, 0.02),
    "erasor": (0.7, 0.15, 0.3, 0.1),
    "pfreundschuh": (0.8, 0.01, 0.02, 0.02),
    "yoon": (0.8, 0.01, 0.02, 0.02),
    "dufomap": (0.4, 0.01, 0.02, 0.02),
    "m_detector": (0.8, 0.01, 0.02, 0.02),
    "hmm_mos": (0.4, 0.01, 0.02, 0.02),
}


METHODS = [pytest.param(name, marks=pytest.mark.slow) if name == "hmm_mos" else name for name in sorted(BASELINES)]
"""All; the slowest has tests of its own, too."""


@pytest.fixture(scope="module")
def yard():
    return Yard()


@cache
def masks_of(method, yard):
    """Return what a method calls moving in each scan."""
    if method == "dufomap":
        pytest.importorskip("dufomap")
    quicker = {
        "octomap": octomap.Parameters(ground=HeightImages(cells=(0.1, 0.15, 0.2))),
        "pfreundschuh": pfreundschuh.Parameters(voxel=0.4),
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(methods, "published", lambda name: quicker.get(name) or published(name))
        found = list(BASELINES[method].find_moving(yard, yard.stamps, load_settings(), 0))
    assert [i for i, _ in found] == list(range(len(yard)))
    return [mask for _, mask in found]


@pytest.fixture(scope="module", params=METHODS)
def found(request, yard):
    """Return a method's name and what it calls moving in each scan."""
    return request.param, masks_of(request.param, yard)


def share(found, pick) -> float:
    """Return how much of what `pick` picks in each scan was called moving."""
    return sum((found[i] & pick(i)).sum() for i in SCANS) / sum(pick(i).sum() for i in SCANS)


def test_there_is_one_answer_per_point(found, yard):
    assert all(mask.dtype == bool and len(mask) == len(yard[i].points) for i, mask in enumerate(found[1]))


def test_a_mover_leaves(found, yard):
    method, masks = found
    assert share(masks, lambda i: yard.of(i, MOVER)) >= EXPECTED[method][0]


def test_walls_stay(found, yard):
    method, masks = found
    assert share(masks, lambda i: yard.of(i, *WALLS)) <= EXPECTED[method][1]


def test_a_wall_that_was_hidden_for_a_while_stays(found, yard):
    method, masks = found
    assert yard.of(20, HIDDEN).sum() < 0.6 * yard.of(12, HIDDEN).sum()  # the mover stands before it
    assert share(masks, lambda i: yard.of(i, HIDDEN)) <= EXPECTED[method][2]


def test_a_parked_car_stays(found, yard):
    method, masks = found
    assert share(masks, lambda i: yard.of(i, PARKED)) <= EXPECTED[method][3]


def test_the_ground_stays(found, yard):
    assert share(found[1], lambda i: yard.block[i] == GROUND) <= 0.02


@pytest.mark.parametrize("method", ["m_detector", "yoon", pytest.param("hmm_mos", marks=pytest.mark.slow), "removert"])
def test_a_run_that_starts_later_finds_the_same(method, yard):
    whole = masks_of(method, yard)
    late = dict(BASELINES[method].find_moving(yard, yard.stamps, load_settings(), 30))
    assert list(late) == list(range(30, 36))
    assert any(mask.any() for mask in late.values())
    # M-detector remembers what it called moving, so a later start may differ at the edges of the mover
    assert np.mean([(late[i] == whole[i]).mean() for i in late]) > 0.999


@pytest.mark.parametrize("method", sorted(set(BASELINES) - {"dufomap"}))
def test_scans_without_points_are_answered_without_points(method):
    empty = Yard(blocks=(), n_scans=4, n_beams=2, n_columns=8)
    for frame in empty._frames:
        object.__setattr__(frame, "points", np.zeros((0, 3), np.float32))
    found = list(BASELINES[method].find_moving(empty, empty.stamps, load_settings(), 0))
    assert [len(mask) for _, mask in found] == [0, 0, 0, 0]
