"""Upright boxes, rotated about the vertical: corners, overlap, and points inside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.column_data import ColumnData
from automos.core.geometry import Array, transform, wrap_angle
from automos.core.kernels import kernel


@dataclass(frozen=True, eq=False)
class Boxes(ColumnData):
    """Upright oriented boxes, one row each, in one frame (paper III-C: b = (c, theta, l, w, h, s)).

    Attributes
    ----------
    center : (M, 3) float64
        Metres.
    size : (M, 3) float64
        Metres: length (along the heading), width, height; all >= 0.
    yaw : (M,) float64
        Radians about +z, of the length axis.
    score : (M,) float64
        In [0, 1].
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

    @property
    def volume(self) -> Array:
        """(M,) cubic metres."""
        return self.size.prod(axis=1)

    @staticmethod
    def empty() -> Boxes:
        """Return no boxes."""
        return Boxes(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))

    @classmethod
    def concatenate(cls, parts: list[Boxes]) -> Boxes:
        """Return the boxes of all `parts`, in order."""
        return super().concatenate([cls.empty(), *parts])

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


class TrueBoxes(NamedTuple):
    """The boxes that people, or a simulation, drew in one scan.

    Attributes
    ----------
    ids : (K,) int64
        As in the upper 16 bits of the scan's true labels.
    boxes : Boxes
        K whole objects, in a frame in which they stand upright.
    T_boxes_sensor : (4, 4) float64
        From the sensor's frame to theirs.
    """

    ids: npt.NDArray[np.int64]
    boxes: Boxes
    T_boxes_sensor: Array


def iou_3d(a: Boxes, b: Boxes) -> Array:
    """Return the (len(a), len(b)) intersection over union of upright rotated boxes; 0 if a volume is 0."""
    out = np.zeros((len(a), len(b)))
    _iou_3d(a.corners(), a.center[:, 2], a.size, b.corners(), b.center[:, 2], b.size, a.center, b.center, out)
    return out


@kernel
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


@kernel
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
    """Return (N,) int32: the row of the first box that contains each of `points` (N, 3), -1 for none.

    `margin`, metres, is added to every side of a box; negative values shrink it. Boxes and points share a frame.
    """
    owner = np.full(len(points), -1, np.int32)
    half = 0.5 * boxes.size + margin
    _points_in_boxes(np.asarray(points), boxes.center, half, np.cos(boxes.yaw), np.sin(boxes.yaw), owner)
    return owner


@kernel
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
