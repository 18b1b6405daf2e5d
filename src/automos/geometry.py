"""Rigid transforms, upright boxes, and what can be asked of them.

Transforms are named by their frames, `T_target_source`, so that a wrong product is visible; chains match on the inside.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


# ---------------------------------------------------------------------------------------------- rigid transforms
def transform(T: npt.ArrayLike, points: npt.NDArray) -> npt.NDArray:
    """Return `points` (N, 3), float32 or float64, mapped by `T` (4, 4), in the points' dtype; computed in float64."""
    out = np.empty_like(points)
    _transform(np.asarray(T, np.float64), points, out)
    return out


@numba.njit(cache=True, nogil=True)
def _transform(T, points, out):  # type: ignore[no-untyped-def]
    # BLAS spends ten times as long on a matrix of three columns, and wakes all its threads for it.
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for a in range(3):
            out[i, a] = T[a, 0] * x + T[a, 1] * y + T[a, 2] * z + T[a, 3]


@numba.njit(cache=True, nogil=True)
def whole_below(x):  # type: ignore[no-untyped-def]
    """Return the whole number below `x` as int64, 0 for what none of them can hold; for kernels that name cells."""
    return np.int64(np.floor(x)) if abs(x) < 1e15 else np.int64(0)


def inverse(T: npt.ArrayLike) -> Array:
    """Return the inverse of rigid transforms `T` (..., 4, 4)."""
    T = np.asarray(T, np.float64)
    R_inv = np.swapaxes(T[..., :3, :3], -1, -2)
    out = np.zeros_like(T)
    out[..., :3, :3] = R_inv
    out[..., :3, 3] = -np.einsum("...ij,...j->...i", R_inv, T[..., :3, 3])
    out[..., 3, 3] = 1.0
    return out


def make_transform(R: npt.ArrayLike | None = None, t: npt.ArrayLike | None = None) -> Array:
    """Return the (4, 4) transform with rotation `R` (3, 3) and translation `t` (3,), identity where not given."""
    T = np.eye(4)
    if R is not None:
        T[:3, :3] = R
    if t is not None:
        T[:3, 3] = t
    return T


def se3_exp(xi: npt.ArrayLike) -> Array:
    """Return the (..., 4, 4) transforms of twists `xi` (..., 6): translation part first, then rotation vector."""
    xi = np.asarray(xi, np.float64)
    rho, phi = xi[..., :3], xi[..., 3:]
    angle = np.linalg.norm(phi, axis=-1)[..., None, None]
    small = angle < 1e-8
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1.0, np.sin(safe) / safe)
    b = np.where(small, 0.5, (1.0 - np.cos(safe)) / safe**2)
    c = np.where(small, 1.0 / 6.0, (safe - np.sin(safe)) / safe**3)
    K = skew(phi)
    KK = K @ K
    T = np.zeros((*xi.shape[:-1], 4, 4))
    T[..., :3, :3] = np.eye(3) + a * K + b * KK
    T[..., :3, 3] = np.einsum("...ij,...j->...i", np.eye(3) + b * K + c * KK, rho)
    T[..., 3, 3] = 1.0
    return T


def se3_log(T: npt.ArrayLike) -> Array:
    """Return the (..., 6) twists of rigid transforms `T` (..., 4, 4); the inverse of `se3_exp`."""
    from scipy.spatial.transform import Rotation

    T = np.asarray(T, np.float64)
    batch = T.shape[:-2]
    phi = Rotation.from_matrix(T[..., :3, :3].reshape(-1, 3, 3)).as_rotvec().reshape(*batch, 3)
    angle = np.linalg.norm(phi, axis=-1)[..., None, None]
    small = angle < 1e-6
    safe = np.where(small, 1.0, angle)
    K = skew(phi)
    # V^-1 = I - K/2 + (1/angle^2 - (1 + cos) / (2 angle sin)) K^2
    with np.errstate(divide="ignore", invalid="ignore"):
        k = np.where(small, 1.0 / 12.0, 1.0 / safe**2 - (1.0 + np.cos(safe)) / (2.0 * safe * np.sin(safe)))
    V_inv = np.eye(3) - 0.5 * K + k * (K @ K)
    rho = np.einsum("...ij,...j->...i", V_inv, T[..., :3, 3])
    return np.concatenate([rho, phi], axis=-1)


def adjoint(T: npt.ArrayLike) -> Array:
    """Return the (..., 6, 6) adjoints of `T` (..., 4, 4): they turn small motions of the source into the target's."""
    T = np.asarray(T, np.float64)
    R, t = T[..., :3, :3], T[..., :3, 3]
    out = np.zeros((*T.shape[:-2], 6, 6))
    out[..., :3, :3] = out[..., 3:, 3:] = R
    out[..., :3, 3:] = skew(t) @ R
    return out


def is_rigid(T: npt.ArrayLike, tolerance: float = 0.01) -> npt.NDArray[np.bool_]:
    """Return (...,) bool: which of `T` (..., 4, 4) are rotation and translation only, to `tolerance` per entry."""
    T = np.asarray(T, np.float64)
    is_finite = np.isfinite(T).all(axis=(-1, -2))
    T = np.where(is_finite[..., None, None], T, 0.0)
    off = np.abs(inverse(T) @ T - np.eye(4)).max(axis=(-1, -2)) + np.abs(T[..., 3, :] - np.eye(4)[3]).max(axis=-1)
    return np.asarray(is_finite & (off <= tolerance) & (np.linalg.det(T) > 0.0))


def skew(v: npt.ArrayLike) -> Array:
    """Return the (..., 3, 3) matrices whose product with a vector is the cross product with `v` (..., 3)."""
    v = np.asarray(v, np.float64)
    K = np.zeros((*v.shape, 3))
    K[..., 0, 1], K[..., 0, 2], K[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    K[..., 1, 0], K[..., 2, 0], K[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return K


def rotation_between(a: npt.ArrayLike, b: npt.ArrayLike) -> Array:
    """Return the (3, 3) rotation of least angle that turns direction `a` (3,) onto direction `b` (3,)."""
    a = np.asarray(a, np.float64) / np.linalg.norm(a)
    b = np.asarray(b, np.float64) / np.linalg.norm(b)
    v, c = np.cross(a, b), float(a @ b)
    if c < -1.0 + 1e-9:  # opposite: half a turn about any axis at right angles
        axis = np.cross(a, [1.0, 0.0, 0.0] if abs(a[0]) < 0.9 else [0.0, 1.0, 0.0])
        axis /= np.linalg.norm(axis)
        return 2.0 * np.outer(axis, axis) - np.eye(3)
    K = skew(v)
    return np.eye(3) + K + K @ K / (1.0 + c)


def wrap_angle(angle: npt.ArrayLike) -> Array:
    """Return angles in radians wrapped to [-pi, pi)."""
    return (np.asarray(angle, np.float64) + np.pi) % (2.0 * np.pi) - np.pi


# ------------------------------------------------------------------------------------------------- upright boxes
@dataclass(frozen=True, eq=False)
class Boxes:
    """Upright oriented boxes, one row each, in one frame (paper III-C: b = (c, theta, l, w, h, s)).

    Attributes
    ----------
    center : (M, 3) float64, metres.
    size : (M, 3) float64, metres: length (along the heading), width, height; all >= 0.
    yaw : (M,) float64, radians about +z, of the length axis.
    score : (M,) float64 in [0, 1].
    """

    center: Array
    size: Array
    yaw: Array
    score: Array

    def __post_init__(self) -> None:
        m = len(self.center)
        for name, shape in (("center", (m, 3)), ("size", (m, 3)), ("yaw", (m,)), ("score", (m,))):
            got = getattr(self, name).shape
            if got != shape:
                raise ValueError(f"{name} must be {shape}, got shape {got}")

    def __len__(self) -> int:
        return len(self.center)

    def __getitem__(self, rows: npt.NDArray) -> Boxes:
        return Boxes(*(getattr(self, f.name)[rows] for f in fields(self)))

    @property
    def volume(self) -> Array:
        """(M,) cubic metres."""
        return self.size.prod(axis=1)

    @property
    def longest_side(self) -> Array:
        """(M,) metres."""
        return self.size.max(axis=1, initial=0.0)

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return the columns by name, for saving."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @staticmethod
    def from_arrays(arrays: Mapping[str, npt.NDArray]) -> Boxes:
        """Return the boxes that `to_arrays` took apart."""
        return Boxes(*(np.asarray(arrays[f.name]) for f in fields(Boxes)))

    @staticmethod
    def empty() -> Boxes:
        """Return no boxes."""
        return Boxes(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))

    @staticmethod
    def concatenate(parts: list[Boxes]) -> Boxes:
        """Return the boxes of all `parts`, in order."""
        if not parts:
            return Boxes.empty()
        return Boxes(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Boxes)))

    def corners(self) -> Array:
        """Return (M, 4, 2) ground corners, counter-clockwise."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        signs = np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]])
        local = signs[None] * self.size[:, None, :2]  # (M, 4, 2)
        x = local[..., 0] * c[:, None] - local[..., 1] * s[:, None]
        y = local[..., 0] * s[:, None] + local[..., 1] * c[:, None]
        return np.stack([x, y], axis=-1) + self.center[:, None, :2]

    def transformed(self, T: npt.ArrayLike) -> Boxes:
        """Return the boxes mapped by `T` (4, 4), which must keep +z upright (yaw and translation only)."""
        T = np.asarray(T, np.float64)
        turn = np.arctan2(T[1, 0], T[0, 0])
        return Boxes(transform(T, self.center), self.size, wrap_angle(self.yaw + turn), self.score)


def iou_3d(a: Boxes, b: Boxes) -> Array:
    """Return the (len(a), len(b)) intersection over union of upright rotated boxes; 0 where a volume is 0."""
    out = np.zeros((len(a), len(b)))
    _iou_3d(a.corners(), a.center[:, 2], a.size, b.corners(), b.center[:, 2], b.size, a.center, b.center, out)
    return out


@numba.njit(cache=True, nogil=True)
def _iou_3d(corners_a, z_a, size_a, corners_b, z_b, size_b, center_a, center_b, out):  # type: ignore[no-untyped-def]
    for i in range(len(corners_a)):
        volume_a = size_a[i, 0] * size_a[i, 1] * size_a[i, 2]
        radius_a = np.hypot(size_a[i, 0], size_a[i, 1])
        for j in range(len(corners_b)):
            volume_b = size_b[j, 0] * size_b[j, 1] * size_b[j, 2]
            reach = 0.5 * (radius_a + np.hypot(size_b[j, 0], size_b[j, 1]))
            if np.hypot(center_a[i, 0] - center_b[j, 0], center_a[i, 1] - center_b[j, 1]) > reach:
                continue
            top = min(z_a[i] + 0.5 * size_a[i, 2], z_b[j] + 0.5 * size_b[j, 2])
            bottom = max(z_a[i] - 0.5 * size_a[i, 2], z_b[j] - 0.5 * size_b[j, 2])
            if top <= bottom or volume_a <= 0.0 or volume_b <= 0.0:
                continue
            inter = _clip_area(corners_a[i], corners_b[j]) * (top - bottom)
            out[i, j] = inter / (volume_a + volume_b - inter)


@numba.njit(cache=True, nogil=True)
def _clip_area(subject, clip):  # type: ignore[no-untyped-def]
    """Area of the intersection of two convex counter-clockwise quadrilaterals (Sutherland and Hodgman)."""
    polygon = np.empty((12, 2))
    clipped = np.empty((12, 2))
    n = 4
    polygon[:4] = subject
    for e in range(4):
        ax, ay = clip[e]
        bx, by = clip[(e + 1) % 4]
        m = 0
        for k in range(n):
            px, py = polygon[k]
            qx, qy = polygon[(k + 1) % n]
            side_p = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
            side_q = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
            if side_p >= 0.0:
                clipped[m, 0], clipped[m, 1] = px, py
                m += 1
            if (side_p > 0.0 and side_q < 0.0) or (side_p < 0.0 and side_q > 0.0):
                s = side_p / (side_p - side_q)
                clipped[m, 0], clipped[m, 1] = px + s * (qx - px), py + s * (qy - py)
                m += 1
        n = m
        polygon[:n] = clipped[:n]
        if n == 0:
            return 0.0
    area = 0.0
    for k in range(n):
        area += polygon[k, 0] * polygon[(k + 1) % n, 1] - polygon[k, 1] * polygon[(k + 1) % n, 0]
    return max(0.5 * area, 0.0)


def points_in_boxes(points: npt.NDArray, boxes: Boxes, margin: float = 0.0) -> npt.NDArray[np.int32]:
    """Return (N,) int32: for each of `points` (N, 3) the row of the first box that holds it, -1 for none.

    `margin` in metres grows every box on all sides (negative shrinks it). Box and points are in the same frame.
    """
    owner = np.full(len(points), -1, np.int32)
    half = 0.5 * boxes.size + margin
    _points_in_boxes(np.asarray(points), boxes.center, half, np.cos(boxes.yaw), np.sin(boxes.yaw), owner)
    return owner


@numba.njit(cache=True, nogil=True)
def _points_in_boxes(points, center, half, cos, sin, owner):  # type: ignore[no-untyped-def]
    reach = np.empty(len(center))
    for j in range(len(center)):
        reach[j] = np.hypot(half[j, 0], half[j, 1])
    for i in range(len(points)):
        for j in range(len(center)):
            dx = points[i, 0] - center[j, 0]
            if abs(dx) > reach[j]:
                continue
            dy = points[i, 1] - center[j, 1]
            if abs(dy) > reach[j] or abs(points[i, 2] - center[j, 2]) > half[j, 2]:
                continue
            along = cos[j] * dx + sin[j] * dy
            across = cos[j] * dy - sin[j] * dx
            if abs(along) <= half[j, 0] and abs(across) <= half[j, 1]:
                owner[i] = j
                break
