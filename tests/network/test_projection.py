import numpy as np
import pytest
from grids import even_grid

from automos.network.projection import SINE_BINS, ImageGrid, beam_grid, nearest_points, project
from automos.simulation import SENSORS
from automos.simulation.sensing.sensors import SENSORS as PATTERNS


def at(azimuth_deg: float, elevation_deg: float, r: float) -> list[float]:
    a, e = np.radians([azimuth_deg, elevation_deg])
    return [r * np.cos(e) * np.cos(a), r * np.cos(e) * np.sin(a), r * np.sin(e)]


def test_pixels_are_those_of_the_papers_formula():
    grid = even_grid(64, 2048, up_deg=3.0, down_deg=-25.0)
    points = np.array([at(0.01, 2.9, 10), at(90.01, -11.2, 5), at(-179.99, -24.9, 3), at(179.99, 0.0, 7)], np.float32)
    pixels, ranges = project(points, grid)
    # u = floor((1 - azimuth / 180 deg) / 2 * 2048), v = floor((3 - elevation) / 28 * 64)
    assert pixels.tolist() == [0 * 2048 + 1023, 32 * 2048 + 511, 63 * 2048 + 2047, 6 * 2048 + 0]
    assert np.allclose(ranges, [10, 5, 3, 7])


def test_points_beyond_the_beams_go_to_the_nearest_row():
    pixels, _ = project(np.array([at(0, 40, 5), at(0, -60, 5)], np.float32), even_grid(16, 32, 10, -10))
    assert (pixels // 32).tolist() == [0, 15]


def test_points_that_are_none_have_no_pixel():
    points = np.array([[np.nan, 0, 0], [0, 0, 0], [np.inf, 1, 1], [0.01, 0, 0], [1, 0, 0]], np.float32)
    pixels, ranges = project(points, even_grid(16, 32, 10, -10))
    assert (pixels >= 0).tolist() == [False, False, False, False, True]
    assert ranges[:4].tolist() == [0, 0, 0, 0]


def test_the_nearest_point_wins_and_of_equals_the_first_also_where_it_is_point_zero():
    pixels = np.array([4, 4, 4, 2, -1, 2], np.int32)
    ranges = np.array([5.0, 7.0, 5.0, 3.0, 0.0, 2.0], np.float32)
    assert nearest_points(pixels, ranges, 6).tolist() == [-1, -1, 5, -1, 0, -1]


def test_a_grid_wants_its_whole_table():
    with pytest.raises(ValueError, match="row_of_sine must be"):
        ImageGrid(16, 32, np.zeros(3, np.float32))


def grid_of(elevations_deg, height: int) -> ImageGrid:
    """Return the grid of beams at exactly these elevations."""
    up = np.sort(np.radians(elevations_deg))
    sines = np.linspace(-1, 1, SINE_BINS + 1)
    gap = np.diff(up).mean()
    padded = np.concatenate([[up[0] - gap], up, [up[-1] + gap]])
    beam = np.interp(np.arcsin(sines), padded, np.arange(-1, len(up) + 1) + 0.5)
    return beam_grid(height, 64, beam, len(up))


@pytest.mark.parametrize("name", [name for name in SENSORS if PATTERNS[name].rosette is None])
def test_every_beam_of_a_spinning_sensor_has_a_row_of_its_own(name):
    sensor = PATTERNS[name]
    points = np.array([at(10.0, e, 20.0) for e in sensor.elevations], np.float32)
    pixels, _ = project(points, grid_of(sensor.elevations, sensor.beams))
    rows = pixels // 64
    order = np.argsort(-np.asarray(sensor.elevations))  # from the top down
    # the table has steps of 0.03 degrees; only the densest beams of the VLS-128 are 0.11 degrees apart
    assert np.mean(rows[order] == np.arange(sensor.beams)) > 0.95
    assert np.abs(rows[order] - np.arange(sensor.beams)).max() <= 1


def test_beams_are_shared_out_evenly_among_fewer_rows():
    elevations = np.linspace(10, -20, 64)
    points = np.array([at(10.0, e, 20.0) for e in elevations], np.float32)
    rows = project(points, grid_of(elevations, 32))[0] // 64
    assert np.bincount(rows, minlength=32).tolist() == [2] * 32
