"""The outline of each segment: those of its points that are farthest in each of some directions.

They say how far a segment reaches in any heading, so nobody who asks for another one needs its points again.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel
from automos.core.upright_boxes import Boxes

DIRECTIONS = 16  # of an outline, evenly around


def outlines(points: npt.NDArray, ids: npt.NDArray[np.int32], boxes: Boxes) -> npt.NDArray[np.float32]:
    """Return (S, K, 2) metres, from the centres of their boxes, where the outlines of segments 0..S-1 are.

    points : (N, 3) metres, a frame with z up.   ids : (N,) segment of each point, -1 for none; all 0..S-1 occur.
    """
    angle = np.linspace(0.0, np.pi, DIRECTIONS // 2, endpoint=False)
    out = np.zeros((len(boxes), DIRECTIONS, 2))
    _farthest(points, ids, np.cos(angle), np.sin(angle), boxes.center[:, :2], out)
    return out.astype(np.float32)


def corners(boxes: Boxes) -> npt.NDArray[np.float32]:
    """Return (S, K, 2) what `outlines` does, of segments of which only the boxes are known."""
    ends = boxes.corners() - boxes.center[:, None, :2]
    return ends[:, np.arange(DIRECTIONS) % 4].astype(np.float32)


@kernel
def _farthest(points, ids, cos, sin, center, out):  # type: ignore[no-untyped-def]
    """Write the places (S, K, 2) of the farthest points, from `center` (S, 2), in K / 2 directions and against them."""
    k = len(cos)
    farthest = np.full((len(center), 2 * k), -np.inf)
    for i in range(len(ids)):
        s = ids[i]
        if s < 0:
            continue
        x, y = points[i, 0] - center[s, 0], points[i, 1] - center[s, 1]
        for j in range(k):
            reach = x * cos[j] + y * sin[j]
            if reach > farthest[s, j]:
                farthest[s, j], out[s, j, 0], out[s, j, 1] = reach, x, y
            if -reach > farthest[s, j + k]:
                farthest[s, j + k], out[s, j + k, 0], out[s, j + k, 1] = -reach, x, y
