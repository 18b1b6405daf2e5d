import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from shapely.geometry import Polygon

from automos.core.geometry import (
    adjoint,
    inverse,
    is_rigid,
    make_transform,
    rotation_between,
    se3_exp,
    se3_log,
    skew,
    transform,
    wrap_angle,
)
from automos.core.upright_boxes import Boxes, iou_3d, points_in_boxes

YAWS = np.radians([-180.0, -90.0, -30.0, 0.0, 12.5, 45.0, 90.0, 135.0])

numbers = st.floats(-3.0, 3.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
sides = st.floats(0.2, 5.0)
boxes = st.tuples(numbers, numbers, numbers, sides, sides, sides, st.floats(-4.0, 4.0)).map(
    lambda v: Boxes(np.array([v[:3]]), np.array([v[3:6]]), np.array(v[6:]), np.ones(1))
)


def box(center=(0.0, 0.0, 0.0), size=(1.0, 1.0, 1.0), yaw=0.0) -> Boxes:
    return Boxes(np.array([center], float), np.array([size], float), np.array([yaw]), np.ones(1))


def some_boxes(n: int, seed: int = 0) -> Boxes:
    rng = np.random.default_rng(seed)
    return Boxes(rng.uniform(-4, 4, (n, 3)), rng.uniform(0.5, 4, (n, 3)), rng.uniform(-4, 4, n), rng.uniform(0, 1, n))


def turned(yaw: float, t=(0.0, 0.0, 0.0)) -> np.ndarray:
    return make_transform(Rotation.from_euler("z", yaw).as_matrix(), t)


# ---------------------------------------------------------------------------------------------- rigid transforms
def test_a_quarter_turn_and_a_shift_by_hand():
    T = turned(np.pi / 2, [10.0, 0.0, 1.0])
    np.testing.assert_allclose(transform(T, np.array([[1.0, 2.0, 3.0]])), [[8.0, 1.0, 4.0]], atol=1e-12)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_transformed_points_keep_their_type(dtype):
    points = np.random.default_rng(0).normal(size=(50, 3)).astype(dtype)
    T = se3_exp([1.0, -2.0, 0.5, 0.3, 0.2, -1.0])
    moved = transform(T, points)
    assert moved.dtype == dtype
    # float32 holds 7 digits of coordinates of a few metres
    np.testing.assert_allclose(moved, points @ T[:3, :3].T + T[:3, 3], atol=1e-12 if dtype == np.float64 else 1e-6)


@given(vectors, vectors)
def test_the_inverse_undoes_a_transform(rho, phi):
    T = se3_exp(np.r_[rho, phi])
    np.testing.assert_allclose(inverse(T) @ T, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(inverse(np.stack([T, T @ T]))[1], np.linalg.inv(T @ T), atol=1e-12)


@given(vectors, vectors)
def test_the_exponential_is_that_of_the_matrix(rho, phi):
    twist = np.zeros((4, 4))
    twist[:3, :3], twist[:3, 3] = skew(phi), rho
    np.testing.assert_allclose(se3_exp(np.r_[rho, phi]), expm(twist), atol=1e-10)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-7, 1e-5, 0.1, 3.0, np.pi - 1e-4])
def test_the_logarithm_undoes_the_exponential_at_every_angle(angle):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    xi = np.r_[0.5, -2.0, 1.0, angle * axis]
    # near half a turn the axis is known to the root of the rounding error
    np.testing.assert_allclose(se3_log(se3_exp(xi)), xi, atol=1e-7 if angle > 3.0 else 1e-10)


def test_exponential_and_logarithm_take_any_number_of_twists():
    xi = np.random.default_rng(0).normal(size=(3, 2, 6))
    T = se3_exp(xi)
    assert T.shape == (3, 2, 4, 4)
    np.testing.assert_allclose(T[1, 1], se3_exp(xi[1, 1]), atol=1e-14)
    np.testing.assert_allclose(se3_exp(se3_log(T)), T, atol=1e-9)


@given(vectors, vectors)
def test_skew_matrices_are_cross_products(v, w):
    np.testing.assert_allclose(skew(v) @ w, np.cross(v, w), atol=1e-12)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ([1, 0, 0], [0, 1, 0]),
        ([0, 0, 2], [0, 0, 5]),
        ([0, 0, 1], [0, 0, -1]),
        ([1, 0, 0], [-1, 0, 0]),
        ([0.1, -0.2, 0.97], [0, 0, 1]),
        ([1, 1, 1], [-1, -1, -1 + 1e-7]),
    ],
    ids=["quarter", "same", "opposite z", "opposite x", "tilted", "nearly opposite"],
)
def test_a_rotation_between_directions_turns_one_onto_the_other(a, b):
    R = rotation_between(a, b)
    np.testing.assert_allclose(R @ (a / np.linalg.norm(a)), b / np.linalg.norm(b), atol=1e-6)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(R) == pytest.approx(1.0)


def test_a_rotation_between_directions_is_the_least_one():
    R = rotation_between([1.0, 0.0, 0.2], [0.9, 0.3, -0.1])
    angle = np.arccos(np.dot([1.0, 0.0, 0.2], [0.9, 0.3, -0.1]) / np.sqrt(1.04 * 0.91))
    assert np.linalg.norm(Rotation.from_matrix(R).as_rotvec()) == pytest.approx(angle)


def test_angles_are_wrapped_to_half_a_turn_either_way():
    np.testing.assert_allclose(wrap_angle([3.5 * np.pi, -3.5 * np.pi, np.pi, -np.pi, 0.3]), [
        -0.5 * np.pi, 0.5 * np.pi, -np.pi, -np.pi, 0.3
    ])  # fmt: skip


# ------------------------------------------------------------------------------------------------- upright boxes
@pytest.mark.parametrize("field", ["center", "size", "yaw", "score"])
def test_boxes_of_unequal_columns_are_refused(field):
    arrays = some_boxes(3).to_arrays()
    arrays[field] = arrays[field][:-1] if field != "center" else arrays[field][:, :2]
    with pytest.raises(ValueError, match="got shape"):
        Boxes.from_arrays(arrays)


def test_boxes_are_taken_apart_and_put_together():
    all_boxes = some_boxes(5)
    parts = [all_boxes[np.arange(2)], Boxes.empty(), all_boxes[np.arange(2, 5)]]
    for again in (Boxes.from_arrays(all_boxes.to_arrays()), Boxes.concatenate(parts)):
        for name, column in all_boxes.to_arrays().items():
            np.testing.assert_array_equal(getattr(again, name), column)
    assert len(Boxes.concatenate([])) == len(Boxes.empty()) == 0


def test_volume_by_hand():
    some = Boxes(np.zeros((2, 3)), np.array([[2.0, 3.0, 4.0], [5.0, 1.0, 1.0]]), np.zeros(2), np.ones(2))
    np.testing.assert_array_equal(some.volume, [24.0, 5.0])
    assert Boxes.empty().volume.shape == (0,)


def test_the_length_lies_along_the_heading_and_corners_run_counter_clockwise():
    corners = box((1.0, 2.0, 0.0), (4.0, 2.0, 1.0), np.pi / 2).corners()[0]
    np.testing.assert_allclose(corners, [[0, 4], [0, 0], [2, 0], [2, 4]], atol=1e-12)
    assert Polygon(corners).exterior.is_ccw


@pytest.mark.parametrize("yaw", YAWS)
def test_a_moved_box_has_moved_corners(yaw):
    T = turned(yaw, [3.0, -4.0, 2.0])
    some = some_boxes(6)
    corners = np.concatenate([some.corners(), np.zeros((6, 4, 1))], axis=2).reshape(-1, 3)
    moved = some.transformed(T)
    np.testing.assert_allclose(moved.corners().reshape(-1, 2), transform(T, corners)[:, :2], atol=1e-12)
    np.testing.assert_allclose(moved.center[:, 2], some.center[:, 2] + 2.0)
    assert (np.abs(moved.yaw) <= np.pi).all()


# ------------------------------------------------------------------------------------------------------ overlap
@pytest.mark.parametrize(
    ("other", "iou"),
    [
        (box(), 1.0),
        (box(yaw=np.pi / 2), 1.0),
        (box((0.5, 0, 0)), 1 / 3),
        (box((0, 0, 0.5)), 1 / 3),
        (box((0.5, 0.5, 0.5)), 1 / 15),
        (box(size=(0.5, 0.5, 0.5)), 1 / 8),
        (box(yaw=np.pi / 4), np.sqrt(0.5)),  # the octagon has area 2 sqrt(2) - 2
        (box((1.0, 0, 0)), 0.0),
        (box((0, 0, 1.0)), 0.0),
        (box((9.0, 0, 0)), 0.0),
        (box(size=(1, 0, 1)), 0.0),
    ],
    ids=["itself", "quarter turn", "half along", "half up", "half in all", "within", "eighth turn", "touching",
         "stacked", "apart", "flat"],
)  # fmt: skip
def test_the_overlap_with_the_unit_cube_by_hand(other, iou):
    assert iou_3d(box(), other)[0, 0] == pytest.approx(iou, abs=1e-12)
    assert iou_3d(other, box())[0, 0] == pytest.approx(iou, abs=1e-12)


def test_long_boxes_end_to_end_overlap_though_their_centres_are_far_apart():
    size = (4.0, 0.2, 1.0)  # 0.1 m of 4 m; their circumscribed circles barely meet
    assert iou_3d(box(size=size), box((3.9, 0, 0), size))[0, 0] == pytest.approx(0.1 / 7.9)


def overlap_by_shapely(a: Boxes, b: Boxes) -> float:
    ground = Polygon(a.corners()[0]).intersection(Polygon(b.corners()[0])).area
    z_a, z_b, h_a, h_b = a.center[0, 2], b.center[0, 2], a.size[0, 2], b.size[0, 2]
    height = max(min(z_a + h_a / 2, z_b + h_b / 2) - max(z_a - h_a / 2, z_b - h_b / 2), 0.0)
    return ground * height / (a.volume[0] + b.volume[0] - ground * height)


@given(boxes, boxes)
def test_overlap_is_that_of_shapely(a, b):
    assert iou_3d(a, b)[0, 0] == pytest.approx(overlap_by_shapely(a, b), abs=1e-9)


@given(boxes, st.sampled_from(list(YAWS)), st.sampled_from([0.0, 0.3]))
def test_overlap_is_that_of_shapely_where_edges_coincide(a, turn, shift):
    # the same box, turned about its centre and slid along its own edge: the cases in which clippers go wrong
    slide = shift * np.array([np.cos(a.yaw[0]), np.sin(a.yaw[0]), 0.0])
    b = Boxes(a.center + slide, a.size, a.yaw + turn, a.score)
    assert iou_3d(a, b)[0, 0] == pytest.approx(overlap_by_shapely(a, b), abs=1e-9)


@pytest.mark.parametrize("yaw", YAWS)
def test_overlap_does_not_change_when_the_world_is_turned_and_shifted(yaw):
    a, b, T = some_boxes(8, 1), some_boxes(9, 2), turned(yaw, [500.0, -300.0, 20.0])
    before = iou_3d(a, b)
    assert (before > 0.01).sum() > 9
    np.testing.assert_allclose(iou_3d(a.transformed(T), b.transformed(T)), before, atol=1e-9)


def test_overlap_with_no_boxes_is_an_empty_table():
    assert iou_3d(Boxes.empty(), some_boxes(3)).shape == (0, 3)
    assert iou_3d(some_boxes(3), Boxes.empty()).shape == (3, 0)


# ------------------------------------------------------------------------------------------------ points in boxes
def owner_by_brute_force(points: np.ndarray, some: Boxes, margin: float) -> np.ndarray:
    owner = np.full(len(points), -1)
    for j in reversed(range(len(some))):
        local = (points - some.center[j]) @ Rotation.from_euler("z", some.yaw[j]).as_matrix()
        owner[(np.abs(local) <= some.size[j] / 2 + margin).all(axis=1)] = j
    return owner


@pytest.mark.parametrize("margin", [0.0, 0.3, -0.1])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_points_in_boxes_are_those_of_brute_force(margin, dtype):
    points = np.random.default_rng(3).uniform(-6, 6, (3000, 3)).astype(dtype)
    some = some_boxes(12)
    owner = points_in_boxes(points, some, margin)
    assert owner.dtype == np.int32
    assert (owner >= 0).sum() > 100
    np.testing.assert_array_equal(owner, owner_by_brute_force(points.astype(np.float64), some, margin))


def test_a_point_in_two_boxes_belongs_to_the_first():
    two = Boxes.concatenate([box(size=(1, 1, 1)), box(size=(2, 2, 2))])
    points = np.array([[0.0, 0.0, 0.0], [0.9, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 0.0, 0.9]])
    np.testing.assert_array_equal(points_in_boxes(points, two), [0, 1, -1, 1])


def test_a_box_shrunk_to_less_than_nothing_holds_nothing():
    assert points_in_boxes(np.zeros((1, 3)), box(), margin=-0.6)[0] == -1


@pytest.mark.parametrize(("points", "some"), [(np.zeros((0, 3)), some_boxes(2)), (np.zeros((2, 3)), Boxes.empty())])
def test_no_points_and_no_boxes_have_no_owner(points, some):
    np.testing.assert_array_equal(points_in_boxes(points, some), np.full(len(points), -1))


def test_the_adjoint_carries_a_twist_to_another_frame():
    T, xi = se3_exp([1.0, -2.0, 0.5, 0.3, 0.2, -0.9]), np.array([0.4, 0.1, -0.2, 0.05, -0.1, 0.3])
    np.testing.assert_allclose(se3_exp(adjoint(T) @ xi), T @ se3_exp(xi) @ inverse(T), atol=1e-12)


def test_only_rotation_and_translation_is_rigid():
    T = se3_exp([1.0, -2.0, 0.5, 0.3, 0.2, -0.9])
    scaled, mirrored, unknown, projective = (T.copy() for _ in range(4))
    scaled[:3, :3] *= 1.1
    mirrored[:3, 0] *= -1.0
    unknown[0, 3] = np.nan
    projective[3, 0] = 0.5
    np.testing.assert_array_equal(is_rigid(np.stack([T, scaled, mirrored, unknown, projective])), [True, *[False] * 4])
