"""The vehicle's own body: what stays put in the sensor's frame while the world goes by.

A ray that meets the body meets it in every scan at the same range. So may a ray that meets an even road, a vehicle that
keeps its distance, or the long side of one that drives along; but ground does not count, nor what stands behind ground
(under the body's parts is more body), and a thing's edges must stay put as well, from the first third of the recording
to the last, and its ranges nearly to the sensor's noise: nobody drives that straight beside another. Where the sensor
stands still nothing can be told, and nothing goes wrong: what never moves is static.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt
from scipy import ndimage

from automos.candidates.free_space_pattern import BeamPattern, raw_points, sine_bin, turn_of
from automos.candidates.ground import segment_ground
from automos.scan import Frames, Mask, Points
from automos.settings import EgoBodySettings, GroundSettings

_SECTORS = 90


@dataclass(frozen=True, eq=False)
class EgoBody:
    """How far the vehicle's own body reaches along each ray of the sensor.

    Attributes
    ----------
    reach : (H, W) float32, metres, on the pattern's grid; 0 where the body is not in the way.
    pattern : the grid.
    """

    reach: npt.NDArray[np.float32]
    pattern: BeamPattern

    def covers(self, points: Points) -> Mask:
        """Return (M,) bool: which of `points` (M, 3) of a raw sweep, sensor frame, lie on the body."""
        is_body = np.zeros(len(points), np.bool_)
        if self.reach.any():
            _within_reach(points, self.pattern.row_of_sine, self.reach, is_body)
        return is_body


def find_ego_body(
    frames: Frames, pattern: BeamPattern, settings: EgoBodySettings, ground: GroundSettings, threads: int = 2
) -> EgoBody:
    """Return the body that a handful of `frames`, spread over the recording, show."""
    reach = np.zeros((pattern.n_rows, pattern.n_columns), np.float32)
    sample = _scans_apart(frames, settings)
    if len(sample) < settings.min_scans:
        return EgoBody(reach, pattern)

    def look(index: int) -> npt.NDArray[np.float32]:
        frame, image = frames[index], np.zeros_like(reach)
        raw, up = raw_points(frame), frame.T_level_sensor[2, :3]
        on_ground = segment_ground(frame.points_level, frame.origin_level, ground)
        ground_from = np.full(_SECTORS, np.float32(settings.max_range))
        _nearest_ground(raw, up, on_ground, ground_from)
        _nearest_ranges(raw, up, ground_from, on_ground, pattern, image)
        return image

    with ThreadPoolExecutor(threads) as pool:
        ranges = np.stack(list(pool.map(look, sample)))
    thirds = np.zeros((3, *reach.shape), np.float32)
    for third, part in zip(thirds, np.array_split(ranges, 3), strict=True):
        _find_constant(part, settings.tolerance, settings.min_share, third)
    return EgoBody(_grow(np.where(_stays_put(thirds, settings), thirds.max(axis=0), 0.0)), pattern)


def _scans_apart(frames: Frames, settings: EgoBodySettings) -> list[int]:
    """Return up to `max_scans` of `frames`, evenly spread, each some way from the one before."""
    origins = frames.T_level_sensor[:, :3, 3]
    sample: list[int] = []
    for i in np.unique(np.linspace(0, len(frames) - 1, 2 * settings.max_scans).astype(int)):
        if not sample or np.linalg.norm(origins[i] - origins[sample[-1]]) > settings.min_distance:
            sample.append(int(i))
    return sample[: settings.max_scans]


def _stays_put(thirds: npt.NDArray[np.float32], settings: EgoBodySettings) -> npt.NDArray[np.bool_]:
    """Return (H, W) bool: connected parts that are in the same place in all `thirds` (3, H, W; 0 where not there)."""
    around = np.ones((3, 3), bool)
    is_there = thirds > 0.0
    parts, n_parts = ndimage.label(is_there.any(axis=0), around)
    # A cell to each side is allowed for: edges are hit and missed by turns.
    is_in_all = np.all([ndimage.binary_dilation(third, around) for third in is_there], axis=0)
    overlap = ndimage.mean(is_in_all, parts, np.arange(n_parts + 1))
    overlap[0] = 0.0
    drift = np.where(is_there.all(axis=0), np.ptp(thirds, axis=0), np.nan)
    is_steady = np.zeros(n_parts + 1, np.bool_)
    for part, window in enumerate(ndimage.find_objects(parts), 1):
        of_part = drift[window][parts[window] == part]
        of_part = of_part[np.isfinite(of_part)]
        is_steady[part] = len(of_part) > 0 and np.median(of_part) <= settings.max_drift
    return is_steady[parts] & (overlap[parts] >= settings.min_overlap)


def _grow(reach: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return `reach` grown by one cell to each side: the body's edges are hit and missed by turns."""
    rows = np.maximum(reach, np.maximum(np.pad(reach[1:], ((0, 1), (0, 0))), np.pad(reach[:-1], ((1, 0), (0, 0)))))
    return np.maximum(rows, np.maximum(np.roll(rows, 1, axis=1), np.roll(rows, -1, axis=1)))


@numba.njit(cache=True, nogil=True)
def _cell(x, y, z, row_of_sine, h, w):  # type: ignore[no-untyped-def]
    """Range, row (-1 outside the pattern) and column of a point."""
    r = np.sqrt(x * x + y * y + z * z)
    row = row_of_sine[sine_bin(z, r, len(row_of_sine))]
    v = int(row) if 0.0 <= row < h else -1
    return r, v, int(turn_of(x, y) * np.float32(w))


@numba.njit(cache=True, nogil=True)
def _level_distance(x, y, z, up):  # type: ignore[no-untyped-def]
    """Horizontal distance from the sensor, whichever way it is mounted."""
    height = up[0] * x + up[1] * y + up[2] * z
    return np.sqrt(max(x * x + y * y + z * z - height * height, 0.0))


@numba.njit(cache=True, nogil=True)
def _nearest_ground(points, up, is_ground, ground_from):  # type: ignore[no-untyped-def]
    """Lower `ground_from` to the nearest ground in each sector of azimuth."""
    for i in range(len(points)):
        if is_ground[i]:
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            j = int(turn_of(x, y) * np.float32(len(ground_from)))
            ground_from[j] = min(ground_from[j], _level_distance(x, y, z, up))


@numba.njit(cache=True, nogil=True)
def _nearest_ranges(points, up, ground_from, is_ground, pattern, image):  # type: ignore[no-untyped-def]
    """Nearest range per cell, infinite for what cannot be body, 0 without return."""
    h, w = image.shape
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        r, v, u = _cell(x, y, z, pattern.row_of_sine, h, w)
        if v >= 0:
            if is_ground[i] or _level_distance(x, y, z, up) >= ground_from[u * len(ground_from) // w]:
                r = np.float32(np.inf)
            if image[v, u] == 0.0 or r < image[v, u]:
                image[v, u] = r


@numba.njit(cache=True, nogil=True)
def _find_constant(ranges, tolerance, min_share, reach):  # type: ignore[no-untyped-def]
    """Set `reach` where most scans' ranges are the same."""
    n, h, w = ranges.shape
    values = np.empty(n, np.float32)
    for v in range(h):
        for u in range(w):
            m = 0
            for k in range(n):
                if ranges[k, v, u] > 0.0:
                    at = m  # kept in order: sorting costs seconds to compile
                    while at > 0 and values[at - 1] > ranges[k, v, u]:
                        values[at] = values[at - 1]
                        at -= 1
                    values[at] = ranges[k, v, u]
                    m += 1
            if m == 0 or m < min_share * n:
                continue
            median = 0.5 * (values[(m - 1) // 2] + values[m // 2])
            if not np.isfinite(median):
                continue
            same = 0
            for k in range(m):
                same += abs(values[k] - median) < tolerance
            if same >= min_share * m:
                reach[v, u] = median + tolerance


@numba.njit(cache=True, nogil=True)
def _within_reach(points, row_of_sine, reach, is_body):  # type: ignore[no-untyped-def]
    h, w = reach.shape
    farthest = reach.max()
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if x * x + y * y + z * z < farthest * farthest:
            r, v, u = _cell(x, y, z, row_of_sine, h, w)
            is_body[i] = v >= 0 and r < reach[v, u]
