"""The parts of the methods, on cases computed by hand."""

import sys

import numpy as np
import pytest
from rival_worlds import Yard

from automos.baselines.batches import BatchSize, add_points, cut_batches, labels_of_voxels, scans_at
from automos.baselines.height_images import HeightImages, find_edges, find_ground
from automos.baselines.hmm_mos import otsu_threshold
from automos.baselines.methods import BASELINES
from automos.baselines.range_image import image_shape, nearest_ranges, pixel_of
from automos.baselines.regions import grow_regions
from automos.core.errors import MissingExtraError
from automos.core.range_image import over_neighbours
from automos.core.scan import Frame
from automos.core.voxel_map import VoxelMap
from automos.settings import load_settings


# -------------------------------------------------------------------------------------------------------- batches
def test_a_point_has_the_label_of_its_own_voxel_and_none_stays():
    moving = labels_of_voxels(np.array([0, 1, -1, 1], np.int32), np.array([False, True]))
    assert moving.tolist() == [False, True, False, True]


def test_points_out_of_range_are_in_no_voxel():
    T_level_sensor = np.eye(4)
    T_level_sensor[:3, 3] = 30.0, 0.0, 2.0  # the range is from the sensor, the voxels are of the level frame
    points = np.array([[5.0, 0.1, 0.1], [-30.0, 0.1, 0.1], [5.1, 0.1, 0.1], [0.1, 9.0, 0.1]], np.float32)
    voxels = VoxelMap(0.5)
    ids = add_points(voxels, Frame(points, np.arange(4), 4, T_level_sensor, 0.0), 20.0)
    assert ids.tolist() == [0, -1, 0, 1]
    np.testing.assert_allclose(voxels.mean, [[35.05, 0.1, 2.1], [30.1, 9.0, 2.1]], atol=1e-5)


def test_batches_answer_for_every_scan_once_and_see_beyond():
    yard = Yard(n_scans=36, n_beams=2, n_columns=4)
    batches = list(cut_batches(yard, BatchSize(scans=12)))
    assert [k for batch in batches for k in batch.own] == list(range(36))
    assert all(set(batch.own) <= set(batch.frames) for batch in batches)
    assert max(len(batch.frames) for batch in batches) < 36
    assert [k for batch in cut_batches(yard, BatchSize(scans=12), 20) for k in batch.own] == list(range(20, 36))


# --------------------------------------------------------------------------------------------------- range images
def test_a_point_falls_into_the_pixel_of_its_direction():
    shape = image_shape(1.0, 1.0, -25.0, 25.0)
    assert (shape.rows, shape.columns) == (50, 360)
    for azimuth, elevation in ((0.5, 0.5), (-90.5, -24.5), (179.5, 10.5), (45.5, -0.5)):
        a, e = np.radians([azimuth, elevation])
        x, y, z = (7.0 * np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])).astype(np.float32)
        v, u, r = pixel_of(x, y, z, shape)
        assert (v, u) == (int(elevation + 25.0), int(azimuth + 180.0))
        assert r == pytest.approx(7.0, abs=1e-5)
    assert pixel_of(np.float32(1.0), np.float32(0.0), np.float32(1.0), shape)[0] == -1  # 45 degrees up


def test_the_nearest_point_of_a_pixel_counts_and_windows_go_round():
    shape = image_shape(10.0, 10.0, -20.0, 20.0)
    points = np.array([[-9.0, 0.1, 0.1], [-5.0, 0.1, 0.1], [-7.0, -0.1, 0.1]], np.float32)  # behind: the seam
    image = nearest_ranges(points, shape)
    v, last, first = 2, shape.columns - 1, 0
    assert image[v, last] == pytest.approx(5.0, abs=0.01)
    assert image[v, first] == pytest.approx(7.0, abs=0.01)
    assert np.isinf(image[0]).all()
    around = over_neighbours(image, np.minimum)
    assert around[v, [first, 2]] == pytest.approx([5.0, np.inf], abs=0.01)
    assert around[v + 1, [first, first + 1]] == pytest.approx([5.0, 7.0], abs=0.01)


# -------------------------------------------------------------------------------------------------- height images
def test_edges_are_where_grey_steps_and_weak_ones_only_beside_strong_ones():
    image = np.zeros((40, 40), np.uint8)
    image[:, 20:] = 200  # a strong step between columns 19 and 20
    assert find_edges(image, 15.0, 300.0)[5:35].any(axis=0).nonzero()[0].tolist() in ([19], [20])
    image[:, 20:] = 20  # 4 x 20 = 80: weak, and nothing strong to hold on to
    assert not find_edges(image, 15.0, 300.0).any()


def test_a_plane_is_ground_and_a_box_on_it_is_not():
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(-10, 10, 0.1), np.arange(-10, 10, 0.1)))
    z = np.where((np.abs(x - 5) < 1) & (np.abs(y) < 1), 1.5, 0.0)
    is_ground = find_ground(np.column_stack([x, y, z]), HeightImages(reach=12.0, cells=(0.1, 0.2, 0.3)))
    is_box, is_far = z > 1.0, np.hypot(x - 5, y) > 3.0
    assert not is_ground[is_box].any()
    assert is_ground[is_far].mean() > 0.95


# ----------------------------------------------------------------------------------------------------- the others
def test_otsu_tells_two_classes_apart_whatever_their_scale():
    for scale in (1, 20):
        low, high = scale * np.array([1, 2, 2, 1]), scale * np.array([30, 40, 35])
        assert low.max() < otsu_threshold(np.concatenate([low, high])) < high.min()
    assert otsu_threshold(np.array([5, 5, 5])) == np.inf  # one class
    assert otsu_threshold(np.zeros(0, np.int64)) == np.inf


def test_the_scans_nearest_to_given_times_are_asked():
    stamps = 0.1 * np.arange(20)
    assert scans_at(stamps, 10, [-0.5, 0.5]) == [5, 15]
    assert scans_at(stamps, 1, [-0.5, 0.5]) == [6]  # nothing within half of that before
    assert scans_at(stamps, 10, [-0.1, -0.11]) == [9]
    assert scans_at(np.array([0.0]), 0, [-0.5, 0.5]) == []


def test_regions_grow_step_by_step_and_not_over_gaps():
    x = np.array([0.0, 0.5, 1.0, 1.5, 4.0])
    points = np.column_stack([x + 0.01, np.zeros(5), np.zeros(5)])
    seed, everything = np.array([True, False, False, False, False]), np.ones(5, bool)
    assert grow_regions(points, seed, everything, 0.5, 0).tolist() == [True, False, False, False, False]
    assert grow_regions(points, seed, everything, 0.5, 2).tolist() == [True, True, True, False, False]
    assert grow_regions(points, seed, everything, 0.5, 9).tolist() == [True, True, True, True, False]
    blocked = np.array([True, True, False, True, True])
    assert grow_regions(points, seed, blocked, 0.5, 9).tolist() == [True, True, False, False, False]


def test_a_method_without_its_library_says_which_extra_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "dufomap", None)
    yard = Yard(n_scans=2, n_beams=2, n_columns=4)
    with pytest.raises(MissingExtraError, match=r"pip install '.*\[dufomap\]'"):
        list(BASELINES["dufomap"].find_moving(yard, yard.stamps, load_settings(), 0))
