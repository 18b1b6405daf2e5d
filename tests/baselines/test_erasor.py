"""ERASOR on scenes of one bin, whose spans, ratios and planes are computed by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from automos.baselines.batches import BatchSize, tiled
from automos.baselines.erasor import Parameters, find_moving
from automos.baselines.erasor_bins import polar_bins
from automos.core.geometry import inverse, make_transform, transform
from automos.core.scan import Frame

ONE_BIN = {"max_range": 20.0, "rings": 1, "sectors": 1, "every": 1}


class ListFrames(list):
    """Frames held in memory."""

    @property
    def T_level_sensor(self):
        return np.stack([frame.T_level_sensor for frame in self])


def make_frames(clouds, poses=None) -> ListFrames:
    """Return frames whose points are, in the level frame, `clouds`."""
    poses = [np.eye(4)] * len(clouds) if poses is None else poses
    return ListFrames(
        Frame(transform(inverse(T), cloud).astype(np.float32), np.arange(len(cloud)), len(cloud), T, 0.1 * i)
        for i, (cloud, T) in enumerate(zip(clouds, poses, strict=True))
    )


def ground(n: int = 8) -> np.ndarray:
    """Return n x n points half a metre apart on z = 0.01 from x = 8 m on: one voxel each, span 0."""
    x, y = np.meshgrid(8.05 + 0.5 * np.arange(n), 0.05 + 0.5 * (np.arange(n) - n // 2))
    return np.column_stack([x.ravel(), y.ravel(), np.full(n * n, 0.01)])


def post(top: float, x: float = 9.65, y: float = 0.15) -> np.ndarray:
    """Return one point in each voxel (0.2 m) of a post, from 0.3 m (R-GPF's ground ends at 0.26 m) to `top`."""
    z = np.append(np.arange(0.3, 0.2 * np.floor(top / 0.2), 0.2), top)
    return np.column_stack([np.full(len(z), x), np.full(len(z), y), z])


def candidates(clouds, poses=None, **parameters) -> list[np.ndarray]:
    """Return which points of every cloud move."""
    found = dict(find_moving(make_frames(clouds, poses), Parameters(**ONE_BIN | parameters)))
    assert list(found) == list(range(len(clouds)))
    return [found[i] for i in range(len(clouds))]


# ----------------------------------------------------------------------------------------------------------- bins
@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((1, 1, 0), 0),
        ((-1, 1, 0), 1),
        ((-1, -1, 0), 2),
        ((1, -1, 0), 3),
        ((0, 0, 0), 0),
        ((0, 1, 0), 1),  # a border belongs to the sector that begins there
        ((1, -1e-20, 0), 3),  # a turn less nothing is still the last sector
        ((1.99, 0, 0), 0),
        ((2.0, 0, 0), 4),
        ((0, -7.9, 0), 3 * 4 + 3),
        ((8.0, 0, 0), 3 * 4),  # the outermost circle belongs to the last ring
        ((8.01, 0, 0), -1),
        ((1, 1, -1.0), -1),
        ((1, 1, 2.0), -1),
        ((1, 1, 1.99), 0),
    ],
)
def test_bins_by_hand(point, expected):
    # 4 rings of 2 m, 4 quadrants, heights from -1 to 2 m
    bins = Parameters(max_range=8.0, rings=4, sectors=4, min_height=-1.0, max_height=2.0)
    assert polar_bins(np.array([point], float), bins)[0] == expected


# ------------------------------------------------------------------------------------------------------ decisions
@pytest.mark.parametrize(
    ("version", "top", "settings", "is_removed"),
    [
        (3, 2.01, {}, True),
        (2, 2.01, {}, True),
        (3, 0.50, {}, False),
        (3, 0.52, {}, True),
        (3, 2.01, {"min_removed_span": 2.5}, False),
        (2, 0.4, {}, True),
        (2, 0.4, {"bin_max_height": 0.5}, False),
        (3, 2.01, {"min_points": 64}, True),
        (3, 2.01, {"min_points": 65}, False),
        (3, 2.01, {"max_height": 0.01}, False),
        (3, 2.01, {"max_range": 8.0}, False),
        (3, 2.01, {"every": 2}, False),
        (3, 2.01, {"ego_radius": 15.0}, False),
    ],
    ids=["v3 removes", "v2 removes", "v3 span 0.49", "v3 span 0.51", "v3 span set", "v2 height 0.4",
         "v2 height set", "64 scan voxels", "too few scan voxels", "above the volume", "beyond the volume",
         "not compared", "ego body"],
)  # fmt: skip
def test_a_post_that_left_is_removed_if_the_bin_fell_far_enough(version, top, settings, is_removed):
    with_post, without = np.concatenate([ground(), post(top)]), ground()
    first, second = candidates([with_post, without], version=version, **settings)
    np.testing.assert_array_equal(first[64:], is_removed)
    assert not first[:64].any()
    assert not second.any()


@pytest.mark.parametrize(("scan_top", "is_removed"), [(0.39, True), (0.43, False)], ids=["0.19", "0.21"])
@pytest.mark.parametrize("version", [2, 3])
def test_bins_are_alike_from_a_ratio_of_heights_of_a_fifth_on(version, scan_top, is_removed):
    # map: 0.01 to 2.01 m, a span of 2 m; scan: a lower post at another place, spans of 0.38 and 0.42 m
    low = post(scan_top, x=10.65)
    first, second = candidates(
        [np.concatenate([ground(), post(2.01)]), np.concatenate([ground(), low])], version=version
    )
    np.testing.assert_array_equal(first[64:], is_removed)
    assert not second.any()  # what the scan itself hits stays, though it stands above the plane


def test_a_scans_bin_is_counted_in_voxels_not_in_points():
    few = np.repeat(ground()[:2], 50, axis=0)  # a hundred points in two voxels
    first, _ = candidates([np.concatenate([ground(), post(2.01)]), few], min_points=3)
    assert not first.any()
    first, _ = candidates([np.concatenate([ground(), post(2.01)]), few], min_points=2)
    assert first[64:].all()


def test_what_arrives_is_a_candidate_too_because_its_voxels_were_removed_before():
    # by the released version only its own voxels, by the paper's the whole bin that rises above the cleaned map
    clouds = [ground(), np.concatenate([ground(), post(2.01)])]
    first, second = candidates(clouds, version=3)
    assert not first.any()
    np.testing.assert_array_equal(second, [*[False] * 64, *[True] * len(post(2.01))])
    first, second = candidates(clouds, version=2)
    assert not first.any()
    assert second.all()
    assert not candidates(clouds, version=2, bin_max_height=2.1)[1][:64].any()


def test_by_the_papers_version_a_scan_like_the_map_brings_its_voxels_back():
    # the second scan takes the tall post out and leaves a low one (0.38 m); the third sees the lower metre of the tall
    # one again: 0.38 / 1.09 is alike, and what it hits is map once more
    low, tall = post(0.39, x=10.65), post(2.01)
    clouds = [np.concatenate([ground(), low, part]) for part in (tall, tall[:0], tall[:5])]
    n = 64 + len(low)
    assert candidates(clouds, version=3)[0][n:].all()
    np.testing.assert_array_equal(candidates(clouds, version=2)[0][n:], np.arange(len(tall)) >= 5)


def test_a_post_that_stays_is_no_candidate():
    cloud = np.concatenate([ground(), post(2.01)])
    for version in (2, 3):
        assert not np.any(candidates([cloud] * 4, version=version))


def test_bins_decide_each_for_itself():
    # two posts in two of 36 sectors, one of which stays
    away, stays = post(2.01), post(2.01, y=5.15)
    floor = ground(24)
    first, second = candidates(
        [np.concatenate([floor, away, stays]), np.concatenate([floor, stays])], sectors=36, max_range=40.0
    )
    np.testing.assert_array_equal(first, [*[False] * len(floor), *[True] * len(away), *[False] * len(stays)])
    assert not second.any()


@pytest.mark.parametrize("euler", [(0, 0, 0), (0, 0, 77), (10, -5, 30), (180, 0, 0)])
@pytest.mark.parametrize("height", [0.0, 1.8])
def test_heights_are_measured_above_the_ground_however_the_sensor_is_mounted(euler, height):
    R = Rotation.from_euler("xyz", euler, degrees=True).as_matrix()
    poses = [make_transform(R, [x, 0.0, height]) for x in (0.0, 0.5)]
    first, second = candidates([np.concatenate([ground(), post(2.01)]), ground()], poses)
    np.testing.assert_array_equal(first, [*[False] * 64, *[True] * len(post(2.01))])
    assert not second.any()


@pytest.mark.parametrize("turn", [0.0, 45.0, 123.0])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (300.0, -700.0)])
def test_turning_and_shifting_the_world_changes_nothing(turn, shift):
    rng = np.random.default_rng(0)
    clouds = [np.concatenate([ground(), post(2.01)]), np.concatenate([ground(), post(2.01, 10.65)]), ground()]
    clouds = [cloud + rng.normal(0.0, 0.01, cloud.shape) for cloud in clouds]
    poses = [make_transform(t=[0.2 * i, 0.0, 1.8]) for i in range(3)]
    T = make_transform(Rotation.from_euler("z", turn, degrees=True).as_matrix(), [*shift, 0.0])
    expected = candidates(clouds, poses)
    assert sum(map(np.sum, expected)) == 2 * len(post(2.01))
    for got, want in zip(candidates([transform(T, c) for c in clouds], [T @ P for P in poses]), expected, strict=True):
        np.testing.assert_array_equal(got, want)


def test_the_order_of_points_does_not_matter():
    rng = np.random.default_rng(0)
    clouds = [np.concatenate([ground(), post(2.01)]) + rng.normal(0.0, 0.02, (64 + len(post(2.01)), 3)), ground()]
    order = [rng.permutation(len(cloud)) for cloud in clouds]
    shuffled = candidates([cloud[o] for cloud, o in zip(clouds, order, strict=True)])
    for got, want, o in zip(shuffled, candidates(clouds), order, strict=True):
        np.testing.assert_array_equal(got, want[o])


def test_a_scan_without_points_has_no_candidates_and_disturbs_no_other():
    clouds = [np.concatenate([ground(), post(2.01)]), np.zeros((0, 3)), ground()]
    first, empty, last = candidates(clouds)
    assert first[64:].all()
    assert empty.shape == (0,)
    assert not last.any()


# -------------------------------------------------------------------------------------------------------- submaps
@given(
    st.lists(st.sampled_from([0.0, 0.01, 0.5, 3.0, 100.0]), max_size=120),
    st.integers(2, 30),
    st.sampled_from([5.0, 40.0, 160.0]),
)
def test_submaps_tile_the_recording_and_are_bounded(steps, max_scans, max_length):
    travelled = np.cumsum([0.0, *steps])
    origins = np.column_stack([travelled, np.zeros((len(travelled), 2))])
    submaps = tiled(origins, BatchSize(max_scans, max_length))
    own = [k for submap in submaps for k in submap.own]
    assert own == list(range(len(origins)))
    for frames, own in submaps:
        first, last, own_first, own_last = frames.start, frames.stop, own.start, own.stop
        assert 0 <= first <= own_first < own_last <= last <= len(origins)
        assert last - first <= max_scans
        assert travelled[last - 1] - travelled[first] <= max_length + 1e-9


def test_a_submap_reaches_on_past_its_own_scans_on_both_sides():
    origins = np.column_stack([np.arange(400.0), np.zeros((400, 2))])  # a metre a scan
    submaps = tiled(origins, BatchSize(1000, 80.0))
    # own ranges of 40 m hold 41 posts of the fence, and 20 m more on either side
    assert submaps[1] == (range(41 - 20, 41 + 41 + 20), range(41, 82))


def test_a_recording_of_one_scan_is_one_submap():
    assert tiled(np.zeros((1, 3)), BatchSize(200, 160.0)) == [(range(1), range(1))]


@pytest.mark.parametrize("start", [0, 3, 7, 11])
def test_candidates_can_be_found_from_any_scan_on(start):
    clouds = [np.concatenate([ground(), post(2.01, x=8.65 + 0.2 * i)]) for i in range(12)]
    parameters = Parameters(**ONE_BIN, batch=BatchSize(scans=6))
    whole = dict(find_moving(make_frames(clouds), parameters))
    rest = dict(find_moving(make_frames(clouds), parameters, start))
    assert list(rest) == list(range(start, 12))
    for i, score in rest.items():
        np.testing.assert_array_equal(score, whole[i])


def test_what_leaves_only_after_its_submap_is_still_seen_to_leave():
    # submaps of 10 own scans and 5 more on either side; the post stands in the first ten scans and is gone then
    clouds = [np.concatenate([ground(), post(2.01)])] * 10 + [ground()] * 10
    found = candidates(clouds, batch=BatchSize(scans=20))
    assert all(found[i][64:].all() for i in range(10))


def test_a_frame_is_read_once_a_submap():
    class Counting(ListFrames):
        read = 0

        def __getitem__(self, index):
            Counting.read += 1
            return super().__getitem__(index)

    frames = Counting(make_frames([ground()] * 8))
    list(find_moving(frames, Parameters(every=4)))
    assert Counting.read <= 8 + 2  # the two that are compared are read again
