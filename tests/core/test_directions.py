import numpy as np

from automos.core.cells import rough_turn_of, turn_of
from automos.core.directions import last_looks, raw_points
from automos.core.geometry import se3_exp, transform
from automos.core.scan import Frame


def test_raw_points_undo_the_compensation():
    rng = np.random.default_rng(4)
    raw = rng.uniform(-40.0, 40.0, (2000, 3))
    time, motion = rng.uniform(-0.5, 0.5, 2000), np.array([1.2, 0.1, 0.0, 0.0, 0.01, 0.05])
    compensated = np.stack([transform(se3_exp(t * motion), p[None])[0] for t, p in zip(time, raw, strict=True)])
    frame = Frame(
        compensated.astype(np.float32), np.arange(2000), 2000, np.eye(4), 0.0, time.astype(np.float32), motion
    )
    np.testing.assert_allclose(raw_points(frame), raw, atol=0.03)


def test_turns_are_azimuths():
    angles = np.linspace(-np.pi + 1e-3, np.pi - 1e-3, 1001)
    turns = [turn_of(np.float32(np.cos(a)), np.float32(np.sin(a))) for a in angles]
    np.testing.assert_allclose(turns, (angles + np.pi) / (2.0 * np.pi), atol=3e-6)
    rough = [rough_turn_of(np.float32(np.cos(a)), np.float32(np.sin(a))) for a in angles]
    assert (np.diff(rough) > 0).all()
    assert 0.0 <= min(rough) <= max(rough) < 1.0


def test_of_a_sector_that_is_looked_at_twice_the_last_look_counts():
    along = np.linspace(0.0, 1.2, 2401)  # turns of one sweep, from behind on
    azimuth = 2.0 * np.pi * along - np.pi
    raw = np.stack([10.0 * np.cos(azimuth), 10.0 * np.sin(azimuth), 0.0 * along], axis=1).astype(np.float32)
    times = (along / 1.2 - 0.5).astype(np.float32)
    sweep_time, is_last = last_looks(raw, times)
    is_again = along < 0.19
    assert not is_last[is_again].any()
    assert is_last[along > 0.21].all()
    assert sweep_time[0] > 0.3  # behind, at 1.0 turns
    assert abs(sweep_time[180] - (0.5 / 1.2 - 0.5)) < 0.01


def test_without_times_all_is_seen_at_once():
    sweep_time, is_last = last_looks(np.ones((500, 3), np.float32), None)
    assert not sweep_time.any()
    assert is_last.all()
