"""Ground stands still: what a scan takes for ground is mended by what the scans before it saw."""

import numpy as np
import pytest

from automos.evidence.ground import STEP, map_ground
from automos.evidence.height_map import SECTORS, GroundMap, above_ground, rays_above, surface_of
from automos.evidence.steady_ground import mended
from automos.settings import GroundSettings

WIDTH = 24
S = GroundSettings()


def seen(heights, corner=(0.0, 0.0), is_seen=True):
    """Return a map of cells of half a metre with the `heights` of some, by row and column."""
    cells = np.array([row * WIDTH + column for row, column in heights], np.int64)
    sectors = np.full(SECTORS, is_seen)
    values = np.array(list(heights.values()), np.float32)
    sight = np.full((SECTORS, WIDTH // 2), np.inf, np.float16)
    return GroundMap(np.array([6.0, 6.0, 1.8]), np.array(corner), 0.5, WIDTH, cells, values, sectors, -1.0, sight)


def flat(rows=range(WIDTH), columns=range(WIDTH), height=0.0):
    return {(row, column): height for row in rows for column in columns}


def heights_of(ground):
    return {divmod(int(cell), ground.width): float(height) for cell, height in zip(*ground[4:6], strict=True)}


def test_what_is_higher_than_the_ground_around_as_it_was_seen_before_is_lowered():
    rail = {(12, column): 0.25 for column in range(8, 14)}
    now = mended(seen(flat(range(6)) | rail), [seen(flat(columns=range(0, WIDTH, 2)))])
    assert all(abs(surface_of(now)[cell]) < 0.01 for cell in rail)


def test_a_kerb_that_all_scans_see_stays():
    street = flat() | flat(range(12, WIDTH), height=0.11)
    now = mended(seen(street), [seen(street)] * 3)
    assert heights_of(now) == pytest.approx(street, abs=2e-3)


def test_unseen_cells_are_taken_from_before_but_never_raise_the_ground():
    bank, tram = flat(range(12, 18), height=0.1), flat(range(18, WIDTH), height=0.2)
    now = mended(seen(flat(range(12))), [seen(flat(range(12)) | bank | tram)])
    assert heights_of(now) == pytest.approx(flat(range(12)) | bank, abs=2e-3)
    assert surface_of(now).max() < STEP


def test_the_median_of_the_scans_before_counts():
    before = [seen(flat(height=height)) for height in (0.0, 0.0, 0.0)]
    before[1] = seen(flat() | {(20, 20): 0.29})
    assert heights_of(mended(seen(flat(range(12))), before))[20, 20] == pytest.approx(0.0, abs=2e-3)


def test_maps_lie_where_their_corners_say_and_a_drift_of_height_is_none_of_the_ground():
    hill = {(row, column): 0.02 * row + 0.01 * column for row, column in flat()}
    shifted = {
        (row - 4, column + 3): height + 0.4 for (row, column), height in hill.items() if row >= 4 and column < 21
    }
    own = {cell: height for cell, height in hill.items() if cell[0] < 14}
    now = heights_of(mended(seen(own), [seen(shifted, corner=(-1.5, 2.0))]))
    assert now == pytest.approx({c: h for c, h in hill.items() if c in now}, abs=5e-3)
    assert len(now) > len(own)


def test_nothing_before_or_no_ground_changes_nothing():
    ground = seen(flat(range(6)))
    assert mended(ground, []) is ground
    nowhere = seen({}, is_seen=False)
    assert mended(nowhere, [ground]) is nowhere
    assert mended(ground, [nowhere]) is ground


def test_the_lowest_row_on_a_car_behind_a_rail_is_no_ground():
    def sweep(start, hidden=(0.0, 0.0)):
        radius = start + 1.6 * np.arange(25)
        r, a = (grid.ravel() for grid in np.meshgrid(radius, np.radians(np.arange(0.0, 360.0, 0.5))))
        shown = ~((np.abs(a - np.pi) < 0.3) & (r > hidden[0]) & (r < hidden[1]))
        return np.stack([r * np.cos(a), r * np.sin(a), 0.0 * r], axis=1)[shown].astype(np.float32)

    a = np.pi + np.linspace(-0.1, 0.1, 60)
    row = np.stack([20.0 * np.cos(a), 20.0 * np.sin(a), np.full(60, 0.25)], axis=1).astype(np.float32)
    origin, now = np.array([0.0, 0.0, 1.8]), np.concatenate([sweep(3.0, (10.0, 26.0)), row])
    alone = map_ground(now, origin, S)
    before = [map_ground(sweep(3.0 + 0.3 * k), origin, S) for k in range(5)]
    assert above_ground(alone, now, S)[0][-60:].mean() > 0.9
    is_ground, height = above_ground(mended(alone, before), now, S)
    assert not is_ground[-60:].any()
    assert is_ground[:-60].mean() > 0.99
    np.testing.assert_allclose(height[-60:], 0.25, atol=0.02)


def test_who_stands_between_two_rows_that_met_the_ground_behind_is_no_ground():
    a = np.radians(np.arange(0.0, 360.0, 0.2))
    origin = np.array([0.0, 0.0, 1.8])

    def rows(*radii):
        return np.concatenate([np.stack([r * np.cos(a), r * np.sin(a), 0.0 * a], axis=1) for r in radii])

    road = rows(6.5, 7.6, 9.1, 11.3, 14.7, 21.1, 37.4).astype(np.float32)
    now, is_walker = road.copy(), (np.abs(a - 1.0) < 0.03)
    now[6 * len(a) :][is_walker] *= 32.5 / 37.4  # his feet end the row that met the ground behind
    now[6 * len(a) :][is_walker, 2] = 1.8 * (1.0 - 32.5 / 37.4)
    alone, before = map_ground(now, origin, S), [map_ground(road, origin, S)] * 4
    walker = np.flatnonzero(is_walker) + 6 * len(a)
    assert above_ground(alone, now, S)[0][walker].all()
    is_ground, height = above_ground(mended(alone, before), now, S)
    assert not is_ground[walker].any()
    assert np.delete(is_ground, walker).all()
    np.testing.assert_allclose(height[walker], 0.236, atol=0.03)
    # Where he stood in the scans before, the ground is not known by him either.
    with_him = [alone] * 3 + before
    assert not above_ground(mended(alone, with_him), now, S)[0][walker].any()
    # Two rays at least: one may be of a mirror image.
    assert above_ground(mended(alone, [alone] * 3 + before[:1]), now, S)[0][walker].all()


def test_rays_pass_over_what_lies_before_the_ground_that_they_meet():
    road = np.array([[r * np.cos(a), r * np.sin(a), 0.0] for r in (5.2, 20.2) for a in np.arange(0.0, 6.28, 0.005)])
    ground = map_ground(road.astype(np.float32), np.array([0.0, 0.0, 2.0]), S)
    places = np.array([[10.2, 0.0], [0.0, -15.2], [-2.0, 2.0], [25.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(rays_above(ground, places)[:3], [0.99, 0.50, 0.92], atol=0.03)
    assert np.isinf(rays_above(ground, places)[3])
    assert rays_above(ground, places)[4] == pytest.approx(2.0, abs=0.01)
