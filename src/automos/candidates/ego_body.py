"""The vehicle's own body: what stays put in the sensor's frame while the world goes by.

A ray that meets the body meets it in every scan at the same range. Ground does so too on an even road, so ground points
do not count; nor does anything in a recording whose sensor stands still, where nothing can be told (and nothing goes
wrong: what never moves is static).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from automos.candidates.free_space_pattern import BeamPattern, raw_points
from automos.candidates.ground import segment_ground
from automos.scan import Frame, Mask
from automos.settings import EgoBodySettings, GroundSettings


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

    def covers(self, frame: Frame) -> Mask:
        """Return (M,) bool: which of the frame's points lie on the body."""
        is_body = np.zeros(len(frame.points), np.bool_)
        if self.reach.any():
            _within_reach(raw_points(frame), self.pattern.row_of_sine, self.reach, is_body)
        return is_body


def find_ego_body(
    frames: Sequence[Frame], pattern: BeamPattern, settings: EgoBodySettings, ground: GroundSettings
) -> EgoBody:
    """Return the body that a handful of `frames`, spread over the recording, show."""
    reach = np.zeros((pattern.n_rows, pattern.n_columns), np.float32)
    sample = _frames_apart(frames, settings)
    if len(sample) < settings.min_scans:
        return EgoBody(reach, pattern)
    ranges = np.zeros((len(sample), *reach.shape), np.float32)
    for image, frame in zip(ranges, sample, strict=True):
        on_ground = segment_ground(frame.points_level, frame.origin_level, ground)
        _nearest_ranges(raw_points(frame), on_ground, pattern.row_of_sine, np.float32(settings.max_range), image)
    _find_constant(ranges, settings.tolerance, settings.min_share, reach)
    return EgoBody(_grow(reach), pattern)


def _frames_apart(frames: Sequence[Frame], settings: EgoBodySettings) -> list[Frame]:
    """Return up to `max_scans` of `frames`, evenly spread, each some way from the one before."""
    sample: list[Frame] = []
    for i in np.unique(np.linspace(0, len(frames) - 1, 2 * settings.max_scans).astype(int)):
        frame = frames[int(i)]
        if not sample or np.linalg.norm(frame.origin_level - sample[-1].origin_level) > settings.min_distance:
            sample.append(frame)
    return sample[: settings.max_scans]


def _grow(reach: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return `reach` grown by one cell to each side: the body's edges are hit and missed by turns."""
    rows = np.maximum(reach, np.maximum(np.pad(reach[1:], ((0, 1), (0, 0))), np.pad(reach[:-1], ((1, 0), (0, 0)))))
    return np.maximum(rows, np.maximum(np.roll(rows, 1, axis=1), np.roll(rows, -1, axis=1)))


@numba.njit(cache=True, nogil=True)
def _cell(x, y, z, row_of_sine, h, w):  # type: ignore[no-untyped-def]
    """Range, row (-1 outside the pattern) and column of a point."""
    r = np.sqrt(x * x + y * y + z * z)
    row = row_of_sine[int((z / r + 1.0) * ((len(row_of_sine) - 1) / 2))]
    v = int(row) if 0.0 <= row < h else -1
    return r, v, int((np.arctan2(y, x) / (2.0 * np.pi) + 0.5) * w) % w


@numba.njit(cache=True, nogil=True)
def _nearest_ranges(points, is_ground, row_of_sine, max_range, image):  # type: ignore[no-untyped-def]
    """Nearest range per cell; beyond `max_range` or on the ground it counts as infinite, no return as 0."""
    h, w = image.shape
    for i in range(len(points)):
        r, v, u = _cell(points[i, 0], points[i, 1], points[i, 2], row_of_sine, h, w)
        if v >= 0:
            if is_ground[i] or r > max_range:
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
                    values[m] = ranges[k, v, u]
                    m += 1
            if m < min_share * n:
                continue
            median = np.median(values[:m])
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
    for i in range(len(points)):
        r, v, u = _cell(points[i, 0], points[i, 1], points[i, 2], row_of_sine, h, w)
        is_body[i] = v >= 0 and r < reach[v, u]
