import numpy as np

from automos.odometry.landmarks import Landmarks, is_ahead


def landmarks(speed: float, refound: float, expected: float = 0.0) -> Landmarks:
    return Landmarks(np.full(4, speed), np.full(4, refound / 4), np.full(4, expected / 4))


def test_a_speed_is_ahead_by_what_is_found_again_where_another_finds_less():
    assert landmarks(25.0, 4.0).explains_more_than(landmarks(0.0, 0.0))
    assert not landmarks(25.0, 1.0).explains_more_than(landmarks(0.0, 0.0))  # one surfel is chance
    assert not landmarks(25.0, 44.0).explains_more_than(landmarks(0.0, 40.0))
    assert not landmarks(25.0, 40.0).explains_more_than(landmarks(24.5, 0.0))  # nearly the same speed
    assert landmarks(25.0, 4.0).explains_more_than(landmarks(0.5, 4.0, expected=20.0))  # sixteen are missed there


def test_landmarks_are_missed_where_clearly_less_is_found_again_than_should_be():
    # 9 should be found again, deviation 3: 1.2 deviations are 3.6.
    assert landmarks(0.0, 5.3, 9.0).are_missed
    assert not landmarks(0.0, 5.5, 9.0).are_missed
    assert not landmarks(27.0, 0.0, 0.1).are_missed  # at speed nothing is expected again


def test_a_rival_need_not_be_clearly_ahead_of_what_nobody_can_drive():
    here, there = landmarks(4.0, 20.0), landmarks(20.0, 22.0)
    assert not there.explains_more_than(here)
    assert not is_ahead(there, here, True)
    assert is_ahead(there, here, False)
    assert not is_ahead(here, there, False)
