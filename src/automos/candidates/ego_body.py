"""The ego body: points that keep their place in the sensor's frame while the sensor moves.

A ray that meets the body returns the same range in every scan. So may a ray that meets an even road, a vehicle that
keeps its distance, or the long side of one that drives alongside. But other scans, before and after, hit the road at
its place and not the body, so they vote (`ego_body_votes`): points fixed both in the sensor's frame and in the world
are world. Motion of a few decimetres, or the rolling of a boat at its quay, suffices.
No vehicle keeps its distance to within the sensor's noise: the edges and ranges of the body must be the same in the
last third of the recording as in the first. Repeated returns from within arm's reach (legs, an operator) are ego body,
however they move. Points that are connected to the body in a scan (a trailer in a bend) belong to it. While the sensor
stands still none of this is observable, which does no harm: objects that never move are static.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from automos.candidates.ego_body_ranges import Ranges, cells_within, find_constant, find_near, nearest_ranges
from automos.candidates.ego_body_votes import ask_others, decide, parts_of
from automos.candidates.free_space_grid import BeamPattern, directions
from automos.candidates.free_space_image import over_neighbours
from automos.geometry import inverse, se3_log
from automos.scan import Frames, Mask, Points
from automos.settings import EgoBodySettings

_LOOKS = 16
"""Number of scans that vote on whether a possible body is world."""
STEADIEST = 25
"""Percentile of a part's drift that counts: a hinged part is steady beside its hinge, traffic is steady nowhere."""
MAX_SCANS = 40
"""Number of scans evaluated, spread over the recording."""
MIN_SCANS = 9
"""With fewer scans at different poses, no body is detected."""
MIN_STEP, ARM = 0.25, 5.0
"""Metres: least displacement, between evaluated scans, of a point `ARM` from the sensor and fixed to it."""
MIN_UNEVENNESS = 0.15
"""Metres, least RMS deviation from even motion: others do not brake, turn and roll along to centimetres. In even motion
they keep their distance for seconds, so a body must then be nearer than half the distance travelled."""
MIN_OVERLAP = 0.8
"""Least share of a part's cells that must be present in both the first and the last third of the recording."""
MAX_DRIFT = 0.025
"""Metres: greatest change of a part's range from the first third of the recording to the last."""
MIN_CELLS = 4
"""Least number of neighbouring rays that meet a part of the body."""
GOES_ON = 1.4
"""Factor on the farthest range of the body, within which points connected to it belong to it."""
ATTACHED_SHARE = 0.15
"""Least share of a connected part that must lie on the body for the whole part to belong to it."""


def is_on_body(points: Points, is_ground: Mask, reach: Ranges, pattern: BeamPattern) -> Mask:
    """Return (M,) bool: which of `points` (M, 3) of a raw sweep, sensor frame, lie on the body or are connected to it.

    Ground points, `is_ground` (M,) bool, connect nothing.   `reach` (H, W) is that of `find_ego_body`.
    """
    is_body, farthest = np.zeros(len(points), np.bool_), GOES_ON * float(reach.max())
    if farthest == 0.0:
        return is_body
    near = np.flatnonzero(np.einsum("ij,ij->i", points, points) < farthest**2)
    is_body[near] = cells_within(points[near], reach, pattern) >= 0
    near = near[is_body[near] | ~is_ground[near]]
    if is_body.any():
        part, n_parts = parts_of(points[near])
        total, on_body = np.bincount(part, minlength=n_parts), np.bincount(part, is_body[near], n_parts)
        is_body[near] |= (on_body >= ATTACHED_SHARE * total)[part]
    return is_body


def find_ego_body(frames: Frames, pattern: BeamPattern, settings: EgoBodySettings, threads: int = 2) -> Ranges:
    """Return (H, W) the range up to which the body reaches along each ray, metres; 0 where there is no body."""
    nothing = np.zeros((pattern.n_rows, pattern.n_columns), np.float32)
    sample = _scans_apart(frames)
    if len(sample) < MIN_SCANS:
        return nothing
    T, max_range = frames.T_level_sensor[sample], settings.max_range
    if _unevenness(T, frames.stamps[sample]) < MIN_UNEVENNESS:
        max_range = min(max_range, 0.5 * float(np.linalg.norm(np.ptp(T[:, :3, 3], axis=0))))
    if max_range < settings.near_reach:
        return nothing
    with ThreadPoolExecutor(threads) as pool:
        ranges = np.stack(list(pool.map(lambda i: nearest_ranges(frames[i], pattern, max_range), sample)))
    first, _, last = np.array_split(ranges, 3)
    ends, slack = np.stack([find_constant(part, settings) for part in (first, last)], axis=1)
    near = np.stack([find_near(part, settings.near_reach) for part in (first, last)])
    near = np.where((near > 0.0).all(axis=0), near.max(axis=0), np.float32(0.0))
    may_be = np.maximum(ends.max(axis=0), near)
    asked = [frames[sample[i]] for i in np.unique(np.linspace(0, len(sample) - 1, _LOOKS).astype(int))]
    is_body = decide(ask_others(asked, pattern, may_be), pattern, may_be)
    ends[:, ~is_body], near[~is_body] = 0.0, 0.0
    reach = np.maximum(np.where(_stays_put(ends, slack.max(axis=0), pattern, settings), ends.max(axis=0), 0.0), near)
    is_world = (may_be > 0.0) & ~is_body
    # Rays hit and miss an edge alternately, so one cell to each side belongs to the body.
    return np.where(is_world, 0.0, over_neighbours(reach, np.maximum)).astype(np.float32)


def _scans_apart(frames: Frames) -> list[int]:
    """Return up to `MAX_SCANS` indices of `frames`, evenly spread, each after a displacement or a turn."""
    T, sample = frames.T_level_sensor, [0]
    for i in np.unique(np.linspace(0, len(frames) - 1, 2 * MAX_SCANS).astype(int)):
        motion = se3_log(inverse(T[sample[-1]]) @ T[i])
        if np.linalg.norm(motion[:3]) + ARM * np.linalg.norm(motion[3:]) > MIN_STEP:
            sample.append(int(i))
    return [sample[i] for i in np.unique(np.linspace(0, len(sample) - 1, MAX_SCANS).astype(int))]


def _unevenness(T: npt.NDArray[np.float64], stamps: npt.NDArray[np.float64]) -> float:
    """Return the RMS distance (metres) of a point `ARM` from the sensor from where the mean motion would take it.

    The poses `T` are (K, 4, 4), their `stamps` (K,) seconds.
    """
    steps = se3_log(inverse(T[:-1]) @ T[1:])
    mean = steps.sum(axis=0) / (stamps[-1] - stamps[0])
    off = np.cumsum(steps - np.diff(stamps)[:, None] * mean, axis=0)
    off -= off.mean(axis=0)
    return float(np.sqrt((off[:, :3] ** 2 + (ARM * off[:, 3:]) ** 2).sum(axis=1).mean()))


def _stays_put(ends: Ranges, slack: Ranges, pattern: BeamPattern, settings: EgoBodySettings) -> Mask:
    """Return (H, W) bool: connected parts at the same place in both `ends` (2, H, W), which are 0 where there is none.

    The drift of a ray's range is scaled by its tolerance `slack` (H, W), metres.
    """
    is_part = np.logical_or(*(ends > 0.0))
    v, u = np.nonzero(is_part)
    part, n_parts = parts_of(directions(pattern, v, u) * ends[:, v, u].max(axis=0)[:, None])
    # Allow an offset of one cell to each side.
    in_both = np.all([over_neighbours(end, np.maximum) > 0.0 for end in ends], axis=0)[v, u]
    size = np.bincount(part, minlength=n_parts)
    overlap = np.bincount(part, in_both, n_parts) / np.maximum(size, 1)
    drift = np.where((ends[:, v, u] > 0.0).all(axis=0), np.ptp(ends[:, v, u], axis=0), np.nan)
    drift *= settings.tolerance / np.maximum(slack[v, u], settings.tolerance)
    is_body = (overlap >= MIN_OVERLAP) & (size >= MIN_CELLS)
    for k in np.flatnonzero(is_body):
        of_part = drift[(part == k) & np.isfinite(drift)]
        is_body[k] = len(of_part) > 0 and np.percentile(of_part, STEADIEST) <= MAX_DRIFT
    is_part[v, u] = is_body[part]
    return is_part
