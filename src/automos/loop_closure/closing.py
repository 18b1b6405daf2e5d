"""Loop closure: places seen again are recognised, verified by registration, and the drift between is spread.

Off by default: closing a loop moves poses that fitted what was seen around them. So the correction is spread evenly
along the path, and poses of neighbouring scans keep fitting to within the drift of the odometry itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse, make_transform, se3_exp, se3_log, transform
from automos.loop_closure.places import compare_places, describe_place
from automos.loop_closure.pose_graph import Edges, solve_pose_graph
from automos.odometry import Trajectory
from automos.scan import Frames, Points, Pose
from automos.settings import LoopSettings
from automos.voxels import rows_of_first_in_voxel

Array = npt.NDArray[np.float64]

PLACE_EVERY = 5.0
"""Metres driven between places."""
PLACE_LENGTH, PLACE_SCANS = 10.0, 5
"""Metres driven whose scans show a place, and how many of them: what a few beams miss, the next scans see."""
RINGS, SECTORS = 20, 60
"""In which a place is described (Scan Context's own)."""
VOXEL = 0.5
"""Metres, one point per voxel; what is nearer lies on each other."""
MAX_TURN_DRIFT_DEG = 0.3
"""Degrees per metre driven, by which poses may be turned."""
MAX_OFFSET = 8.0
"""Metres between places that show the same: two lanes and more."""
MAX_DIFFERENCE = 0.4
"""Between places that look alike, 0 to 1; registration then decides."""
CANDIDATES = 3
"""Places tried for each, most alike first."""
REGISTRATION_DISTANCES = (8.0, 3.0, 1.0)
"""Metres, one registration each: pairs further apart are left out."""
MIN_POINTS = 100
"""That stand on the ground, on which an overlap is judged."""
DRIFT, TURN_DRIFT_DEG = 0.05, 0.1
"""Metres and degrees over 10 m, usual drift of the odometry."""
DEVIATION, TURN_DEVIATION_DEG = 0.03, 0.05
"""Metres and degrees, usual error of a revisit's registration."""


def close_loops(frames: Frames, trajectory: Trajectory, loops: LoopSettings) -> Trajectory:
    """Return the trajectory with the drift taken out that revisits show; `diagnostics` counts these.

    Memory holds one description per place and the clouds of two places, however long the recording is.
    """
    T_world_sensor, T_level_world = trajectory.T_world_sensor, trajectory.T_level_world
    path = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(T_world_sensor[:, :3, 3], axis=0), axis=1))])
    middles = np.searchsorted(path, np.arange(0.0, path[-1] + 1e-9, PLACE_EVERY))
    middles = np.unique(np.minimum(middles, len(path) - 1))
    T_level_place = np.array([_upright(T) for T in trajectory.T_level_sensor[middles]])

    def see(place: int) -> Points:
        ids = np.flatnonzero(np.abs(path - path[middles[place]]) <= 0.5 * PLACE_LENGTH)
        ids = ids[np.unique(np.linspace(0, len(ids) - 1, PLACE_SCANS).round().astype(int))]
        clouds = []
        for i in ids:
            cloud = transform(inverse(T_level_place[place]), frames[int(i)].points_level)
            cloud = cloud[np.einsum("ij,ij->i", cloud, cloud) < loops.reach**2]
            clouds.append(cloud[rows_of_first_in_voxel(cloud, VOXEL)])
        cloud = np.concatenate(clouds)
        return cloud[rows_of_first_in_voxel(cloud, VOXEL)]

    found: list[_Revisit] = []
    looks = [describe_place(see(k), loops.reach, RINGS, SECTORS) for k in range(len(middles))]
    for second in range(len(middles)):
        for first, turn in _look_alike(second, looks, T_level_place[:, :3, 3], path[middles], loops):
            T_first_second = _verify(see(first), see(second), turn, loops)
            if T_first_second is not None:
                found.append(_Revisit(first, second, T_first_second))
    T_closed, is_kept = _solve(T_level_place, path[middles], found, loops)
    poses = T_world_sensor
    if is_kept.any():
        correction = se3_log(inverse(T_level_place) @ T_closed)  # of each place, in its own frame
        poses = _spread(T_world_sensor, T_level_world, T_level_place, correction, path, path[middles])
    diagnostics = {**trajectory.diagnostics, "loops_closed": int(is_kept.sum())}
    return replace(trajectory, T_world_sensor=poses, diagnostics=diagnostics)


@dataclass(frozen=True)
class _Revisit:
    first: int
    second: int
    T_first_second: Pose


def _upright(T: Pose) -> Pose:
    """Return the frame at the place of `T`, z up, with its heading."""
    c, s = T[0, 0], T[1, 0]
    norm = max(float(np.hypot(c, s)), 1e-9)
    return make_transform(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, norm]]) / norm, T[:3, 3])


def _look_alike(
    second: int, looks: list[Array], position: Array, path: Array, loops: LoopSettings
) -> list[tuple[int, float]]:
    """Return earlier places that look like place `second`, most alike first, and the turn (rad) from each to it."""
    driven = path[second] - path
    apart = np.linalg.norm(position - position[second], axis=1)
    is_possible = (driven >= loops.min_distance) & (apart < loops.max_drift * driven + MAX_OFFSET)
    alike = []
    for first in np.flatnonzero(is_possible):
        difference, turn = compare_places(looks[first], looks[second])
        if difference < MAX_DIFFERENCE:
            alike.append((difference, int(first), turn))
    return [(first, turn) for _, first, turn in sorted(alike)[:CANDIDATES]]


def _verify(first: Points, second: Points, turn: float, loops: LoopSettings) -> Pose | None:
    """Return T_first_second that lays the clouds on each other, or None where they do not lie well."""
    import small_gicp

    c, s = np.cos(turn), np.sin(turn)
    T = make_transform([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    target, tree = small_gicp.preprocess_points(first.astype(np.float64), downsampling_resolution=VOXEL)
    source, _ = small_gicp.preprocess_points(second.astype(np.float64), downsampling_resolution=VOXEL)
    for distance in REGISTRATION_DISTANCES:
        T = small_gicp.align(
            target, source, tree, T, registration_type="GICP", max_correspondence_distance=distance, max_iterations=30
        ).T_target_source
    forth = _share_close(first, transform(T, second), loops)
    back = _share_close(second, transform(inverse(T), first), loops)
    return T if min(forth, back) > loops.min_overlap else None


def _share_close(cloud: Points, points: Points, loops: LoopSettings) -> float:
    """Return the share of `points` above the ground, and well inside the reach of `cloud`, that lie near it."""
    from scipy.spatial import KDTree

    ground = np.percentile(cloud[:, 2], 5.0)
    is_inside = np.einsum("ij,ij->i", points, points) < (0.7 * loops.reach) ** 2
    asked = points[is_inside & (points[:, 2] > ground + VOXEL)]
    if len(asked) < MIN_POINTS:
        return 0.0
    distance, _ = KDTree(cloud, balanced_tree=False, compact_nodes=False).query(asked, distance_upper_bound=VOXEL)
    return float(np.isfinite(distance).mean())


def _solve(
    T_level_place: Pose, path: Array, found: list[_Revisit], loops: LoopSettings
) -> tuple[Pose, npt.NDArray[np.bool_]]:
    """Return the places' poses with the revisits taken into account, and which of these were believed.

    Wrong revisits that agree with each other could outvote the path driven. So none may bend it more than drift would:
    until that is so, the one that asks for most is given up.
    """
    first = np.arange(len(T_level_place) - 1)
    steps = inverse(T_level_place[:-1]) @ T_level_place[1:]
    length = np.diff(path)
    usual = np.repeat([DRIFT, np.radians(TURN_DRIFT_DEG)], 3)
    chain = Edges(first, first + 1, steps, usual * np.sqrt(length[:, None] / 10.0))
    is_left = np.ones(len(found), bool)
    asked = [np.linalg.norm(_disagreement(T_level_place, r)[:3]) / (path[r.second] - path[r.first]) for r in found]
    while is_left.any():
        left = np.flatnonzero(is_left)
        links = Edges(
            np.array([found[k].first for k in left]),
            np.array([found[k].second for k in left]),
            np.array([found[k].T_first_second for k in left]),
            np.tile(np.repeat([DEVIATION, np.radians(TURN_DEVIATION_DEG)], 3), (len(left), 1)),
        )
        T, is_kept = solve_pose_graph(T_level_place, chain, links)
        bend = se3_log(inverse(steps) @ inverse(T[:-1]) @ T[1:])
        is_even = np.linalg.norm(bend[:, :3], axis=1) <= loops.max_drift * length
        is_straight = np.linalg.norm(bend[:, 3:], axis=1) <= np.radians(MAX_TURN_DRIFT_DEG) * length
        if is_even.all() and is_straight.all():
            is_left[left] = is_kept
            return T, is_left
        is_left[left[int(np.argmax(np.array(asked)[left]))]] = False
    return T_level_place, is_left


def _disagreement(T: Pose, revisit: _Revisit) -> Array:
    """Return the (6,) motion by which poses `T` differ from what a revisit measured."""
    return se3_log(inverse(revisit.T_first_second) @ inverse(T[revisit.first]) @ T[revisit.second])


def _spread(
    T_world_sensor: Pose, T_level_world: Pose, T_level_place: Pose, correction: Array, path: Array, place_path: Array
) -> Pose:
    """Return the poses moved by the corrections of the places before and after, in proportion to the path."""
    after = np.clip(np.searchsorted(place_path, path, side="right"), 1, len(place_path) - 1)
    before = after - 1
    share = np.clip((path - place_path[before]) / np.maximum(place_path[after] - place_path[before], 1e-9), 0.0, None)
    T_level_sensor = T_level_world @ T_world_sensor
    moved = []
    for place in (before, after):
        here = T_level_place[place]
        moved.append(here @ se3_exp(correction[place]) @ inverse(here) @ T_level_sensor)
    T = moved[0] @ se3_exp(np.minimum(share, 1.0)[:, None] * se3_log(inverse(moved[0]) @ moved[1]))
    T = inverse(T_level_world) @ T
    return inverse(T[0]) @ T
