"""Recordings as recorders keep them, against the sweeps they were made of: every point once, label and time with it."""

from itertools import pairwise

import numpy as np
import pytest

from automos.core.errors import InputError
from automos.core.geometry import inverse, se3_exp, se3_log
from automos.simulation import Convention, record, simulate
from automos.simulation.recorders import Recorded

N_SWEEPS = 6
ASKED = ("canyon", "VLP-16", N_SWEEPS, 4)


@pytest.fixture(scope="module")
def sweeps():
    return simulate(*ASKED)


@pytest.fixture(scope="module")
def measured(sweeps):
    """Return all points of the sweeps, their labels, and when they were measured, in sweeps."""
    when = np.concatenate([k + sweeps[k].time.astype(np.float64) / 0.1 for k in range(N_SWEEPS)])
    return *stream(sweeps), when


def kept(**about) -> Recorded:
    return record(*ASKED, convention=Convention(**about))


def stream(sequence) -> tuple[np.ndarray, np.ndarray]:
    """Return all points and labels of a sequence, in order."""
    n = range(len(sequence))
    return np.concatenate([sequence[k].points for k in n]), np.concatenate([sequence.truth(k) for k in n])


def sorted_rows(points: np.ndarray, labels: np.ndarray) -> np.ndarray:
    rows = np.column_stack([points.astype(np.float64), labels])
    return rows[np.lexsort(rows.T)]


def test_the_plain_convention_keeps_everything_as_it_was(sweeps):
    plain = kept(times="relative")
    assert len(plain) == N_SWEEPS
    assert np.array_equal(plain[3].points, sweeps[3].points)
    assert np.array_equal(plain[3].intensity, sweeps[3].intensity)
    assert np.array_equal(plain.truth(3), sweeps.truth(3))
    assert plain[3].time == pytest.approx(sweeps[3].time - sweeps[3].time.min(), abs=1e-6)
    assert plain.stamps == pytest.approx(sweeps.stamps)
    assert plain.reference_poses == pytest.approx(sweeps.reference_poses)


@pytest.mark.parametrize(
    ("turns", "order"),
    [(1.09, "file"), (0.8, "time"), (1.09, "time"), (2.0, "time"), (0.8, "ring"), (1.09, "ring"), (1.09, "random")],
)
def test_cutting_and_ordering_keeps_every_point_once_with_its_label(measured, turns, order):
    cut = kept(turns=turns, order=order)
    points, labels = stream(cut)
    all_points, all_labels, when = measured
    inside = when < len(cut) * turns
    assert len(cut) == int(N_SWEEPS / turns)
    assert np.array_equal(sorted_rows(points, labels), sorted_rows(all_points[inside], all_labels[inside]))


def test_a_cut_of_more_than_a_turn_begins_farther_round_with_every_scan():
    cut = kept(turns=1.09, order="time")
    for k in range(3):
        azimuth = np.degrees(np.unwrap(np.arctan2(*cut[k].points[:, 1::-1].T.astype(np.float64))))
        assert azimuth[0] - azimuth[-1] == pytest.approx(1.09 * 360.0, abs=1.0)  # clockwise
        assert (azimuth[0] - 180.0 + k * 0.09 * 360.0 + 180.0) % 360.0 == pytest.approx(180.0, abs=1.0)


@pytest.mark.parametrize("order", ["time", "ring", "random"])
def test_times_are_those_of_the_beams_that_measured_the_points(order):
    cut = kept(turns=1.09, order=order, times="relative")
    for k in range(0, len(cut), 2):
        scan = cut[k]
        azimuth = np.arctan2(scan.points[:, 1], scan.points[:, 0]).astype(np.float64)
        turned = (-azimuth / (2 * np.pi) + 0.5) % 1.0  # of a VLP-16: clockwise from the back
        start = k * 0.109
        since = np.round((start + scan.time) / 0.1 - turned)  # whole turns between
        first = cut.when(k).min()
        assert 0.1 * (turned + since) - first == pytest.approx(scan.time, abs=1e-4)
        assert scan.time.min() == 0.0
        assert scan.time.max() == pytest.approx(0.109, abs=2e-3)


def test_points_come_in_the_order_that_was_asked_for():
    by_time, by_ring = (
        kept(turns=0.92, order="time", times="relative"),
        kept(turns=0.92, order="ring", times="relative"),
    )
    assert np.all(np.diff(by_time[2].time) >= 0)
    assert np.all(np.diff(by_ring[2].ring.astype(int)) >= 0)
    same_beam = np.diff(by_ring[2].ring.astype(int)) == 0
    assert np.all(np.diff(by_ring[2].time)[same_beam] >= 0)


@pytest.mark.parametrize(
    ("about", "expected"),
    [
        ({"leave_out": 3}, [0, 1, 3, 4]),
        ({"every": 2}, [0, 2, 4]),
        ({"double": 2}, [0, 1, 1, 2, 3, 3, 4, 5, 5]),
        ({"turns": 0.5, "renumbered": True}, [0, 1, 10, 11, 2, 3, 4, 5, 6, 7, 8, 9]),
    ],
)
def test_scans_are_lost_doubled_and_renumbered(about, expected):
    found = kept(**about)
    turns = about.get("turns", 1.0)
    assert found.true_stamps == pytest.approx(0.1 * turns * (np.array(expected) + 0.5))
    whole = kept(turns=turns)
    assert np.array_equal(found[2].points, whole[expected[2]].points)
    assert np.array_equal(found.truth(2), whole.truth(expected[2]))
    in_order = all(a < b for a, b in pairwise(expected))
    assert (found.stamps is not None) == in_order


def test_a_scan_that_is_there_twice_is_the_same_twice():
    twice = kept(double=2, order="random", specks=0.02)
    assert np.array_equal(twice[1].points, twice[2].points)
    assert not np.array_equal(twice[1].points[:100], twice[3].points[:100])


@pytest.mark.parametrize(("reference", "at"), [("start", 0.218), ("middle", 0.2725), ("end", 0.327)])
@pytest.mark.parametrize("speed", [1.0, 0.8])
def test_compensation_carries_points_to_the_time_asked_for(sweeps, reference, at, speed):
    raw = kept(turns=1.09)
    flat = kept(turns=1.09, reference=reference, reference_speed=speed)
    T = inverse(sweeps.poses_at(at)) @ sweeps.poses_at(raw.when(2))
    T = se3_exp(speed * se3_log(T))
    expected = np.einsum("nij,nj->ni", T[:, :3, :3], raw[2].points.astype(np.float64)) + T[:, :3, 3]
    assert np.abs(flat[2].points - expected).max() < 1e-4
    assert np.abs(flat[2].points - raw[2].points).max() > 0.1
    assert np.array_equal(flat.truth(2), raw.truth(2))
    poses = inverse(sweeps.poses_at(at - 0.218)) @ sweeps.poses_at(at)
    assert flat.reference_poses[2] == pytest.approx(poses, abs=1e-9)


@pytest.mark.parametrize(
    ("times", "is_as_said"),
    [
        ("backwards", lambda wrong, true: np.allclose(wrong, true.max() - true, atol=1e-6)),
        ("constant", lambda wrong, true: np.all(wrong == 0.0)),
        ("nan", lambda wrong, true: np.all(np.isnan(wrong))),
        ("too long", lambda wrong, true: np.allclose(wrong, 2.0 * true, atol=1e-6)),
    ],
)
def test_wrong_times_are_wrong_as_said(times, is_as_said):
    assert is_as_said(kept(times=times)[1].time, kept(times="relative")[1].time)


def test_what_is_lost_is_lost_and_nothing_else():
    whole = kept()[2]
    fewer_packets = len(kept(lost_packets=0.2)[2]) / len(whole)
    assert fewer_packets == pytest.approx(0.8, abs=0.1)
    assert set(kept(beams=4)[2].ring) == {0, 4, 8, 12}
    front = kept(field_of_view=120.0)[2].points
    assert np.degrees(np.abs(np.arctan2(front[:, 1], front[:, 0]))).max() <= 60.0
    lacking = kept(lost_sector=60.0)
    gone = [len(lacking[k]) < len(kept()[k]) for k in range(N_SWEEPS)]
    assert any(gone)
    assert not all(gone)


def test_coordinates_in_centimetres_and_rounded():
    whole = kept()[2].points
    assert kept(unit=0.01)[2].points == pytest.approx(100.0 * whole, rel=1e-6)
    rounded = kept(rounding=0.02)[2].points
    assert np.abs(rounded - whole).max() <= 0.0101
    assert rounded / 0.02 == pytest.approx(np.round(rounded / 0.02), abs=1e-3)


def test_specks_are_nearer_on_the_same_rays_and_static():
    whole, spotted = kept(), kept(specks=0.05)
    a, b = np.linalg.norm(whole[2].points, axis=1), np.linalg.norm(spotted[2].points, axis=1)
    moved = np.abs(a - b) > 1e-3
    assert moved.mean() == pytest.approx(0.05, abs=0.01)
    assert np.all(b[moved] < a[moved])
    along = np.einsum("ij,ij->i", whole[2].points[moved], spotted[2].points[moved]) / (a[moved] * b[moved])
    assert along == pytest.approx(1.0, abs=1e-5)
    assert set(spotted.truth(2)[moved]) == {9}


def test_conventions_are_read_from_words():
    assert Convention.parse(["turns=1.09", "order=time", "stamps=false", "double=10"]) == Convention(
        turns=1.09, order="time", stamps=False, double=10
    )
    assert str(Convention.parse(["turns=1.09"])) == "turns=1.09"
    with pytest.raises(InputError, match=r"'turn' is not a convention \(did you mean turns\?\); give NAME=VALUE"):
        Convention.parse(["turn=2"])
    with pytest.raises(InputError, match=r"double is '2.5': input should be a valid integer"):
        Convention.parse(["double=2.5"])
    with pytest.raises(InputError, match="stamps is 'maybe': input should be a valid boolean"):
        Convention.parse(["stamps=maybe"])


def test_what_cannot_be_is_refused_by_name():
    with pytest.raises(InputError, match=r"order is 'sideways': input should be 'file', 'time', 'ring' or 'random'"):
        Convention(order="sideways")
    with pytest.raises(InputError, match=r"turns is 0.0: input should be greater than or equal to 0.05"):
        Convention(turns=0.0)
    with pytest.raises(InputError, match=r"reference_speed is 'nan': input should be a finite number"):
        Convention.parse(["reference=start", "reference_speed=nan"])
    with pytest.raises(InputError, match="n_lidars is 9"):
        record("city", n_lidars=9)


@pytest.mark.parametrize("about", [{"turns": 20.0}, {"first_cut": 1000.0}, {"leave_out": 1}])
def test_a_recorder_that_keeps_no_scan_is_refused(about):
    with pytest.raises(InputError, match=rf"keeps no scan of {N_SWEEPS} turns: give more, or"):
        kept(**about)
