from functools import cache, partial

import numpy as np
import pytest
from raw_worlds import TOWN, curve, cut_anew, rosette, sweep, untimed
from worlds import SCAN_GAP, drive, record

from automos.core.array_sequence import ArraySequence
from automos.core.errors import InputError
from automos.core.scan import Scan
from automos.odometry import moving_windows, timing
from automos.odometry.clock import read_clock
from automos.odometry.followed import TimedScan
from automos.odometry.path import Path
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.timing import choose_timing
from automos.settings import OdometrySettings
from automos.simulation import Conditions, Convention
from automos.simulation import record as record_drive

N = 18
POSE, FAST = curve(8.0, 0.5), curve(12.0, 0.0)


@cache
def seen(i, pose=POSE, turn=-1, seam_deg=180.0):
    """Return the sweep around the middle of scan `i`."""
    return sweep(TOWN, pose, SCAN_GAP * i, turn, seam_deg, n_beams=40)


def choice_of(sequence, **settings):
    """Return the choice at the poses of the scans as measured."""
    clock, path = read_clock(sequence), Path(OdometrySettings(), SweepTiming(), lag=60.0)
    for i, gap in enumerate([0.0, *clock.gaps]):
        path.push(TimedScan(partial(sequence.__getitem__, i), clock.stamps[i], gap, clock.period))
    path.finish()
    return choose_timing(sequence, OdometrySettings(**settings), path.window.T_world_sensor, clock)


def choose(sequence, **settings):
    return choice_of(sequence, **settings).timing


def raw(turn, seam_deg, arrange=lambda points, i: points):
    scans = [seen(i, POSE, turn, seam_deg) for i in range(N)]
    return ArraySequence([Scan(arrange(scan.points, i), stamp=scan.stamp) for i, scan in enumerate(scans)])


def free_running(turns, arrange=lambda points, i: points, pose=POSE):
    scans = cut_anew([seen(i, pose) for i in range(N + 2)], turns)
    return ArraySequence([Scan(arrange(scan.points, i), stamp=scan.stamp) for i, scan in enumerate(scans)])


def shuffled(points, i):
    return np.random.default_rng(i).permutation(points)


@pytest.mark.parametrize(
    ("turn", "seam_deg"),
    [(-1, 180.0), (1, 180.0), pytest.param(-1, 0.0, marks=pytest.mark.slow)],
    ids=["clockwise", "counter-clockwise", "from the front"],
)
def test_how_the_sensor_turns_is_found_out_where_points_are_in_no_order(turn, seam_deg):
    timing = choose(raw(turn, seam_deg, shuffled))
    assert (timing.source, timing.turn, timing.share) == ("azimuth", turn, 1.0)
    assert abs((timing.seam_deg - seam_deg + 180.0) % 360.0 - 180.0) <= 45.0


@pytest.mark.parametrize("turn", [-1, 1], ids=["clockwise", "counter-clockwise"])
def test_points_in_the_order_of_measurement_tell_their_times(turn):
    timing = choose(raw(turn, 90.0))
    assert (timing.source, timing.turn) == ("order", turn)
    assert timing.share == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("turns", [0.92, 1.09], ids=["less than a turn", "more than a turn"])
@pytest.mark.parametrize("pose", [POSE, FAST], ids=["in a curve", "straight and faster"])
def test_streams_cut_by_time_are_timed_by_the_order_of_their_points(turns, pose):
    # As measured, scans agree on the motion in a turn of the sensor, at 12 m/s 9 or 11 cm off from scan to scan.
    timing = choose(free_running(turns, pose=pose))
    assert (timing.source, timing.turn) == ("order", -1)
    assert timing.share == pytest.approx(1.0, abs=0.02)
    assert timing.order.turns_per_scan == pytest.approx(turns, abs=0.01)


@pytest.mark.parametrize("turns", [0.92, 1.09], ids=["less than a turn", "more than a turn"])
def test_recorded_times_of_streams_cut_by_time_are_believed_by_far(turns):
    scans = ArraySequence(cut_anew([seen(i, FAST) for i in range(N + 2)], turns))
    choice = choice_of(scans)
    assert choice.timing.source == "file"
    assert choice.to_dict()["worse_percent"]["none (compensated already, or unknown)"] > 50.0


def test_a_sector_that_is_missing_and_wanders_tells_the_times_of_shuffled_points():
    timing = choose(free_running(0.92, shuffled))
    assert (timing.source, timing.turn, timing.seam_deg) == ("azimuth", -1, None)


def test_what_was_tried_and_by_how_much_it_lost_is_said():
    choice = choice_of(raw(-1, 180.0))
    said = choice.to_dict()
    assert said["chosen"] == "order of the points (clockwise, 1.00 turns a scan)"
    assert said["worse_percent"]["none (compensated already, or unknown)"] > 3.0


def test_a_second_window_is_asked_only_where_the_first_leaves_doubt(monkeypatch):
    looks = []

    def counted(*arguments):
        for window in moving_windows.moving_windows(*arguments):
            looks.append(window)
            yield window

    monkeypatch.setattr(timing, "moving_windows", counted)
    scans = [seen(i) for i in range(2 * N)]
    assert choose(ArraySequence(scans)).source == "file"
    assert len(looks) == 1
    monkeypatch.setattr(moving_windows, "N_ERRORS", 1e6)
    assert choose(ArraySequence(scans)).source == "file"
    assert len(looks) == 3


def test_compensated_sweeps_are_left_alone():
    world = record(TOWN, np.array([POSE(SCAN_GAP * i) for i in range(N)]), n_beams=40)
    assert choose(ArraySequence([untimed(scan) for scan in world.sequence])).source == "none"


def test_times_in_the_file_are_believed():
    scans = [seen(i) for i in range(N)]
    timing = choose(ArraySequence(scans))
    assert timing.source == "file"
    assert timing.share == pytest.approx(1.0, abs=0.02)


def test_times_left_in_the_file_of_compensated_sweeps_are_not():
    world = record(TOWN, np.array([POSE(SCAN_GAP * i) for i in range(N)]), n_beams=40)
    scans = []
    for scan in world.sequence:
        azimuth = np.arctan2(scan.points[:, 1], scan.points[:, 0])
        scans.append(
            Scan(scan.points, time=(SCAN_GAP * (0.5 - azimuth / (2 * np.pi))).astype(np.float32), stamp=scan.stamp)
        )
    assert choose(ArraySequence(scans)).source == "none"


def test_a_recording_turned_round_has_its_sweeps_turned_round_too():
    scans = [seen(N - 1 - i) for i in range(N)]
    scans = [Scan(scan.points, time=scan.time, stamp=SCAN_GAP * i) for i, scan in enumerate(scans)]
    assert choose(ArraySequence(scans)).share == pytest.approx(-1.0, abs=0.02)


def test_where_the_sensor_stands_nothing_needs_compensation():
    world = record(TOWN, drive(12, speed=0.0, turn=0.0))
    assert choose(ArraySequence([untimed(scan) for scan in world.sequence])).source == "none"


@pytest.mark.parametrize("wanted", ["none", "auto"])
def test_who_says_the_sweeps_are_compensated_is_believed(wanted):
    sequence = ArraySequence([np.ones((100, 3))] * 3, is_compensated=True)
    assert choose(sequence, time=wanted).source == "none"


def looking_ahead(arrange=lambda scan: scan):
    return ArraySequence([arrange(rosette(TOWN, POSE, SCAN_GAP * i)) for i in range(N)])


def test_times_of_a_pattern_that_never_repeats_are_believed():
    timing = choose(looking_ahead())
    assert timing.source == "file"
    assert timing.share == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("wanted", ["auto", "order"])
def test_points_of_a_sensor_that_does_not_turn_were_measured_at_a_steady_rate(wanted):
    timing = choose(looking_ahead(untimed), time=wanted)
    assert (timing.source, timing.share) == ("index", 1.0)
    assert str(timing) == "order of the points (a steady rate)"


def test_shuffled_points_of_a_sensor_that_does_not_turn_have_no_times():
    def mixed(scan):
        return Scan(np.random.default_rng(0).permutation(scan.points), stamp=scan.stamp)

    assert choose(looking_ahead(mixed)).source == "none"


def test_compensated_points_of_a_sensor_that_does_not_turn_are_left_alone():
    def still(middle):
        return rosette(TOWN, lambda now: POSE(middle), middle)

    assert choose(ArraySequence([untimed(still(SCAN_GAP * i)) for i in range(N)])).source == "none"


def test_a_sensor_that_looks_one_way_does_not_spin():
    ahead = np.random.default_rng(0).uniform([5, -5, -1], [30, 5, 3], (500, 3))
    assert choose(ArraySequence([ahead] * 12)).source == "none"


def test_times_asked_for_but_not_there_are_an_error_that_says_what_to_do():
    with pytest.raises(InputError, match=r"no time per point; set odometry\.time"):
        choose(ArraySequence([np.ones((5, 3))] * 3), time="file")


@pytest.mark.slow
def test_sweeps_of_half_the_time_between_scans_are_found_where_full_ones_are_as_wrong_as_none():
    drive = record_drive("city", "OS1-128", 40, 109, convention=Convention(every=2))
    timing = choose(drive)
    assert (timing.source, timing.turn, timing.share) == ("azimuth", -1, 0.5)


@pytest.mark.slow
def test_the_most_common_seam_is_compared_though_the_vehicle_hides_the_rear():
    drive = record_drive("city", "OS1-128", 40, 109, conditions=Conditions(rig="truck"))
    timing = choose(drive)
    assert (timing.source, timing.turn, timing.seam_deg) == ("azimuth", -1, 180.0)
