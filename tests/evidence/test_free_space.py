from dataclasses import replace

import numpy as np
import pytest
from free_space_worlds import ListFrames, watch, within
from scipy.spatial.transform import Rotation
from worlds import Block, rider, van

from automos.core.geometry import make_transform
from automos.core.scan import OBJECT, Frame
from automos.evidence.free_space import FreeSpace
from automos.settings import CandidatesSettings

WALL = Block((10.0, 14.0, 3.0), (80.0, 1.0, 6.0))
BACK = Block((45.0, 0.0, 4.0), (2.0, 60.0, 8.0))
SCENE = (
    WALL,
    BACK,
    Block((10.0, -13.0, 2.0), (80.0, 1.0, 4.0)),
    van(6.0, -6.0),
    Block((12.0, 5.0, 2.0), (0.15, 0.15, 4.0)),
)
MOVED = 1.0


def evidence_of(frames, threads=2, start=0):
    space = FreeSpace(frames, frames.stamps, CandidatesSettings(), threads)
    return {i: (net, seen.kind) for i, seen, net in space.collect(start)}


def shares(frames, block, scans, evidence=None):
    """Shares of the points on `block` in `scans` that have moved and that have stayed."""
    evidence = evidence or evidence_of(frames)
    net = np.concatenate([evidence[i][0][within(frames[i], block, frames[i].stamp)] for i in scans])
    assert len(net) > 20, "the thing is in sight"
    return (net >= MOVED).mean(), (net < 0).mean()


@pytest.fixture(scope="module")
def quiet():
    frames = watch(SCENE)
    return frames, evidence_of(frames)


@pytest.fixture(scope="module")
def busy():
    frames = watch((*SCENE, van(-8.0, 5.0, speed=8.0), rider(25.0, -2.0, yaw=np.pi, speed=5.0)))
    return frames, evidence_of(frames)


def test_where_nothing_moves_nothing_has_moved(quiet):
    _, evidence = quiet
    moved = sum((net >= MOVED).sum() for net, _ in evidence.values())
    objects = sum((kind == OBJECT).sum() for _, kind in evidence.values())
    assert objects > 50_000
    assert moved < 1e-4 * objects


@pytest.mark.parametrize("k", range(5))
def test_walls_parked_vans_and_posts_stay(quiet, k):
    frames, evidence = quiet
    moved, stayed = shares(frames, SCENE[k], range(5, 35, 5), evidence)
    assert moved < 0.01
    assert stayed > 0.9


def test_what_drives_and_rides_past_has_moved(busy):
    frames, evidence = busy
    for block in (van(-8.0, 5.0, speed=8.0), rider(25.0, -2.0, yaw=np.pi, speed=5.0)):
        moved, stayed = shares(frames, block, range(4, 36, 4), evidence)
        assert moved > 0.9
        assert stayed < 0.02


def test_walls_behind_passing_traffic_stay(busy):
    frames, evidence = busy
    moved, _ = shares(frames, WALL, range(0, 40, 5), evidence)
    assert moved < 0.002


def test_a_car_that_leaves_has_moved_while_it_still_stood():
    car = van(14.0, -2.0)
    frames = watch(SCENE, n_scans=60, shown=lambda time: (car,) if time < 2.45 else ())
    moved, _ = shares(frames, car, range(4, 24, 4))
    assert moved > 0.8  # its lone points, on edges, count less


def test_a_car_that_arrives_has_moved_while_it_stands():
    car = van(14.0, -2.0)
    frames = watch(SCENE, n_scans=60, shown=lambda time: () if time < 2.45 else (car,))
    moved, _ = shares(frames, car, range(26, 36, 2))
    assert moved > 0.9


def test_grazing_ground_is_never_observed_free(quiet):
    frames, evidence = quiet
    low = np.concatenate([evidence[i][0][np.abs(frames[i].points_level[:, 2]) < 0.15] for i in range(len(frames))])
    assert len(low) > 100_000
    assert (low < MOVED).all()


def test_a_missing_return_says_nothing():
    # Before and after there is only sky where the sign hangs in one scan: nobody has observed its place to be free.
    sign = Block((10.0, 4.0, 3.2), (0.3, 3.0, 1.5))
    frames = watch((van(12.0, -8.0),), n_scans=20, shown=lambda time: (sign,) if abs(time - 1.0) < 0.01 else ())
    net, _ = evidence_of(frames)[10]
    is_sign = within(frames[10], sign)
    assert is_sign.sum() > 20
    assert (net[is_sign] == 0).all()


def test_a_few_centimetres_of_pose_noise_do_no_harm():
    car = van(-8.0, 5.0, speed=8.0)
    frames, rng = watch((*SCENE, car)), np.random.default_rng(3)
    shaken = [
        Frame(
            f.points,
            f.kept,
            f.n_points,
            f.T_level_sensor
            @ make_transform(Rotation.from_rotvec(rng.normal(0.0, 0.001, 3)).as_matrix(), rng.normal(0.0, 0.03, 3)),
            f.stamp,
        )
        for f in (frames[i] for i in range(len(frames)))
    ]
    evidence = evidence_of(ListFrames(shaken))
    assert shares(frames, car, range(4, 36, 4), evidence)[0] > 0.9
    for block in SCENE:
        assert shares(frames, block, range(4, 36, 4), evidence)[0] < 0.02


@pytest.mark.parametrize("turn", [[0.0, 0.087, 0.0], [np.pi, 0.0, 0.0]], ids=["tilted by 5 degrees", "upside down"])
def test_the_way_the_sensor_is_mounted_does_not_matter(turn):
    car = van(-8.0, 5.0, speed=8.0)
    frames = watch((*SCENE, car), R_level_sensor=Rotation.from_rotvec(turn).as_matrix(), n_beams=48)
    evidence = evidence_of(frames)
    assert shares(frames, car, range(8, 36, 4), evidence)[0] > 0.8
    assert shares(frames, WALL, range(8, 36, 4), evidence)[0] < 0.01


def test_the_number_of_threads_changes_nothing(busy):
    frames, evidence = busy
    for i, alone in evidence_of(frames, threads=1).items():
        np.testing.assert_array_equal(alone, evidence[i])


def test_a_run_taken_up_later_gives_the_same(busy):
    frames, evidence = busy
    later = evidence_of(frames, start=30)
    assert sorted(later) == list(range(30, 40))
    np.testing.assert_array_equal(later[33][0], evidence[33][0])


def test_the_ground_before_a_pause_is_not_that_of_after(quiet):
    frames = list(quiet[0])[:12]
    lift = make_transform(t=[0.0, 0.0, -0.5])
    later = [replace(f, stamp=f.stamp + 100.0, T_level_sensor=lift @ f.T_level_sensor) for f in frames]

    def heights(of):
        space = FreeSpace(ListFrames(of), np.array([f.stamp for f in of]), CandidatesSettings())
        return [seen.height for _, seen, _ in space.collect()]

    for alone, after in zip(heights(later), heights(frames + later)[12:], strict=True):
        np.testing.assert_array_equal(alone, after)


def test_one_scan_alone_is_unknown_throughout():
    frames = watch(SCENE, n_scans=1)
    ((net, _),) = evidence_of(frames).values()
    assert (net == 0).all()
    assert len(net) == len(frames[0].points)


def test_scans_half_a_second_apart_still_tell(busy):
    every_fifth = ListFrames([busy[0][i] for i in range(0, 40, 5)])
    moved, _ = shares(every_fifth, van(-8.0, 5.0, speed=8.0), range(1, 7))
    assert moved > 0.7


def test_at_the_start_what_the_one_other_scan_has_hit_has_stayed(quiet):
    frames, _ = quiet
    two = ListFrames([frames[0], frames[1]])
    for net, kind in evidence_of(two).values():
        known = net[(kind == OBJECT) & (net != 0.0)]
        assert len(known) > 0.5 * np.count_nonzero(kind == OBJECT)
        assert (known < -CandidatesSettings().free_space.stay_weight).mean() > 0.99
