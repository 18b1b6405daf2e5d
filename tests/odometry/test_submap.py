import numpy as np
import pytest
from worlds import Block, drive, record

from automos.core.geometry import se3_exp
from automos.odometry.submap import fit_surfels, make_submap
from automos.odometry.surfels import Surfels, make_surfels

RNG = np.random.default_rng(1)
KERNEL = {"kernel": 0.5}


def patch(corner, one, other, n=6000):
    """Return n points on the parallelogram spanned by `one` and `other` at `corner`, with a centimetre of noise."""
    u, v = RNG.uniform(0, 1, (2, n, 1))
    return np.asarray(corner) + u * np.asarray(one) + v * np.asarray(other) + RNG.normal(0, 0.01, (n, 3))


def surfels_of(*patches) -> Surfels:
    return make_surfels(np.concatenate(patches).astype(np.float32), None)


def ground():
    return patch([-12, -12, -1.8], [24, 0, 0], [0, 24, 0])


def wall_left():
    return patch([-12, 8, -1.8], [24, 0, 0], [0, 0, 6])


def wall_ahead():
    return patch([12, -12, -1.8], [0, 20, 0], [0, 0, 6])


def submap_of(surfels):
    return make_submap([surfels], np.eye(4)[None])


def best_move(submap, surfels, T):
    """Return T after a few Gauss-Newton steps."""
    for _ in range(6):
        fit = fit_surfels(submap, surfels, T, **KERNEL)
        T = se3_exp(-np.linalg.solve(fit.H, fit.g)) @ T
    return T


def test_three_planes_hold_a_scan_in_all_six_directions():
    surfels = surfels_of(ground(), wall_left(), wall_ahead())
    again = surfels_of(ground(), wall_left(), wall_ahead())  # other points on the same surfaces
    start = se3_exp([0.15, -0.1, 0.1, 0.004, -0.004, 0.01])
    np.testing.assert_allclose(best_move(submap_of(surfels), again, start), np.eye(4), atol=0.01)


def test_a_corridor_says_nothing_about_the_way_along_it():
    surfels = surfels_of(ground(), wall_left())
    fit = fit_surfels(submap_of(surfels), surfels, np.eye(4), **KERNEL)
    along, across, up = np.diag(fit.H)[:3]
    assert along < 0.05 * min(across, up)


def test_what_the_same_beams_hit_further_on_does_not_hold_a_sensor_along_a_corridor():
    walls = [Block((0.0, side, 3.0), (200.0, 2.0, 6.0)) for side in (12.0, -12.0)]
    facing = Block((20.0, 6.0, 2.0), (1.0, 3.0, 4.0))
    for blocks, least, most in (((*walls,), 0.0, 1e-4), ((*walls, facing), 1e-3, 1.0)):
        world = record(blocks, drive(8), n_beams=16)
        first, later = (make_surfels(world.sequence[i].points, None) for i in (0, 7))
        fit = fit_surfels(submap_of(first), later, world.poses[7], **KERNEL)
        assert least <= fit.H[0, 0] / fit.H[1, 1] < most


def test_a_post_holds_along_the_corridor_but_not_upwards():
    post = patch([4.0, 4.0, -1.5], [0.1, 0, 0], [0, 0.05, 4.0], 300)
    surfels = surfels_of(post)
    fit = fit_surfels(submap_of(surfels), surfels, np.eye(4), **KERNEL)
    assert fit.n_matched > 0
    assert fit.H[2, 2] < 0.05 * fit.H[0, 0]


def test_a_ring_lying_on_the_ground_says_nothing():
    azimuth = np.linspace(0, 2 * np.pi, 3000)
    ring = np.stack([10 * np.cos(azimuth), 10 * np.sin(azimuth), np.full(3000, -1.8)], axis=1)
    surfels = make_surfels((ring + RNG.normal(0, 0.01, ring.shape)).astype(np.float32), None)
    assert fit_surfels(submap_of(surfels), surfels, np.eye(4), **KERNEL).n_matched == 0


def test_distance_from_a_plane_is_counted_and_measured():
    surfels = surfels_of(ground())
    lifted = se3_exp([0, 0, 0.15, 0, 0, 0])
    on, off = (fit_surfels(submap_of(surfels), surfels, T, **KERNEL) for T in (np.eye(4), lifted))
    assert on.n_close == on.n_matched
    assert off.n_close == 0
    assert on.thickness < 0.02
    assert off.thickness == pytest.approx(0.15, abs=0.02)


def test_scans_are_merged_in_the_submaps_frame():
    ahead = se3_exp([3.0, 1.0, 0.0, 0.0, 0.0, 0.3])
    surfels = surfels_of(ground(), wall_left(), wall_ahead())
    moved = make_submap([surfels], ahead[None])
    fit = fit_surfels(moved, surfels, ahead, **KERNEL)
    assert fit.n_close > 0.99 * fit.n_matched > 0.5 * len(surfels)


def test_nothing_lies_on_nothing():
    nothing = make_surfels(np.zeros((0, 3), np.float32), None)
    surfels = surfels_of(ground())
    for submap, laid in ((submap_of(nothing), surfels), (submap_of(surfels), nothing)):
        fit = fit_surfels(submap, laid, np.eye(4), **KERNEL)
        assert fit.n_matched == 0
        assert not fit.H.any()
