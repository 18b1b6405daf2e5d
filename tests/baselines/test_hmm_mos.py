"""HMM-MOS's states and counts, on a grid of voxels of half a metre."""

import numpy as np

from automos.baselines.brick_grid import BrickGrid
from automos.baselines.hmm_mos import Parameters, _Voxels

ORIGIN = np.array([0.25, 0.25, 0.25])
ABOUT = Parameters(voxel=0.5, deviation=0.5)


def wall(x: float) -> np.ndarray:
    """Return points on a wall of 10 x 5 m across the view."""
    y, z = np.meshgrid(np.arange(-4.75, 5.0, 0.5), np.arange(-2.25, 2.5, 0.5))
    return np.column_stack([np.full(y.size, x), y.ravel(), z.ravel()])


def box(x: float) -> np.ndarray:
    """Return points on the front of a box of 1.5 m, in the middle of the view."""
    y, z = np.meshgrid([-0.25, 0.25, 0.75], [-0.25, 0.25, 0.75])
    return np.column_stack([np.full(y.size, x), y.ravel(), z.ravel()])


def observed(scans: list[np.ndarray]) -> list[np.ndarray]:
    """Return for each scan which of its points move."""
    grid = BrickGrid(ABOUT.voxel, ORIGIN[None], 30.0)
    ids = [grid.add(points) for points in scans]
    grid.widen(ABOUT.reach)
    voxels = _Voxels(grid, ABOUT)
    return [voxels.observe(k, ORIGIN, np.unique(hit))[hit] for k, hit in enumerate(ids)]


def test_what_comes_where_rays_passed_moves_and_the_wall_behind_it_does_not():
    empty, back = wall(20.25), wall(20.25)
    came = [np.concatenate([back, box(10.25 - 0.5 * k)]) for k in range(3)]
    found = observed([empty] * 8 + came)
    assert not np.concatenate(found[:8]).any()
    for mask in found[8:]:
        assert mask[len(back) :].all()
        assert not mask[: len(back)].any()


def test_what_comes_where_nobody_looked_before_does_not_move():
    back = wall(20.25)
    aside = box(10.25) + np.array([0.0, 12.0, 0.0])  # no ray ever went there
    found = observed([back] * 8 + [np.concatenate([back, aside])])
    assert not found[-1].any()


def test_a_change_in_the_first_scans_is_not_believed():
    back = wall(20.25)
    found = observed([back] * 3 + [np.concatenate([back, box(10.25)])])
    assert not found[-1].any()
