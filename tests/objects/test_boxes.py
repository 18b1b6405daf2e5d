import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import MultiPoint

from automos.core.geometry import wrap_angle
from automos.core.upright_boxes import Boxes, points_in_boxes
from automos.objects.boxes import fit_boxes


def fit_one(points: np.ndarray) -> Boxes:
    return fit_boxes(points, np.zeros(len(points), np.int32), np.ones(1))


def rectangle(length: float, width: float, yaw: float, center=(0.0, 0.0), faces: int = 4) -> np.ndarray:
    """Return points 5 cm apart on the first `faces` sides of a rectangle, z from 0 to 1.5 m."""
    u, v = np.arange(0.0, length + 1e-9, 0.05) - length / 2, np.arange(0.0, width + 1e-9, 0.05) - width / 2
    sides = [
        np.column_stack([u, np.full(len(u), -width / 2)]),
        np.column_stack([np.full(len(v), length / 2), v]),
        np.column_stack([u, np.full(len(u), width / 2)]),
        np.column_stack([np.full(len(v), -length / 2), v]),
    ]
    outline = np.concatenate(sides[:faces])
    c, s = np.cos(yaw), np.sin(yaw)
    xy = outline @ np.array([[c, s], [-s, c]]) + center
    return np.column_stack([xy, np.linspace(0.0, 1.5, len(xy))])


def turn_between(a: float, b: float) -> float:
    """Return the angle between two headings, where half a turn is none."""
    return abs(float(wrap_angle(2.0 * (a - b)))) / 2.0


@pytest.mark.parametrize("yaw_deg", np.arange(-90.0, 90.0, 7.3))
@pytest.mark.parametrize("faces", [2, 3, 4])
def test_a_car_seen_from_two_sides_or_more_is_boxed_at_every_heading(yaw_deg, faces):
    yaw = np.radians(yaw_deg)
    found = fit_one(rectangle(4.5, 1.8, yaw, (12.0, -30.0), faces))
    # points within 5 cm of a side count as on it, and over 4.5 m so do headings up to 0.64 degrees off
    assert turn_between(found.yaw[0], yaw) <= np.radians(0.65)
    np.testing.assert_allclose(found.size[0], [4.5, 1.8, 1.5], atol=0.06)
    np.testing.assert_allclose(found.center[0], [12.0, -30.0, 0.75], atol=0.03)
    assert abs(found.yaw[0]) <= np.pi / 2


@pytest.mark.parametrize("yaw_deg", np.arange(0.0, 180.0, 17.0))
def test_a_full_outline_has_the_least_rectangle_of_shapely(yaw_deg):
    points = rectangle(3.0, 1.2, np.radians(yaw_deg), (1.0, 2.0))
    least = MultiPoint(points[:, :2]).minimum_rotated_rectangle
    found = fit_one(points)
    # 5 cm over 3 m: a heading 0.95 degrees off makes either side as much as 5 cm longer
    np.testing.assert_allclose(found.size[0, :2], [3.0, 1.2], atol=0.06)
    assert found.size[0, 0] * found.size[0, 1] >= least.area - 1e-9
    np.testing.assert_allclose(found.center[0, :2], [least.centroid.x, least.centroid.y], atol=0.01)


def test_one_visible_face_is_a_box_as_flat_as_what_is_seen():
    found = fit_one(rectangle(4.0, 1.8, 0.4, faces=1))
    assert turn_between(found.yaw[0], 0.4) <= np.radians(1.5)  # 5 cm to either side
    np.testing.assert_allclose(found.size[0], [4.0, 0.0, 1.5], atol=0.11)


def test_a_single_point_is_a_box_of_no_size_in_its_place():
    found = fit_one(np.array([[3.0, -2.0, 1.0]]))
    np.testing.assert_allclose(found.center, [[3.0, -2.0, 1.0]], atol=1e-12)
    np.testing.assert_allclose(found.size, np.zeros((1, 3)), atol=1e-12)


@given(st.integers(0, 10**6), st.integers(1, 60), st.sampled_from([0.0, 1000.0]))
def test_a_box_holds_all_its_points_and_each_side_touches_one(seed, n, far):
    rng = np.random.default_rng(seed)
    points = rng.normal(0.0, 1.0, (n, 3)) * rng.uniform(0.0, 4.0, 3) + far
    found = fit_one(points)
    assert (points_in_boxes(points, found, margin=1e-6) == 0).all()
    c, s = np.cos(found.yaw[0]), np.sin(found.yaw[0])
    local = (points - found.center[0]) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(local.max(axis=0), found.size[0] / 2, atol=1e-6)
    np.testing.assert_allclose(local.min(axis=0), -found.size[0] / 2, atol=1e-6)
    assert found.size[0, 0] >= found.size[0, 1]


def test_segments_are_boxed_each_for_itself_and_points_of_none_are_left_out():
    parts = [rectangle(4.5, 1.8, 0.3, (0.0, 0.0)), rectangle(1.7, 0.6, -1.0, (8.0, 1.0))]
    points = np.concatenate([*parts, [[100.0, 100.0, 100.0]]])
    ids = np.concatenate([np.full(len(parts[0]), 1), np.zeros(len(parts[1])), [-1]]).astype(np.int32)
    order = np.random.default_rng(0).permutation(len(points))
    found = fit_boxes(points[order].astype(np.float32), ids[order], np.array([0.6, 0.9]))
    np.testing.assert_allclose(found.center[:, :2], [[8.0, 1.0], [0.0, 0.0]], atol=0.03)
    np.testing.assert_allclose(found.size[:, 0], [1.7, 4.5], atol=0.06)
    np.testing.assert_array_equal(found.score, [0.6, 0.9])


def test_a_segment_of_many_points_keeps_its_heading_and_its_rarest_point():
    points = np.repeat(rectangle(4.5, 1.8, 0.5, faces=2), 30, axis=0)  # 3800 points, of which a tenth decide
    points[1, 2] -= 2.0  # this one does not, but it belongs in the box
    found = fit_one(points)
    assert turn_between(found.yaw[0], 0.5) <= np.radians(0.7)
    assert found.size[0, 2] == pytest.approx(3.5)


def test_no_segments_have_no_boxes():
    assert len(fit_boxes(np.zeros((4, 3)), np.full(4, -1, np.int32), np.zeros(0))) == 0
