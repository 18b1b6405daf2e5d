"""What the sensor makes of hits."""

from dataclasses import replace

import numpy as np
import pytest

from automos.simulation.sensing.returns import measure, ring_bias
from automos.simulation.sensing.scene import Hits
from automos.simulation.sensing.sensors import SENSORS
from automos.simulation.shapes.materials import Material

HDL = SENSORS["HDL-64E"]


def hits_at(sensor, distance, material=Material.WALL, tint=1.0, cosine=1.0) -> Hits:
    n = sensor.beams * sensor.columns
    hits = Hits.none(n, sensor.max_range)
    hits.distance[:] = distance
    hits.material[:] = material
    hits.tint[:], hits.cosine[:], hits.lost[:] = tint, cosine, False
    return hits


def seen(sensor, hits, seed=0):
    return measure(sensor, sensor.pattern(0), hits, np.random.default_rng(seed))


def test_range_noise_is_the_sensors_and_beams_keep_their_bias():
    returns = seen(HDL, hits_at(HDL, 10.0))
    error = (returns.distance - 10.0).reshape(HDL.columns, HDL.beams)
    assert error.std(axis=0).mean() == pytest.approx(HDL.noise * 1.1, rel=0.05)  # grows by 1 % per metre
    assert error.mean(axis=0) == pytest.approx(ring_bias(HDL), abs=0.002)


def test_a_grey_target_is_seen_every_other_time_at_the_sensors_reach():
    tint = 0.1 / 0.42  # plaster darkened to 10 %
    share = [
        seen(HDL, hits_at(HDL, r, tint=tint)).is_return.mean() for r in (0.7 * HDL.reach, HDL.reach, 1.3 * HDL.reach)
    ]
    assert share[0] > 0.97
    assert share[1] == pytest.approx(0.5, abs=0.05)
    assert share[2] < 0.02


def test_asphalt_fades_out_at_grazing_incidence():
    near = seen(HDL, hits_at(HDL, 30.0, Material.ASPHALT, cosine=1.73 / 30.0))
    far = seen(HDL, hits_at(HDL, 60.0, Material.ASPHALT, cosine=1.73 / 60.0))
    assert near.is_return.mean() > 0.9
    assert far.is_return.mean() < 0.1


def test_retro_reflectors_saturate_the_intensity():
    assert np.median(seen(HDL, hits_at(HDL, 40.0, Material.RETRO)).intensity) == 1.0
    assert np.median(seen(HDL, hits_at(HDL, 10.0, Material.ASPHALT)).intensity) < 0.3


def test_nothing_returns_nearer_than_the_least_or_further_than_the_greatest_range():
    assert not seen(HDL, hits_at(HDL, 0.5 * HDL.min_range)).is_return.any()
    assert not seen(HDL, hits_at(HDL, HDL.max_range + 1.0, Material.RETRO)).is_return.any()


def test_edges_blur_only_where_both_echoes_fall_into_one_pulse():
    sensor = replace(HDL, noise=0.0, ring_bias=0.0)
    for gap, blurs in ((0.8, True), (5.0, False)):
        distance = np.full((sensor.columns, sensor.beams), 20.0, np.float32)
        distance[1000:] += gap
        returns = seen(sensor, hits_at(sensor, distance.ravel()))
        between = (returns.distance > 20.01) & (returns.distance < 20.0 + gap - 0.01)
        assert between.any() == blurs
        assert np.array_equal(np.flatnonzero(between // 1), np.flatnonzero(returns.straddles >= 0)) or between.sum() > 0
        assert set(np.unique(np.flatnonzero(between) // sensor.beams)) <= {999, 0, sensor.columns - 1}
