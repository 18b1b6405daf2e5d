"""Ground by height images: what lies in no image's edges is even, and low and even is ground.

The ground segmentation of Arora et al. (ECMR 2021): the scan is drawn from above, height as grey; Canny finds edges,
which are widened by a pixel; low points off the edges are ground. Images of several pixel sizes vote.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel
from automos.core.scan import Mask


@dataclass(frozen=True)
class HeightImages:
    """The values of Arora et al., section III-A and their public code; heights are above the ground under the sensor.

    Attributes
    ----------
    reach : float
        Metres around the sensor.
    cells : tuple of float
        Metres, pixels of the images.
    low, high : float
        Metres, black and white.
    weak_edge, strong_edge : float
        Grey values, Canny's thresholds.
    max_ground : float
        Metres, what is higher is not ground.
    share : float
        Of the images that must call a point ground.
    """

    reach: float = 50.0
    cells: tuple[float, ...] = (0.05, 0.07, 0.09, 0.11, 0.13)
    low: float = -0.27
    high: float = 3.23
    weak_edge: float = 15.0
    strong_edge: float = 300.0
    max_ground: float = 0.63
    share: float = 0.5


HEIGHT_IMAGES = HeightImages()


def find_ground(points: npt.NDArray, images: HeightImages) -> Mask:
    """Return (M,) bool: which of `points` (M, 3) are ground.

    points : metres, z up, the sensor above the origin and the ground under it at z = 0.
    """
    votes = np.zeros(len(points), np.int64)
    is_low = points[:, 2] < images.max_ground
    for cell in images.cells:
        side = int(np.ceil(2.0 * images.reach / cell))
        rows = ((points[:, 1] + images.reach) / cell).astype(np.int64)
        columns = ((points[:, 0] + images.reach) / cell).astype(np.int64)
        inside = np.flatnonzero((np.abs(points[:, :2]) < images.reach).all(axis=1))
        rows, columns = np.minimum(rows[inside], side - 1), np.minimum(columns[inside], side - 1)
        grey = (points[inside, 2] - images.low) * (255.0 / (images.high - images.low))
        image = np.zeros((side, side), np.uint8)
        np.maximum.at(image.reshape(-1), rows * side + columns, np.clip(grey, 0.0, 255.0).astype(np.uint8))
        is_edge = find_edges(image, images.weak_edge, images.strong_edge)
        _add_votes(rows, columns, inside, is_edge, votes)
    return is_low & (votes >= images.share * len(images.cells)) & (votes > 0)


@kernel
def _add_votes(rows, columns, inside, is_edge, votes):  # type: ignore[no-untyped-def]
    h, w = is_edge.shape
    for i in range(len(rows)):
        near_edge = False
        for v in range(max(rows[i] - 1, 0), min(rows[i] + 2, h)):  # the edges, widened by a pixel
            for u in range(max(columns[i] - 1, 0), min(columns[i] + 2, w)):
                near_edge |= is_edge[v, u]
        if not near_edge:
            votes[inside[i]] += 1


@kernel
def find_edges(image, weak, strong):  # type: ignore[no-untyped-def]
    """Return (H, W) bool: Canny's edges of `image` (H, W) uint8 (Sobel, sum of absolute gradients, not blurred)."""
    h, w = image.shape
    size, along = np.zeros((h, w), np.float32), np.zeros((h, w), np.uint8)
    for v in range(1, h - 1):
        for u in range(1, w - 1):
            a, b, c = np.int32(image[v - 1, u - 1]), np.int32(image[v - 1, u]), np.int32(image[v - 1, u + 1])
            d, e = np.int32(image[v, u - 1]), np.int32(image[v, u + 1])
            f, g, i = np.int32(image[v + 1, u - 1]), np.int32(image[v + 1, u]), np.int32(image[v + 1, u + 1])
            if a + b + c + d + e + f + g + i == 0:
                continue
            gx, gy = c + 2 * e + i - a - 2 * d - f, f + 2 * g + i - a - 2 * b - c
            size[v, u] = abs(gx) + abs(gy)
            if abs(gy) < 0.41421356 * abs(gx):
                along[v, u] = 0
            elif abs(gy) > 2.41421356 * abs(gx):
                along[v, u] = 1
            else:
                along[v, u] = 2 if gx * gy > 0 else 3
    steps = ((0, 1), (1, 0), (1, 1), (1, -1))
    is_weak, is_edge = np.zeros((h, w), np.bool_), np.zeros((h, w), np.bool_)
    stack = np.empty((h * w // 4 + 16, 2), np.int32)
    n = 0
    for v in range(1, h - 1):
        for u in range(1, w - 1):
            if size[v, u] <= weak:
                continue
            dv, du = steps[along[v, u]]
            if size[v, u] > size[v - dv, u - du] and size[v, u] >= size[v + dv, u + du]:
                is_weak[v, u] = True
                if size[v, u] > strong and n < len(stack):
                    is_edge[v, u] = True
                    stack[n] = v, u
                    n += 1
    while n > 0:
        n -= 1
        v, u = stack[n]
        for b in range(max(v - 1, 0), min(v + 2, h)):
            for a in range(max(u - 1, 0), min(u + 2, w)):
                if is_weak[b, a] and not is_edge[b, a] and n < len(stack):
                    is_edge[b, a] = True
                    stack[n] = b, a
                    n += 1
    return is_edge
