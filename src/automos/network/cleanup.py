"""From pixels back to points: each point asks the nearest pixels around its own (RangeNet++, IV-C).

A pixel shows one point; others that fall into it may lie behind, on something else. Voters are the pixels of a window
whose ranges come nearest to the point's.
"""

import numpy as np
import numpy.typing as npt

from automos.core.kernels import kernel
from automos.core.range_image import over_neighbours
from automos.network.images import RangeImage
from automos.network.projection import Image

# As RangeNet++ publishes them for KITTI.
_RADIUS = 2
"""Pixels around a point's own in which voters are looked for: 5 x 5."""
_VOTERS = 5
_SIGMA = 1.0
"""Pixels, how soon far voters count less."""
_CUTOFF = 1.0
"""Metres: pixels whose range differs by more do not vote."""


def vote(image: RangeImage, moving: Image) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return for every point (N,) the share of its voters that are moving, and their mean probability of it.

    Most of an image agrees on standing still: where all of a window do, nobody is asked, and the mean is the pixel's.

    Parameters
    ----------
    image : RangeImage
        The image that was segmented.
    moving : (H, W) float32
        Probability of moving in each pixel.

    Where no pixel is near enough the nearest one votes; points without a pixel have 0.
    """
    share, mean = np.zeros((2, len(image.pixels)), np.float32)
    offsets = np.arange(-_RADIUS, _RADIUS + 1)
    squared = offsets[:, None] ** 2 + offsets[None, :] ** 2
    far = (1.0 - np.exp(-squared / (2.0 * _SIGMA**2))).astype(np.float32)  # 0 in the middle
    seen = image.channels[0]
    moves, stands = (seen > 0.0) & (moving > 0.5), (seen > 0.0) & (moving <= 0.5)
    for _ in range(_RADIUS):
        moves, stands = over_neighbours(moves, np.logical_or), over_neighbours(stands, np.logical_or)
    is_mixed = moves & stands  # of the window around each pixel
    _vote(image.pixels, image.ranges, seen, moving, is_mixed, far, _VOTERS, _CUTOFF, share, mean)
    return share, mean


@kernel
def _vote(pixels, ranges, seen, moving, is_mixed, far, voters, cutoff, share, mean):  # type: ignore[no-untyped-def]
    height, width = seen.shape
    radius = len(far) // 2
    costs, values = np.empty(voters, np.float32), np.empty(voters, np.float32)
    for i in range(len(pixels)):
        if pixels[i] < 0:
            continue
        row, column = pixels[i] // width, pixels[i] % width
        if not is_mixed[row, column]:
            share[i], mean[i] = np.float32(moving[row, column] > 0.5), moving[row, column]
            continue
        n, closest, fallback = 0, np.float32(np.inf), np.float32(0.0)
        for a in range(-radius, radius + 1):
            if not 0 <= row + a < height:
                continue
            for b in range(-radius, radius + 1):
                c = (column + b) % width
                r = seen[row + a, c]
                if r == 0.0:
                    continue
                apart = abs(r - ranges[i])
                if apart < closest:
                    closest, fallback = apart, moving[row + a, c]
                # the middle would win whatever lies in front of the point, so it costs as its neighbours do
                cost = apart * (far[a + radius, b + radius] if a != 0 or b != 0 else far[radius, radius + 1])
                if apart > cutoff or (n == voters and cost >= costs[n - 1]):
                    continue
                k = n if n < voters else n - 1
                while k > 0 and costs[k - 1] > cost:
                    costs[k], values[k] = costs[k - 1], values[k - 1]
                    k -= 1
                costs[k], values[k] = cost, moving[row + a, c]
                n = min(n + 1, voters)
        if n == 0:
            n, values[0] = 1, fallback
        total, yes = np.float32(0.0), 0
        for k in range(n):
            total += values[k]
            yes += values[k] > 0.5
        share[i], mean[i] = yes / n, total / n
