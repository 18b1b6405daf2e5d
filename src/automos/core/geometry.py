"""Rigid transforms and angles.

Transforms are named by their frames, `T_target_source`, so that a wrong product is visible; chains match on the inside.
"""

import numpy as np
import numpy.typing as npt

from automos.core.arrays import Array, Pose
from automos.core.errors import InputError
from automos.core.kernels import kernel

FARTHEST = 1e8
"""Metres from the origin of poses: those of grids over a country, or counted from the Earth's middle, stay below."""


def transform(T: npt.ArrayLike, points: npt.NDArray) -> npt.NDArray:
    """Return `points` (N, 3), float32 or float64, mapped by `T` (4, 4), in the points' dtype; computed in float64."""
    out = np.empty_like(points)
    _transform(np.asarray(T, np.float64), points, out)
    return out


@kernel
def _transform(T, points, out):  # type: ignore[no-untyped-def]
    # BLAS spends ten times as long on a matrix of three columns, and wakes all its threads for it.
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for a in range(3):
            out[i, a] = T[a, 0] * x + T[a, 1] * y + T[a, 2] * z + T[a, 3]


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
    """Return the (..., 4, 4) transforms of rotations `R` (..., 3, 3) and translations `t` (..., 3), by default none."""
    shape = np.asarray(R).shape[:-2] if R is not None else np.asarray(t).shape[:-1]
    T = np.tile(np.eye(4), (*shape, 1, 1))
    if R is not None:
        T[..., :3, :3] = R
    if t is not None:
        T[..., :3, 3] = t
    return T


def upright_pose(heading: npt.ArrayLike, place: npt.ArrayLike) -> Array:
    """Return (4, 4) of what stands upright at `place` (3,), its x-axis along `heading` (2,), which is of length 1."""
    c, s = np.asarray(heading)
    return make_transform([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], place)


def turn_and_shift(T_from: Pose, T_to: Pose) -> Pose:
    """Return the turn about the vertical and the level shift that take pose `T_from` above or below `T_to`."""
    angle = np.arctan2(T_to[1, 0], T_to[0, 0]) - np.arctan2(T_from[1, 0], T_from[0, 0])
    T = upright_pose((np.cos(angle), np.sin(angle)), np.zeros(3))
    T[:2, 3] = T_to[:2, 3] - (T @ T_from)[:2, 3]
    return T


def quaternion_of(T: npt.ArrayLike) -> Array:
    """Return (4,) the rotation of `T` (4, 4) as x, y, z, w, the first of w, x, y, z that is not 0 positive."""
    from scipy.spatial.transform import Rotation

    found: Array = Rotation.from_matrix(np.asarray(T)[:3, :3]).as_quat(canonical=True)
    return found


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
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(inverse(T) @ T - np.eye(4)).max(axis=(-1, -2)) + np.abs(T[..., 3, :] - np.eye(4)[3]).max(axis=-1)
        return np.asarray(is_finite & (off <= tolerance) & (np.linalg.det(T) > 0.0))


def checked_poses(poses: Pose, n: int) -> Pose:
    """Return (n, 4, 4) `poses` with exact rotations, in the frame of the first one.

    Raises
    ------
    InputError
        They are not one rigid transform per scan, or not on Earth.
    """
    poses = np.array(poses, np.float64)
    if poses.shape != (n, 4, 4):
        raise InputError(f"poses must be ({n}, 4, 4), one per scan, got shape {poses.shape}; give one pose per scan.")
    if not (is_valid := is_rigid(poses)).all():
        raise InputError(f"pose {np.argmin(is_valid)} is not a rigid transform; check the pose file's format.")
    if not (is_near := (np.abs(poses[:, :3, 3]) < FARTHEST).all(axis=1)).all():
        row = np.argmin(is_near)
        raise InputError(f"pose {row} is not on Earth (further than {FARTHEST:.0e} m from the origin); check its unit.")
    poses = with_exact_rotations(poses)  # pose files are rounded
    return inverse(poses[0]) @ poses


def with_exact_rotations(T: Pose) -> Pose:
    """Return `T` (..., 4, 4) with the exact rotations nearest to given ones, which may be rounded."""
    exact = np.array(T, np.float64)
    u, _, vt = np.linalg.svd(exact[..., :3, :3])
    exact[..., :3, :3] = u @ vt
    return exact


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
        axis = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
        axis /= np.linalg.norm(axis)
        return 2.0 * np.outer(axis, axis) - np.eye(3)
    K = skew(v)
    return np.eye(3) + K + K @ K / (1.0 + c)


def wrap_angle(angle: npt.ArrayLike) -> Array:
    """Return angles in radians wrapped to [-pi, pi)."""
    return (np.asarray(angle, np.float64) + np.pi) % (2.0 * np.pi) - np.pi
