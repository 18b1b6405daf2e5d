import numpy as np
import pytest

from automos.core.beam_pattern import learn_pattern
from automos.core.cells import rough_turn_of
from automos.core.scan import Frame


def frame_of(azimuth, elevation, seed=0, time=None, motion=None):
    ranges = np.random.default_rng(seed).uniform(5.0, 50.0, len(azimuth))
    points = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], 1)
    points = (ranges[:, None] * points).astype(np.float32)
    return Frame(points, np.arange(len(points)), len(points), np.eye(4), 0.0, time, motion)


def grid(elevations_deg, step_deg):
    azimuth, elevation = np.meshgrid(np.radians(np.arange(-180.0, 180.0, step_deg)), np.radians(elevations_deg))
    return azimuth.ravel(), elevation.ravel()


@pytest.mark.parametrize(
    ("elevations", "step"),
    [
        (np.arange(-15.0, 16.0, 2.0), 0.2),
        (np.linspace(-22.5, 22.5, 128), 0.3515625),
        (np.concatenate([np.linspace(-25.0, -8.8, 32), np.linspace(-8.3, 2.0, 32)]), 0.1728),
    ],
    ids=["16 sparse beams", "128 even beams", "64 beams in two blocks"],
)
def test_rows_and_columns_of_spinning_sensors_are_found(elevations, step):
    rng = np.random.default_rng(1)
    azimuth, elevation = grid(elevations, step)
    kept = rng.random(len(azimuth)) < 0.8  # a fifth of the rays returns nothing
    pattern = learn_pattern([frame_of(azimuth[kept], elevation[kept] + rng.normal(0.0, 1e-4, kept.sum()))])
    assert pattern.n_columns == pytest.approx(360.0 / step, rel=0.02)
    assert pattern.n_rows == pytest.approx(len(elevations), rel=0.2)
    rows = pattern.row_of_sine[((np.sin(np.radians(elevations)) + 1.0) * 2048).astype(int)]
    assert (np.diff(rows) > 0).all()
    assert rows[0] >= -0.5
    assert rows[-1] <= pattern.n_rows + 0.5


def test_coordinates_rounded_to_centimetres_hide_no_pattern():
    azimuth, elevation = grid(np.arange(-15.0, 16.0, 2.0), 0.2)
    exact = frame_of(azimuth, elevation)
    rounded = (np.round(exact.points / 0.02) * 0.02).astype(np.float32)
    pattern = learn_pattern([Frame(rounded, exact.kept, exact.n_points, np.eye(4), 0.0)])
    assert pattern.n_columns == pytest.approx(1800, rel=0.05)
    assert pattern.n_rows == pytest.approx(16, rel=0.3)


def test_a_pattern_that_never_repeats_gets_square_cells_of_one_ray():
    rng = np.random.default_rng(2)
    pattern = learn_pattern([frame_of(rng.uniform(-0.6, 0.6, 24_000), rng.uniform(-0.6, 0.6, 24_000))])
    spacing = np.sqrt(1.2 * 1.2 / 24_000)  # radians
    assert pattern.column_width == pytest.approx(spacing, rel=0.2)
    assert pattern.row_height == pytest.approx(spacing, rel=0.2)


def test_when_a_spinning_sensor_looks_where_is_learnt():
    azimuth, elevation = grid(np.arange(-15.0, 16.0, 2.0), 0.4)
    time = (-azimuth / (2.0 * np.pi)).astype(np.float32)  # clockwise, from behind
    pattern = learn_pattern([frame_of(azimuth, elevation, time=time, motion=np.zeros(6))])
    left = int(rough_turn_of(np.float32(0.0), np.float32(1.0)) * 360)
    assert pattern.sweep_time[left] == pytest.approx(-0.25, abs=0.01)


def test_directions_without_a_fixed_time_get_none():
    rng = np.random.default_rng(3)
    azimuth, elevation = rng.uniform(-0.6, 0.6, 9000), rng.uniform(-0.6, 0.6, 9000)
    time = rng.uniform(-0.5, 0.5, 9000).astype(np.float32)
    pattern = learn_pattern([frame_of(azimuth, elevation, time=time, motion=np.zeros(6))])
    assert not pattern.sweep_time.any()


@pytest.mark.parametrize("at", [[5.0, 0.0, 0.0], [0.0, 0.0, 7.0]], ids=["at one place", "overhead"])
@pytest.mark.parametrize("along", [0.0, 1.0], ids=["a point", "a line"])
def test_points_on_a_line_or_at_one_place_show_no_pattern_and_none_of_it_is_nan(at, along):
    points = np.tile(np.array(at, np.float32), (300, 1))
    points[:, 1] += along * np.linspace(0.0, 3.0, 300, dtype=np.float32)
    frame = Frame(points, np.arange(300), 300, np.eye(4), 0.0)
    pattern = learn_pattern([frame])
    assert np.isfinite(pattern.row_of_sine).all()
    assert np.isfinite([pattern.row_height, pattern.column_width]).all()
