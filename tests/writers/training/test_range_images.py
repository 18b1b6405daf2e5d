"""Range images and residuals of a few points whose pixels are counted by hand."""

import numpy as np

from automos.core.geometry import make_transform
from automos.writers.training.scans import WIDTH, ImageSensor, image_statistics, measure_sensor, residual_image

SENSOR = ImageSensor(64, 3, -25)


def test_a_point_ahead_is_in_the_middle_at_the_row_of_its_elevation():
    image, point = SENSOR.project(np.array([[10.0, 0.0, 0.0], [20.0, 0.0, 0.0], [0.0, 5.0, 0.0]], np.float32))
    row = int(64 * 3 / 28)  # the horizon is 3 of 28 degrees below the top
    assert image[row, WIDTH // 2] == 10.0  # the nearest wins
    assert point[row, WIDTH // 2] == 0
    assert image[row, WIDTH // 4] == 5.0  # the left is a quarter turn on
    assert (image >= 0).sum() == 2


def test_rays_beyond_the_ends_are_in_the_outermost_rows():
    image, _ = SENSOR.project(np.array([[1.0, 0.0, 9.0], [1.0, 0.0, -9.0]], np.float32))
    assert (image[0] >= 0).sum() == (image[-1] >= 0).sum() == 1


def test_a_residual_is_the_change_of_range_as_a_share_of_the_range_now():
    now = np.array([[10.0, 0.0, 0.0], [0.0, 20.0, 0.0], [-60.0, 0.0, 0.0]], np.float32)
    # the sensor drove 1 m ahead: the wall ahead was at 11 m, and what is beside was beside and ahead
    before = np.array([[13.0, 0.0, 0.0], [1.0, 20.0, 0.0], [-59.0, 0.0, 0.0]], np.float32)
    image = residual_image(now, before, make_transform(t=[-1.0, 0.0, 0.0]), SENSOR)
    row = int(64 * 3 / 28)
    assert image[row, WIDTH // 2] == np.float32(0.2)  # 12 m then, 10 m now
    assert np.count_nonzero(image) == 1  # the second stands still, the third is too far to be compared


def test_a_sensor_is_measured_by_its_rays():
    elevations = np.radians(np.linspace(-24.8, 2.0, 64))
    rays = np.column_stack([np.cos(elevations), 0 * elevations, np.sin(elevations)]).astype(np.float32)
    assert measure_sensor([20 * rays], 64) == ImageSensor(64, 2, -25)
    for n_rows in (60, 62, 67):  # as they are measured of 64
        assert measure_sensor([20 * rays], n_rows) == ImageSensor(64, 2, -25)
    assert [measure_sensor([20 * rays], n).height for n in (1, 16, 40, 128)] == [16, 16, 48, 128]
    down = rays[elevations < np.radians(-5)]
    assert measure_sensor([down], 64).fov_up == 0  # trainers add up the sizes of both ends


def test_statistics_are_over_pixels_and_never_zero():
    scan = np.array([[10.0, 0.0, 0.0, 0.5], [20.0, 0.0, 0.0, 0.9], [0.0, 30.0, 0.0, 0.5]], np.float32)
    means, spreads = image_statistics([scan], SENSOR)
    np.testing.assert_allclose(means, [20.0, 5.0, 15.0, 0.0, 0.5])  # the second point is behind the first
    np.testing.assert_allclose(spreads, [10.0, 5.0, 15.0, 1.0, 1.0])
    assert image_statistics([], SENSOR).tolist() == [[0.0] * 5, [1.0] * 5]
