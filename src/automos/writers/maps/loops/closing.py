"""Loop closure: revisited places are recognised, verified by registration, and the drift between them is distributed.

For maps alone: closing a loop bends poses that were consistent with their surroundings, by which labels are found. So
the correction is distributed evenly along the path, and neighbouring poses stay consistent within the drift of the
odometry itself.
"""

from __future__ import annotations

import numpy as np

from automos.core.arrays import some_of
from automos.core.geometry import Array, inverse, se3_exp, se3_log, transform, upright_pose
from automos.core.scan import Frames, Mask, Points, Pose
from automos.core.voxel_map import rows_of_first_in_voxel
from automos.odometry.motion import MIN_POINTS
from automos.settings import LoopSettings
from automos.writers.maps.loops.places import GROUND, compare_places, describe_place, ground_of
from automos.writers.maps.loops.pose_graph import Edges, solve_pose_graph

PLACE_EVERY, PLACE_SCANS = 5.0, 5
"""Metres travelled from a place to the next, and scans along the path between its neighbours, which describe it: later
scans fill the gaps between beams."""
RINGS, SECTORS = 20, 60
"""Of a place's description (as in Scan Context)."""
VOXEL = 0.5
"""Metres, one point per voxel; also the greatest distance between overlapping points."""
MAX_TURN_DRIFT_DEG = 0.3
"""Degrees per metre travelled by which poses may be rotated."""
MAX_OFFSET = 8.0
"""Metres between poses at the same place, beyond drift: two lanes and more."""
MAX_DIFFERENCE = 0.4
"""Between descriptions of similar places, 0 to 1; registration then decides."""
CANDIDATES = 3
"""Places tried for each, most similar first."""
REGISTRATION_DISTANCES = (MAX_OFFSET, 3.0, 1.0)
"""Metres, one registration each: correspondences further apart are rejected."""
DRIFT, TURN_DRIFT_DEG = 0.05, 0.1
"""Metres and degrees over 10 m, usual drift of the odometry."""
DEVIATION, TURN_DEVIATION_DEG = 0.03, 0.05
"""Metres and degrees, usual registration error of a revisit."""


def close_loops(frames: Frames, loops: LoopSettings) -> tuple[Pose, int]:
    """Return (N, 4, 4) T_level_sensor without the drift that revisits reveal, and the number of closed loops.

    Memory holds one description per place and the clouds of two places, whatever the length of the recording.
    """
    T_level_sensor = frames.T_level_sensor
    path = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(T_level_sensor[:, :3, 3], axis=0), axis=1))])
    middles = np.searchsorted(path, np.arange(0.0, path[-1] + 1e-9, PLACE_EVERY))
    middles = np.unique(np.minimum(middles, len(path) - 1))
    T_level_place = np.array([_upright(T) for T in T_level_sensor[middles]])

    def cloud_at(place: int) -> Points:
        ids = np.flatnonzero(np.abs(path - path[middles[place]]) <= PLACE_EVERY)
        ids = ids[some_of(len(ids), PLACE_SCANS)]
        clouds = []
        for i in ids:
            cloud = transform(inverse(T_level_place[place]), frames[int(i)].points_level)
            cloud = cloud[np.einsum("ij,ij->i", cloud, cloud) < loops.reach**2]
            clouds.append(cloud[rows_of_first_in_voxel(cloud, VOXEL)])
        cloud = np.concatenate(clouds)
        return cloud[rows_of_first_in_voxel(cloud, VOXEL)]

    found: list[tuple[int, int, Pose]] = []
    descriptions = [describe_place(cloud_at(k), loops.reach, RINGS, SECTORS) for k in range(len(middles))]
    for second in range(len(middles)):
        for first, turn in _find_similar(second, descriptions, T_level_place[:, :3, 3], path[middles], loops):
            T_first_second = _verify(cloud_at(first), cloud_at(second), turn, loops)
            if T_first_second is not None:
                found.append((first, second, T_first_second))
    if not found:
        return T_level_sensor, 0
    usual = np.tile(np.repeat([DEVIATION, np.radians(TURN_DEVIATION_DEG)], 3), (len(found), 1))
    first_of, second_of, T = map(np.array, zip(*found, strict=True))
    revisits = Edges(first_of, second_of, T, usual)
    T_closed, is_kept = _solve(T_level_place, path[middles], revisits, loops)
    if is_kept.any():
        correction = se3_log(inverse(T_level_place) @ T_closed)  # of each place, in its own frame
        T_level_sensor = _spread(T_level_sensor, T_level_place, correction, path, path[middles])
    return T_level_sensor, int(is_kept.sum())


def _upright(T: Pose) -> Pose:
    """Return the frame at the position of `T`, z up, with the heading of `T`."""
    return upright_pose(T[:2, 0] / max(float(np.hypot(*T[:2, 0])), 1e-9), T[:3, 3])


def _find_similar(
    second: int, descriptions: list[Array], position: Array, path: Array, loops: LoopSettings
) -> list[tuple[int, float]]:
    """Return earlier places similar to place `second`, most similar first, and the rotation (rad) from each to it."""
    driven = path[second] - path
    apart = np.linalg.norm(position - position[second], axis=1)
    is_possible = (driven >= loops.min_distance) & (apart < loops.max_drift * driven + MAX_OFFSET)
    similar_places = []
    for first in np.flatnonzero(is_possible):
        difference, turn = compare_places(descriptions[first], descriptions[second])
        if difference < MAX_DIFFERENCE:
            similar_places.append((difference, int(first), turn))
    return [(first, turn) for _, first, turn in sorted(similar_places)[:CANDIDATES]]


def _verify(first: Points, second: Points, turn: float, loops: LoopSettings) -> Pose | None:
    """Return T_first_second that aligns the clouds, or None if they overlap too little."""
    import small_gicp

    T = upright_pose((np.cos(turn), np.sin(turn)), np.zeros(3))
    target, tree = small_gicp.preprocess_points(first.astype(np.float64), downsampling_resolution=VOXEL)
    source, _ = small_gicp.preprocess_points(second.astype(np.float64), downsampling_resolution=VOXEL)
    for distance in REGISTRATION_DISTANCES:
        T = small_gicp.align(
            target, source, tree, T, registration_type="GICP", max_correspondence_distance=distance
        ).T_target_source
    forth = _share_close(first, transform(T, second), loops)
    back = _share_close(second, transform(inverse(T), first), loops)
    return T if min(forth, back) > loops.min_overlap else None


def _share_close(cloud: Points, points: Points, loops: LoopSettings) -> float:
    """Return the share of `points` close to `cloud`, of those above the ground and well within its reach."""
    from scipy.spatial import KDTree

    is_inside = np.einsum("ij,ij->i", points, points) < (0.7 * loops.reach) ** 2
    checked = points[is_inside & (points[:, 2] > ground_of(cloud[:, 2]) + GROUND)]
    if len(checked) < MIN_POINTS:
        return 0.0
    distance, _ = KDTree(cloud, balanced_tree=False, compact_nodes=False).query(checked, distance_upper_bound=VOXEL)
    return float(np.isfinite(distance).mean())


def _solve(T_level_place: Pose, path: Array, revisits: Edges, loops: LoopSettings) -> tuple[Pose, Mask]:
    """Return the places' poses corrected by the revisits, and which of these were accepted.

    Wrong revisits that agree with each other could outvote the odometry. So none may bend the path more than drift
    would: until that holds, the revisit with the greatest correction is rejected.
    """
    first = np.arange(len(T_level_place) - 1)
    steps = inverse(T_level_place[:-1]) @ T_level_place[1:]
    length = np.diff(path)
    usual = np.repeat([DRIFT, np.radians(TURN_DRIFT_DEG)], 3)
    chain = Edges(first, first + 1, steps, usual * np.sqrt(length[:, None] / 10.0))
    is_left = np.ones(len(revisits), bool)
    apart = np.linalg.norm(revisits.residuals(T_level_place)[:, :3], axis=1)
    bends = apart / (path[revisits.second] - path[revisits.first])
    while is_left.any():
        left = np.flatnonzero(is_left)
        T, is_kept = solve_pose_graph(T_level_place, chain, revisits[left])
        bend = se3_log(inverse(steps) @ inverse(T[:-1]) @ T[1:])
        is_even = np.linalg.norm(bend[:, :3], axis=1) <= loops.max_drift * length
        is_straight = np.linalg.norm(bend[:, 3:], axis=1) <= np.radians(MAX_TURN_DRIFT_DEG) * length
        if is_even.all() and is_straight.all():
            is_left[left] = is_kept
            return T, is_left
        is_left[left[int(np.argmax(bends[left]))]] = False
    return T_level_place, is_left


def _spread(T_level_sensor: Pose, T_level_place: Pose, correction: Array, path: Array, place_path: Array) -> Pose:
    """Return the poses corrected by interpolation between the previous and the next place, along the path.

    The first one stays where it is.
    """
    after = np.clip(np.searchsorted(place_path, path, side="right"), 1, len(place_path) - 1)
    before = after - 1
    share = np.clip((path - place_path[before]) / np.maximum(place_path[after] - place_path[before], 1e-9), 0.0, None)
    moved = []
    for place in (before, after):
        here = T_level_place[place]
        moved.append(here @ se3_exp(correction[place]) @ inverse(here) @ T_level_sensor)
    T = moved[0] @ se3_exp(np.minimum(share, 1.0)[:, None] * se3_log(inverse(moved[0]) @ moved[1]))
    return T_level_sensor[0] @ inverse(T[0]) @ T
