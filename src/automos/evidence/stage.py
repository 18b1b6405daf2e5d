"""III-B: the evidence of motion of each point of a scan, and its kind."""

from itertools import islice

import numpy as np
import numpy.typing as npt

from automos.core.arrays import evenly_spread
from automos.core.beam_pattern import learn_pattern, ray_steps
from automos.core.parallel import available_cores
from automos.core.scan import EGO_BODY, GROUND, OBJECT, Frames
from automos.core.stages import Arrays, PerScan
from automos.evidence.free_space import PATTERN_SCANS, FreeSpace
from automos.evidence.ground import find_ground
from automos.evidence.published import handed_in
from automos.settings import Settings

_CERTAIN = 4.0
"""Log-odds of the points of a method that only decides between moving and static."""
_EGO_RADIUS = 2.7
"""Metres around the sensor within which such methods take everything for the ego body, as ERASOR's authors do."""


def find_candidates(
    frames: Frames, stamps: npt.NDArray, settings: Settings, workers: int, missing: list[int]
) -> PerScan:
    """Yield for each missing scan the evidence of motion of its points, and their kind."""
    find = _free_space if settings.candidates.method == "free_space" else _moving_points
    return find(frames, stamps, settings, workers, range(missing[0], missing[-1] + 1))


def candidates_of(
    log_odds: npt.NDArray, kind: npt.NDArray, height: npt.NDArray, solidity: npt.NDArray, ray_steps: npt.NDArray
) -> Arrays:
    """Return the results on a scan's points (M,) as they are stored."""
    half = np.float16
    per_point = {"log_odds": log_odds.astype(half), "kind": kind, "height": height.astype(half), "solidity": solidity}
    return {**per_point, "ray_steps": ray_steps}


def _free_space(frames: Frames, stamps: npt.NDArray, settings: Settings, workers: int, scans: range) -> PerScan:
    space = FreeSpace(frames, stamps, settings.candidates, workers or available_cores())
    for i, seen, net in space.collect(scans.start, scans.stop):
        yield i, candidates_of(net, seen.kind, seen.height, seen.solidity, ray_steps(space.lidars))


def _moving_points(frames: Frames, stamps: npt.NDArray, settings: Settings, workers: int, scans: range) -> PerScan:
    """Yield the moving points of a published method."""
    pattern = learn_pattern(evenly_spread(frames, PATTERN_SCANS))
    steps = np.array([pattern.row_height, pattern.column_width])
    found = handed_in(settings.candidates.method).find_moving(frames, stamps, settings, scans.start)
    for i, is_moving in islice(found, len(scans)):
        frame = frames[i]
        is_ground, height = find_ground(frame.points_level, frame.origin_level, settings.candidates.ground)
        kind = np.where(is_ground, GROUND, OBJECT).astype(np.uint8)
        kind[np.hypot(frame.points[:, 0], frame.points[:, 1]) < _EGO_RADIUS] = EGO_BODY
        solidity = np.full(len(kind), 255, np.uint8)
        yield i, candidates_of(np.where(is_moving, _CERTAIN, -_CERTAIN), kind, height, solidity, steps)
