import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from automos.core.array_sequence import ArraySequence
from automos.core.geometry import transform
from automos.core.scan import Scan
from automos.odometry.compensation import compensate, settled_times
from automos.odometry.drifting_seam import doubled_edges, drifting_times, gap_edges, learn_drifting_seam
from automos.odometry.motion import timed_points
from automos.odometry.sweep_timing import SweepTiming
from automos.settings import OdometrySettings

BEAMS = 16
FIRINGS = 1800  # a turn
STEP = np.array([1.5, 0.0, 0.0, 0.0, 0.0, 0.02])
"""Motion of the sensor in one turn."""


def room(azimuth, height):
    """Where rays at `azimuth` (radians) and slope `height` meet a room of 40 by 24 m, sensor at its middle."""
    reach = np.minimum(
        20.0 / np.maximum(np.abs(np.cos(azimuth)), 1e-9), 12.0 / np.maximum(np.abs(np.sin(azimuth)), 1e-9)
    )
    return np.stack([reach * np.cos(azimuth), reach * np.sin(azimuth), reach * height], axis=1)


def cut(turns, k, turn=1, stagger_deg=0.0, seed=0):
    """Scan `k` of a stream cut every `turns`, shuffled: points, and the turns since its start of each."""
    n = round(turns * FIRINGS)
    firing, beam = np.repeat(np.arange(k * n, (k + 1) * n), BEAMS), np.tile(np.arange(BEAMS), n)
    azimuth = np.pi + turn * 2.0 * np.pi * firing / FIRINGS + np.radians(stagger_deg) * (beam - 7.5) / 7.5
    order = np.random.default_rng(seed + k).permutation(len(firing))
    points = room(azimuth, 0.03 * (beam - 8.0)).astype(np.float32)
    return points[order], ((firing - k * n) / FIRINGS)[order]


def recording(turns, n=8, **kwargs):
    return ArraySequence([cut(turns, k, **kwargs)[0] for k in range(n)])


@pytest.mark.parametrize("turn", [1, -1], ids=["counter-clockwise", "clockwise"])
@pytest.mark.parametrize("stagger_deg", [0.0, 4.0])
@pytest.mark.parametrize("turns", [0.8, 0.92, 1.09, 1.2, 1.6])
def test_a_sector_that_wanders_tells_the_turns_of_a_scan_and_which_way(turns, stagger_deg, turn):
    found = learn_drifting_seam(recording(turns, turn=turn, stagger_deg=stagger_deg))
    assert found == (turn, pytest.approx(turns, abs=0.01))


@pytest.mark.parametrize("turns", [1.0, 2.0])
def test_whole_turns_tell_nothing(turns):
    assert learn_drifting_seam(recording(turns)) is None


def test_a_sector_that_is_always_hidden_or_always_seen_twice_tells_nothing():
    whole = cut(1.0, 0)[0]
    left = whole[:, 1] > np.abs(whole[:, 0])
    assert learn_drifting_seam(ArraySequence([whole[~left]] * 8)) is None
    assert learn_drifting_seam(ArraySequence([np.concatenate([whole, whole[left]])] * 8)) is None


@pytest.mark.parametrize("turn", [1, -1])
@pytest.mark.parametrize("turns", [0.92, 1.09])
def test_a_shuffled_scan_has_its_times_but_for_what_is_seen_twice(turns, turn):
    points, turned = cut(turns, 3, turn=turn)
    times, is_twofold = drifting_times(points, turn, turns)
    np.testing.assert_allclose(times[~is_twofold], (turned / turns - 0.5)[~is_twofold], atol=0.01)
    assert is_twofold.mean() == pytest.approx(max(2.0 * (turns - 1.0) / turns, 0.0), abs=0.03)


def test_what_is_seen_twice_is_settled_by_where_it_must_be_and_left_out_of_registration():
    points, turned = cut(1.2, 2)
    times = (turned / 1.2 - 0.5).astype(np.float32)
    came = compensate(points, times, -1.2 * STEP)  # as a sensor saw the room that drove through it
    timing = SweepTiming("azimuth", turn=1, seam_deg=None, turns=1.2, share=1.0)
    found = settled_times(Scan(came), timing, 1.2 * STEP, np.arange(len(came)))
    off = np.linalg.norm(compensate(came, found, 1.2 * STEP) - points, axis=1)
    assert np.mean(off < 0.1) > 0.95
    kept, known = timed_points(Scan(came), timing, OdometrySettings())
    assert len(kept) == len(known) < 0.75 * len(came)
    assert np.isfinite(known).all()


def test_each_of_several_lidars_has_a_seam_of_its_own():
    """A second LiDAR, mounted turned by 90 degrees, drives through a room of its own: its times are as if alone."""
    points = [cut(1.2, k)[0] for k in (2, 5)]
    turned = np.eye(4)
    turned[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    mounts = np.stack([np.eye(4), turned])
    timing = SweepTiming("azimuth", turn=1, seam_deg=None, turns=1.2, share=1.0)
    alone = [settled_times(Scan(p), timing, np.zeros(6), np.arange(len(p))) for p in points]
    merged = np.concatenate([transform(T, p) for T, p in zip(mounts, points, strict=True)])
    scan = Scan(merged, sensor=np.repeat(np.uint8([0, 1]), len(points[0])), T_scan_sensor=mounts)
    found = settled_times(scan, timing, np.zeros(6), np.arange(len(merged)))
    assert np.mean(np.abs(found - np.concatenate(alone)) < 1e-3) > 0.999


def test_the_widest_empty_sector_is_found_across_the_seam():
    azimuth = np.radians(np.arange(-150.0, 160.0, 0.5))
    low, high = gap_edges(np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], 1).astype(np.float32))
    assert (low, high) == pytest.approx((159.5 / 360, 210 / 360), abs=0.002)


def test_a_sector_seen_twice_is_found_across_the_seam():
    once = np.radians(np.arange(-180.0, 180.0, 0.25))
    azimuth = np.concatenate([once, np.radians(np.arange(150.0, 210.0, 0.25))])
    low, high = doubled_edges(np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], 1).astype(np.float32))
    assert (low, high) == pytest.approx((150 / 360, 210 / 360), abs=0.01)


@given(hnp.arrays(np.float32, (300, 3), elements=st.floats(width=32)))
def test_whatever_the_points_are_every_one_has_a_time(points):
    assert np.isfinite(gap_edges(points)).all()
    assert np.isfinite(doubled_edges(points)).all()
    for turns in (0.9, 1.1, 1.7):
        times, is_twofold = drifting_times(points, 1, turns)
        assert times.shape == is_twofold.shape == (300,)
        assert (np.abs(times) <= 0.5).all()
    learn_drifting_seam(ArraySequence([Scan(points), Scan(points)]))
