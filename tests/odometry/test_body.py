import numpy as np

from automos.odometry.body import without_body
from automos.odometry.surfels import Surfels


def surfels_at(points) -> Surfels:
    n = len(points)
    return Surfels(
        np.array(points, np.float32), np.zeros((n, 6), np.float32), np.ones(n, np.float32), np.zeros(n, np.float32)
    )


def test_what_every_scan_has_at_the_same_place_is_the_vehicle():
    roof = [1.5, 0.2, -0.3]
    scans = [surfels_at([roof, [3.0 - 0.5 * i, 2.0, 0.0]]) for i in range(10)]
    for i, kept in enumerate(without_body(scans)):
        np.testing.assert_allclose(kept.mean, [[3.0 - 0.5 * i, 2.0, 0.0]], atol=1e-6)


def test_what_shakes_by_more_than_centimetres_is_not():
    rng = np.random.default_rng(0)
    scans = [surfels_at([np.array([1.6, 0.2, -0.2]) + rng.normal(0, 0.06, 3)]) for _ in range(20)]
    assert sum(len(s) for s in without_body(scans)) == 20


def test_what_is_far_away_is_not():
    scans = [surfels_at([[12.0, 0.0, 0.0]])] * 10
    assert all(len(s) == 1 for s in without_body(scans))


def test_nothing_has_no_body():
    assert without_body([]) == []
    assert len(without_body([surfels_at(np.zeros((0, 3)))])[0]) == 0
