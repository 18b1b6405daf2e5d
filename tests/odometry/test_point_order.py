import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from automos.core.array_sequence import ArraySequence
from automos.core.scan import Scan
from automos.odometry.point_order import learn_order, sees_all_round, turns_since_start

BEAMS = 16
FIRINGS = 1800  # a turn
RNG = np.random.default_rng(0)


def stream(first, n, turn=1, offsets_deg=0.0):
    """Firings `first` to `first + n` of a sensor that begins at azimuth 180 degrees: points, turns, beam of each."""
    firing, beam = np.repeat(np.arange(first, first + n), BEAMS), np.tile(np.arange(BEAMS), n)
    azimuth = np.pi + turn * 2.0 * np.pi * firing / FIRINGS + np.radians(offsets_deg) * (beam - 7.5) / 7.5
    ranges = RNG.uniform(3.0, 60.0, len(firing))
    points = np.stack([ranges * np.cos(azimuth), ranges * np.sin(azimuth), 0.1 * beam], axis=1)
    return points.astype(np.float32), (firing - first) / FIRINGS, beam


def recording(turns, n=8, arrange=lambda points, times, beam: (points, times), **kwargs):
    length = round(turns * FIRINGS)
    parts = [arrange(*stream(k * length, length, **kwargs)) for k in range(n)]
    return ArraySequence([points for points, _ in parts]), [times for _, times in parts]


def by_beam(points, times, beam):
    order = np.argsort(beam, kind="stable")
    return points[order], times[order]


def shuffled(points, times, beam):
    order = RNG.permutation(len(points))
    return points[order], times[order]


def half_lost(points, times, beam):
    kept = (RNG.random(len(points)) < 0.5) & ~((times > 0.3) & (times < 0.5))  # and nothing at all in a sector
    return points[kept], times[kept]


@pytest.mark.parametrize("turn", [1, -1], ids=["counter-clockwise", "clockwise"])
@pytest.mark.parametrize("turns", [0.6, 0.92, 1.0, 1.09, 2.0])
def test_a_stream_may_be_cut_anywhere(turns, turn):
    sequence, times = recording(turns, turn=turn, offsets_deg=4.0)
    order = learn_order(sequence)
    assert order.turn == turn
    assert order.turns == pytest.approx(turns, abs=0.005)
    assert order.turns_per_scan == pytest.approx(turns, abs=0.002)
    np.testing.assert_allclose(turns_since_start(sequence[3], order), times[3], atol=0.01)


@pytest.mark.parametrize("share", [0.3, 0.45, 0.6])
def test_a_sensor_that_looks_one_way_still_turns_once_a_scan(share):
    def ahead(points, times, beam):
        seen = np.abs(times - 0.5) < 0.5 * share
        return points[seen], times[seen] - times[seen][0]

    sequence, times = recording(1.0, arrange=ahead)
    order = learn_order(sequence)
    assert order.turns_per_scan == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(turns_since_start(sequence[3], order), times[3], atol=0.01)


def test_points_that_never_returned_leave_no_trace_in_the_times_of_others():
    sequence, times = recording(1.0, arrange=half_lost)
    np.testing.assert_allclose(turns_since_start(sequence[2], learn_order(sequence)), times[2], atol=0.01)


def test_a_scan_whose_first_points_are_lost_begins_late():
    sequence, times = recording(1.0)
    order = learn_order(sequence)
    cut = Scan(sequence[1].points[5000:])
    np.testing.assert_allclose(turns_since_start(cut, order), times[1][5000:], atol=0.01)


@pytest.mark.parametrize("turns", [0.92, 1.0, 1.09])
def test_files_sorted_by_beam_tell_nothing(turns):
    assert learn_order(recording(turns, arrange=by_beam)[0]) is None


def test_a_shuffled_file_tells_nothing():
    assert learn_order(recording(1.0, arrange=shuffled)[0]) is None


def test_a_sensor_whose_pattern_never_repeats_tells_nothing():
    ahead = [np.random.default_rng(i).uniform([5, -5, -1], [30, 5, 3], (20_000, 3)) for i in range(8)]
    assert learn_order(ArraySequence(ahead)) is None


@given(hnp.arrays(np.float32, (300, 3), elements=st.floats(width=32)))
def test_whatever_the_points_are_every_one_has_a_time(points):
    order = learn_order(recording(1.0)[0])
    turned = turns_since_start(Scan(points), order.__class__(1, 1.0, 1.0))
    assert turned.shape == (300,)
    assert np.isfinite(turned).all()
    learn_order(ArraySequence([Scan(points), Scan(points)]))


def test_a_sensor_sees_all_round_though_a_scan_is_empty():
    whole, _ = stream(0, FIRINGS)[:2]
    nothing = np.full((100, 3), np.nan, np.float32)
    assert sees_all_round(ArraySequence([whole, whole, nothing, whole, whole]))
    assert not sees_all_round(ArraySequence([whole[: len(whole) // 2]] * 3))
    assert not sees_all_round(ArraySequence([nothing]))
