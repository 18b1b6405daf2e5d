"""Beam tables and firing patterns."""

import numpy as np
import pytest

from automos.simulation.sensing.sensors import SENSORS

PUBLISHED = {  # beams, uppermost and lowermost elevation in degrees, points per second
    "HDL-64E": (64, 2.0, -24.33, 1.333e6),
    "HDL-32E": (32, 10.67, -30.67, 0.695e6),
    "VLP-16": (16, 15.0, -15.0, 0.288e6),
    "OS1-64": (64, 22.5, -22.5, 0.655e6),
    "OS1-128": (128, 22.5, -22.5, 1.311e6),
    "VLS-128": (128, 15.0, -25.0, 2.4e6),
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_spinning_sensors_have_the_published_beams_and_rate(name):
    sensor = SENSORS[name]
    beams, top, bottom, rate = PUBLISHED[name]
    assert len(np.unique(sensor.elevations)) == sensor.beams == beams
    assert sensor.elevations.max() == pytest.approx(top, abs=0.01)
    assert sensor.elevations.min() == pytest.approx(bottom, abs=0.01)
    assert np.all(np.diff(sensor.elevations) < 0)
    assert sensor.beams * sensor.columns / sensor.period == pytest.approx(rate, rel=0.01)


@pytest.mark.parametrize("name", SENSORS)
def test_beams_are_unit_vectors_fired_in_time_order(name):
    pattern = SENSORS[name].pattern(0)
    assert np.linalg.norm(pattern.direction, axis=1) == pytest.approx(1.0, abs=1e-5)
    assert np.all(np.diff(pattern.phase) >= 0)
    assert pattern.phase.min() >= -0.5
    assert pattern.phase.max() < 0.5
    assert np.array_equal(np.sort(pattern.by_sector[0]), np.arange(len(pattern.ring)))


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_sweep_starts_and_ends_at_the_back_and_looks_ahead_in_the_middle(name):
    pattern = SENSORS[name].pattern(0)
    middle = pattern.direction[len(pattern.direction) // 2]
    assert pattern.direction[0, 0] < 0
    assert pattern.direction[-1, 0] < 0
    assert middle[0] > 0


def test_the_rosette_fills_its_field_of_view_and_never_repeats():
    sensor = SENSORS["Avia"]
    first, second = sensor.pattern(0), sensor.pattern(1)
    azimuth = np.degrees(np.arctan2(first.direction[:, 1], first.direction[:, 0]))
    elevation = np.degrees(np.arcsin(first.direction[:, 2]))
    assert np.abs(azimuth).max() == pytest.approx(35.2, abs=0.5)
    assert np.abs(elevation).max() == pytest.approx(38.6, abs=0.5)
    assert len(first.ring) / sensor.period == pytest.approx(240_000)
    assert np.abs(first.direction - second.direction).max() > 0.1


def test_organised_sensors_point_apart_by_their_stagger():
    pattern = SENSORS["OS1-64"].pattern(0)
    first = pattern.direction[pattern.column == 0]
    azimuth = np.degrees(np.unwrap(np.arctan2(first[:, 1], first[:, 0])))
    assert np.diff(azimuth)[:3] == pytest.approx([-2.82, -2.82, -2.82], abs=0.01)
