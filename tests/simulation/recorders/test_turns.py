"""Sweeps without times: when each point was measured, from where it lies; beams from the order of the points."""

import sys
from pathlib import Path

import numpy as np
import pytest

from automos.core.array_sequence import ArraySequence
from automos.simulation import Convention, simulate
from automos.simulation.recorders import Recorded

sys.path.append(str(Path(__file__).parents[3] / "benchmarks"))
from cases import TurnsByAzimuth


@pytest.fixture(scope="module")
def as_kitti():
    """Return a simulated sequence and its sweeps as KITTI keeps them: beam by beam, azimuth rising from 0."""
    inner = simulate("canyon", "VLP-16", 3, 4)
    rows = []
    for scan in inner:
        azimuth = np.arctan2(scan.points[:, 1], scan.points[:, 0]) % (2 * np.pi)
        rows.append(np.lexsort((azimuth, scan.ring)))
    kept = [np.column_stack([s.points, s.intensity])[r] for s, r in zip(inner, rows, strict=True)]
    return inner, rows, ArraySequence(kept, inner.stamps)


def test_times_and_beams_are_the_sensors(as_kitti):
    inner, rows, kitti = as_kitti
    turns = TurnsByAzimuth(kitti)
    for k in range(3):
        assert turns[k].time == pytest.approx(inner[k].time[rows[k]], abs=1e-5)
        assert np.array_equal(turns[k].ring, inner[k].ring[rows[k]])
    assert turns.period == pytest.approx(0.1)


def test_the_other_way_round_times_run_backwards(as_kitti):
    _, _, kitti = as_kitti
    there, back = TurnsByAzimuth(kitti)[1].time, TurnsByAzimuth(kitti, turn=1)[1].time
    assert (there + back) % 0.1 == pytest.approx(0.0, abs=1e-5) or np.allclose(there + back, 0.1, atol=1e-5)


def test_a_recording_cut_from_them_is_the_one_cut_from_the_sensor(as_kitti):
    inner, _, kitti = as_kitti
    about = Convention(turns=1.09, order="ring", times="relative")
    real, simulated = Recorded(TurnsByAzimuth(kitti), about), Recorded(inner, about)
    for k in range(len(simulated)):
        assert np.array_equal(real[k].points, simulated[k].points)
        assert real[k].time == pytest.approx(simulated[k].time, abs=1e-5)


def test_without_a_clock_turns_take_a_tenth_of_a_second(as_kitti):
    _, _, kitti = as_kitti
    timeless = TurnsByAzimuth(ArraySequence([scan.points for scan in kitti]))
    assert timeless.stamps == pytest.approx([0.05, 0.15, 0.25])
    recorded = Recorded(timeless, Convention())
    assert recorded.truth(0) is None
    assert recorded.reference_poses is None
