import numpy as np
import pytest
from raw_worlds import TOWN, curve, true_poses
from worlds import record

from automos.core.geometry import se3_exp
from automos.core.voxels import rows_of_first_in_voxel
from automos.odometry.registration import Icp, LocalMap, align

RNG = np.random.default_rng(0)
VOXEL, CAPACITY, MAX_RANGE = 0.8, 20, 60.0


def make_icp(local_map, threshold=0.5):
    return Icp(local_map, threshold)


@pytest.fixture(scope="module")
def town():
    pose = curve(6.0, 0.2)
    world = record(TOWN, np.array([pose(0.1 * i) for i in range(5)]), n_beams=40)
    return [scan.points for scan in world.sequence], true_poses(pose, 5)


def test_a_scan_is_put_where_the_authors_library_puts_it(town):
    pytest.importorskip("kiss_icp")
    from kiss_icp.mapping import VoxelHashMap
    from kiss_icp.registration import Registration

    scans, truth = town
    theirs_map, ours_map = VoxelHashMap(VOXEL, MAX_RANGE, CAPACITY), LocalMap(VOXEL, CAPACITY, MAX_RANGE)
    for points, T in zip(scans[:4], truth, strict=False):
        world = points @ T[:3, :3].T + T[:3, 3]
        theirs_map.add_points(world)
        ours_map.add(world, T[:3, 3])
    source = scans[4][rows_of_first_in_voxel(scans[4], 1.5 * VOXEL)]
    guess = truth[4] @ se3_exp([0.3, -0.1, 0.05, 0.01, 0.0, 0.02])
    theirs = Registration(500, 1e-4, 1).align_points_to_map(source.astype(np.float64), theirs_map, guess, 1.5, 0.5)
    ours = align(source, guess, ours_map, 0.5)
    np.testing.assert_allclose(ours, theirs, atol=1e-6)


def test_what_meets_nothing_stays_where_it_is_predicted():
    icp, T = make_icp(LocalMap(VOXEL, CAPACITY, MAX_RANGE)), se3_exp([1.0, 2.0, 0.0, 0.0, 0.0, 0.1])
    np.testing.assert_array_equal(icp.register(RNG.uniform(-5, 5, (99, 3)).astype(np.float32), T), T)


def held(local_map):
    _, _, cells, counts, _ = local_map.arrays
    return [cells[row, : counts[row]] for row in range(local_map._n)]


def test_the_map_holds_a_few_points_a_voxel_none_near_another():
    local_map = LocalMap(1.0, 5, 100.0)
    points = RNG.uniform(-8, 8, (20_000, 3))
    for part in np.split(points, 4):
        local_map.add(part, np.zeros(3))
    voxels = held(local_map)
    assert len(voxels) == len(np.unique(np.floor(points), axis=0))
    for cell in voxels[::50]:
        assert 1 <= len(cell) <= 5
        assert len(np.unique(np.floor(cell), axis=0)) == 1
        apart = np.linalg.norm(cell[:, None] - cell, axis=-1) + 9.0 * np.eye(len(cell))
        assert apart.min() >= 1.0 / np.sqrt(5)


def test_the_map_forgets_what_is_out_of_range():
    local_map = LocalMap(1.0, 5, 20.0)
    for x in np.arange(0.0, 200.0, 1.0):
        local_map.add(np.array([x, 3.0, 0.0]) + RNG.uniform(-1, 1, (30, 3)), np.array([x, 0.0, 0.0]))
    first = np.array([cell[0] for cell in held(local_map)])
    assert first[:, 0].min() > 199.0 - 23.0
    assert len(first) < 2000
