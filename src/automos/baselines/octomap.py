"""Octomap-based removal: what rays went through more often than they ended in it was there for a while only.

Our reading of Arora, Wiesmann, Chen, Stachniss, "Mapping the Static Parts of Dynamic Scenes from 3D LiDAR Point Clouds
Exploiting Ground Segmentation" (ECMR 2021): occupancy of voxels by ray casting with OctoMap's sensor model, batch by
batch; voxels with ground points stay occupied, whatever grazing rays say; a point is moving if its voxel is free, and
where its voxel is unknown its nearest neighbours decide.

Its ground is that of Arora et al. (ECMR 2021), by height images: the scan is drawn from above, height as grey; Canny
finds edges, which are widened by a pixel; low points off the edges are ground. Images of several pixel sizes vote.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.baselines.batches import BATCH, Batch, BatchSize, add_points, body_of, cut_batches, labels_by_map
from automos.baselines.brick_grid import BrickGrid
from automos.core.geometry import transform
from automos.core.kernels import kernel
from automos.core.scan import Frame, Frames, Mask


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


@dataclass(frozen=True)
class Parameters:
    """OctoMap's own sensor model (Hornung et al., Autonomous Robots 2013), voxels and ground of Arora et al.

    Attributes
    ----------
    voxel : float
        Metres.
    max_range : float
        Metres; longer rays are not cast, their ends are unknown.
    hit, miss : float
        Probability of occupied given a hit, given a ray through.
    lowest, highest : float
        Probabilities that no voxel goes beyond.
    neighbours : int
        Nearest known points that decide on an unknown one.
    kept_within : float
        Metres; what is so near to what the map keeps stays (0: by voxel alone). Ours: see docs/baselines.md.
    """

    batch: BatchSize = BATCH
    voxel: float = 0.1
    max_range: float = 60.0
    hit: float = 0.7
    miss: float = 0.4
    lowest: float = 0.12
    highest: float = 0.97
    ground: HeightImages = HEIGHT_IMAGES
    neighbours: int = 5
    kept_within: float = 0.1


def find_moving(frames: Frames, parameters: Parameters, start: int = 0) -> Iterator[tuple[int, Mask]]:
    """Yield (index, (M,) bool moving) of every frame from `start` on, in order: the points whose voxel is free."""
    for batch in cut_batches(frames, parameters.batch, start):
        ids_of, is_free, centres = _map_batch(frames, batch, parameters)
        for k, is_moving in labels_by_map(frames, batch, ids_of, is_free, centres, parameters.kept_within):
            yield k, _ask_neighbours(frames[k], ids_of[k - batch.frames[0]], is_moving, parameters.neighbours)


def _map_batch(
    frames: Frames, batch: Batch, parameters: Parameters
) -> tuple[list[npt.NDArray[np.int32]], npt.NDArray[np.bool_], npt.NDArray[np.float64]]:
    """Return each frame's points' voxels, -1 for none, (V,) which voxels are free, and their centres (V, 3)."""
    grid = BrickGrid(
        parameters.voxel, frames.T_level_sensor[batch.frames[0] : batch.frames[-1] + 1, :3, 3], parameters.max_range
    )
    T_body_sensor = body_of(frames)  # what the vehicle stands on may rise and fall
    ids_of, ground_ids = [], []
    for k in batch.frames:
        frame = frames[k]
        ids = add_points(grid, frame, parameters.max_range)
        ids_of.append(ids)
        ground_ids.append(ids[find_ground(transform(T_body_sensor, frame.points), parameters.ground) & (ids >= 0)])
    is_pinned = np.zeros(len(grid), bool)
    is_pinned[np.concatenate(ground_ids)] = True

    log_odds = np.zeros(len(grid), np.float32)
    passed, hit = np.full((2, len(grid)), -1, np.int32)
    chances = np.array([parameters.hit, parameters.miss, parameters.lowest, parameters.highest])
    model = np.log(chances / (1.0 - chances)).astype(np.float32)
    for k, ids in zip(batch.frames, ids_of, strict=True):
        frame = frames[k]
        grid.pass_rays(frame.origin_level, _shortened(frame, parameters.max_range), k, passed)
        hit[ids[ids >= 0]] = k
        _update(log_odds, passed, hit, k, *model)
    centres = grid.low + (grid.indices() + 0.5) * parameters.voxel
    return ids_of, (log_odds < 0.0) & ~is_pinned, centres


def _shortened(frame: Frame, max_range: float) -> npt.NDArray[np.float32]:
    """Return the ends (M, 3) of the frame's rays, level frame, none further than `max_range` from the sensor."""
    ranges = np.sqrt(np.einsum("ij,ij->i", frame.points, frame.points))
    points = frame.points * np.minimum(max_range / ranges, 1.0)[:, None]
    return transform(frame.T_level_sensor, points.astype(np.float32))


@kernel
def _update(log_odds, passed, hit, stamp, more, less, lowest, highest):  # type: ignore[no-untyped-def]
    """One scan's say: once per voxel, and a hit outweighs any number of rays through."""
    for v in range(len(log_odds)):
        if hit[v] == stamp:
            log_odds[v] = min(log_odds[v] + more, highest)
        elif passed[v] == stamp:
            log_odds[v] = max(log_odds[v] + less, lowest)


def _ask_neighbours(frame: Frame, ids: npt.NDArray[np.int32], is_moving: Mask, n: int) -> Mask:
    """Return `is_moving`, points without a voxel labelled as most of their `n` nearest neighbours that have one."""
    unknown, known = np.flatnonzero(ids < 0), np.flatnonzero(ids >= 0)
    if len(unknown) and len(known) >= n:
        from scipy.spatial import cKDTree

        _, nearest = cKDTree(frame.points[known]).query(frame.points[unknown], k=[*range(1, n + 1)], workers=-1)
        is_moving[unknown] = is_moving[known[nearest]].mean(axis=1) > 0.5
    return is_moving
