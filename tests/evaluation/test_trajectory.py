import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from automos.core.geometry import inverse, make_transform, se3_exp
from automos.evaluation.trajectory import (
    absolute_errors,
    align,
    drift,
    errors_over_distance,
    errors_over_time,
    path_length,
    rmse,
    rotation_angle,
)

twists = st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6)


def straight(n: int, step: float = 1.0) -> np.ndarray:
    """Return (n, 4, 4): `step` metres along x per scan."""
    return np.stack([make_transform(t=[step * i, 0, 0]) for i in range(n)])


def curved(n: int) -> np.ndarray:
    T = [np.eye(4)]
    for i in range(n - 1):
        T.append(T[-1] @ se3_exp([1.0 + 0.3 * np.sin(i), 0, 0.02, 0, 0.001, 0.05 * np.cos(0.1 * i)]))
    return np.stack(T)


@settings(max_examples=30, deadline=None)
@given(twists)
def test_the_same_trajectory_in_another_world_has_no_error(twist):
    reference = curved(150)
    estimate = se3_exp(twist) @ reference
    np.testing.assert_allclose(align(estimate, reference), inverse(se3_exp(twist)), atol=1e-9)
    assert rmse(absolute_errors(estimate, reference)) < 1e-9
    assert errors_over_distance(estimate, reference, 10).translation.max() < 1e-9
    assert errors_over_time(estimate, reference, np.arange(150) * 0.1, 1.0).rotation_deg.max() < 1e-5
    result = drift(estimate, reference, lengths=(10, 50), every=1)
    assert result.t_err < 1e-7
    assert result.r_err < 1e-6


def test_absolute_error_has_a_closed_form_for_points_swayed_from_a_line():
    # Positions +-1 m to the side, turn and turn about, in fours (no slope, no shift): every error is 1 m.
    reference = straight(8)
    estimate = reference.copy()
    estimate[:, 1, 3] = [1, -1, -1, 1, 1, -1, -1, 1]
    np.testing.assert_allclose(absolute_errors(estimate, reference), np.ones(8), atol=1e-12)
    assert rmse(absolute_errors(estimate, reference)) == pytest.approx(1.0)


def test_scale_is_not_aligned_away():
    # Centred, the positions are -2..2 m; 10 % too long leaves 0.2, 0.1, 0, 0.1, 0.2.
    np.testing.assert_allclose(absolute_errors(straight(5, 1.1), straight(5)), [0.2, 0.1, 0, 0.1, 0.2], atol=1e-12)
    assert rmse([3.0, 4.0]) == pytest.approx(np.sqrt(12.5))


def test_a_mirrored_trajectory_is_not_aligned_by_mirroring():
    rng = np.random.default_rng(0)
    reference = np.stack([make_transform(t=t) for t in rng.normal(size=(20, 3))])
    estimate = reference.copy()
    estimate[:, 2, 3] *= -1
    assert np.linalg.det(align(estimate, reference)[:3, :3]) == pytest.approx(1.0)
    assert rmse(absolute_errors(estimate, reference)) > 0.1


def test_a_scale_error_of_two_percent_is_a_drift_of_two_percent_at_every_length():
    # 1 m per scan: segments of L end at the first scan more than L away, L + 1 m, so the error is 0.02 (L + 1).
    estimate, reference = straight(1000, 1.02), straight(1000)
    result = drift(estimate, reference, lengths=(100,), every=10)
    assert result.t_err == pytest.approx(2.0 * 101 / 100)
    assert result.r_err == pytest.approx(0.0, abs=1e-12)
    # starts 0, 10, ..., 890 have a scan more than 100 m on: the last is 999
    assert result.n_segments == 90
    errors = errors_over_distance(estimate, reference, 100)
    np.testing.assert_allclose(errors.translation_percent, 2.0)
    np.testing.assert_allclose(errors.length, 101.0)


def test_a_constant_turn_is_a_drift_in_degrees_per_metre():
    # The estimate turns 0.01 degrees more every scan of 1 m.
    reference = straight(300)
    step = make_transform(Rotation.from_euler("z", 0.01, degrees=True).as_matrix(), [1, 0, 0])
    estimate = np.stack([np.linalg.matrix_power(step, i) for i in range(300)])
    errors = errors_over_distance(estimate, reference, 50)
    np.testing.assert_allclose(errors.rotation_deg, 0.51, rtol=1e-9)
    assert drift(estimate, reference, lengths=(50,), every=1).r_err == pytest.approx(0.51 / 50)
    # the side-way error of an arc of 51 m turned 0.51 degrees in all is half of angle times length, to first order
    np.testing.assert_allclose(errors.translation, 0.5 * np.radians(0.51) * 51, rtol=2e-2)


def test_the_drift_is_that_of_kittis_loops():
    reference, rng = curved(400), np.random.default_rng(1)
    estimate = [np.eye(4)]
    for step in inverse(reference[:-1]) @ reference[1:]:
        estimate.append(estimate[-1] @ step @ se3_exp(rng.normal(scale=0.01, size=6)))
    estimate = np.stack(estimate)
    # The devkit, in plain loops: distances, last frame further than the length, error of the motion between the two.
    distances = [0.0]
    for i in range(1, 400):
        distances.append(distances[-1] + np.linalg.norm(reference[i, :3, 3] - reference[i - 1, :3, 3]))
    t_err, r_err = [], []
    for first in range(0, 400, 10):
        for length in (100, 200, 300):
            last = next((i for i in range(first, 400) if distances[i] > distances[first] + length), None)
            if last is None:
                continue
            wanted = np.linalg.inv(reference[first]) @ reference[last]
            error = np.linalg.inv(np.linalg.inv(estimate[first]) @ estimate[last]) @ wanted
            t_err.append(np.linalg.norm(error[:3, 3]) / length)
            r_err.append(np.arccos((np.trace(error[:3, :3]) - 1) / 2) / length)
    result = drift(estimate, reference, lengths=(100, 200, 300))
    assert result.n_segments == len(t_err) > 50
    assert result.t_err == pytest.approx(100 * np.mean(t_err))
    assert result.r_err == pytest.approx(np.degrees(np.mean(r_err)))


def test_the_mean_is_over_segments_of_all_lengths_together():
    # A jump of 1 m at scan 50 of 100: L = 10 has starts 0..88, of them 39..49 cross; L = 40 starts 0..58, 9..49 cross.
    reference = straight(100)
    estimate = reference.copy()
    estimate[50:, 1, 3] += 1.0
    result = drift(estimate, reference, lengths=(10, 40), every=1)
    assert result.n_segments == 89 + 59
    assert result.t_err == pytest.approx(100 * (11 * 0.1 + 41 * 0.025) / (89 + 59))


def test_a_drive_shorter_than_every_length_has_no_drift():
    result = drift(straight(50), straight(50))
    assert result.n_segments == 0
    assert np.isnan([result.t_err, result.r_err]).all()


def test_stretches_of_time_end_at_the_nearest_scan():
    # Scans at 0, .1, .2, .35, .4 s: 0.3 s after 0 is nearest to .35, after .1 to .4; after .2 is .5, beyond the end.
    stamps = [0.0, 0.1, 0.2, 0.35, 0.4]
    errors = errors_over_time(straight(5, 1.1), straight(5), stamps, 0.3)
    np.testing.assert_array_equal(errors.start, [0, 1])
    np.testing.assert_array_equal(errors.end, [3, 4])
    np.testing.assert_allclose(errors.translation, [0.3, 0.3])


def test_a_vehicle_that_stands_has_errors_over_time_but_no_percent():
    reference = np.tile(np.eye(4), (10, 1, 1))
    errors = errors_over_time(straight(10, 0.1), reference, np.arange(10) * 0.1, 0.5)
    np.testing.assert_allclose(errors.translation, 0.5)
    assert np.isinf(errors.translation_percent).all()
    assert len(errors_over_distance(straight(10, 0.1), reference, 1.0)) == 0


def test_path_length_is_summed_along_the_way():
    square = np.stack([make_transform(t=t) for t in ([0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 0, 0])])
    np.testing.assert_allclose(path_length(square), [0, 3, 7, 12])


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi - 1e-6, np.pi])
def test_rotation_angles_are_exact_from_nothing_to_half_a_turn(angle):
    R = Rotation.from_rotvec(angle * np.array([1, 2, -2]) / 3).as_matrix()
    assert rotation_angle(R) == pytest.approx(angle, abs=1e-12, rel=1e-6)


def test_trajectories_of_different_length_are_refused():
    with pytest.raises(ValueError, match=r"both be \(N, 4, 4\)"):
        drift(straight(5), straight(6))
    with pytest.raises(ValueError, match="stamps must be"):
        errors_over_time(straight(5), straight(5), [0, 1], 1.0)
