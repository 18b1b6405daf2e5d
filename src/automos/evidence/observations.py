"""The observations of each LiDAR in one scan: the ranges of its rays, and its object points in its own frame.

A scan of one LiDAR has one view. Merged clouds have one for each LiDAR that a scan names, with its own origin and
pattern; the ground is that of all points together.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.core.arrays import Items
from automos.core.beam_pattern import Lidar, learn_pattern
from automos.core.directions import last_looks, motion_of, raw_points
from automos.core.range_image import RangeImage, find_neighbours, make_image, project
from automos.core.scan import EGO_BODY, GROUND, OBJECT, SPECK, Frame, Mask, Pose
from automos.evidence.clouds import in_clouds
from automos.evidence.ego_body import find_ego_body
from automos.evidence.ground import map_ground
from automos.evidence.height_map import GroundMap, above_ground
from automos.evidence.on_body import is_on_body
from automos.settings import CandidatesSettings, GroundSettings


@dataclass(frozen=True, eq=False)
class View:
    """The observations of one LiDAR in a scan, in its frame at mid-sweep."""

    rows: npt.NDArray[np.int64] | slice  # (R,) the frame's points that it measured
    is_object: Mask  # (R,) those that may be objects
    objects: npt.NDArray[np.float32]  # (3, K) metres, these object points
    is_supported: Mask  # (K,) object points with neighbours in the same scan above or below, and beside
    image: RangeImage  # of all its points
    T_level_sensor: Pose


@dataclass(frozen=True, eq=False)
class Seen:
    """The observations of a frame of M points, kept while others may use them.

    Attributes
    ----------
    kind : (M,) uint8, OBJECT, GROUND, EGO_BODY or SPECK.   height : (M,) float32, metres above the ground.
    solidity : (M,) uint8, share of the rays beside an object point that ended beside it, 255 for all.
    views : list of View, one for each LiDAR.
    """

    kind: npt.NDArray[np.uint8]
    height: npt.NDArray[np.float32]
    solidity: npt.NDArray[np.uint8]
    views: list[View]

    def moved(self, T_after_before: Pose) -> Seen:
        """Return the same with all poses moved by `T_after_before` (4, 4) in the level frame."""
        views = [replace(view, T_level_sensor=T_after_before @ view.T_level_sensor) for view in self.views]
        return replace(self, views=views)


def learn_lidars(sample: list[Frame]) -> list[Lidar]:
    """Return the LiDARs in the order of their numbers, with the patterns that a few frames show, and no bodies yet."""
    mounts = next((frame.T_scan_sensor for frame in sample if frame.T_scan_sensor is not None), [np.eye(4)])
    return [Lidar(k, T, learn_pattern([frame.of_sensor(k)[1] for frame in sample])) for k, T in enumerate(mounts)]


def with_body(
    lidars: list[Lidar], frames: Items[Frame], T_level_sensor: Pose, settings: CandidatesSettings, threads: int
) -> list[Lidar]:
    """Return `lidars` with the ego body that `frames` at the poses `T_level_sensor` (N, 4, 4) show for each of them."""
    return [replace(lidar, body=find_ego_body(frames, T_level_sensor, lidar, settings, threads)) for lidar in lidars]


def ground_of(frame: Frame, settings: GroundSettings) -> GroundMap:
    """Return the ground that `frame` alone shows."""
    return map_ground(frame.points_level, frame.origin_level, settings)


def look(frame: Frame, lidars: list[Lidar], ground: GroundMap, settings: GroundSettings) -> Seen:
    """Return the observations of `frame` over `ground`."""
    is_ground, height = above_ground(ground, frame.points_level, settings)
    kind = np.where(is_ground, np.uint8(GROUND), np.uint8(OBJECT))
    seen = Seen(kind, height, np.zeros(len(kind), np.uint8), [])
    seen.views.extend(_view(*frame.of_sensor(lidar.number), seen, lidar) for lidar in lidars)
    return seen


def _view(rows: npt.NDArray[np.int64] | slice, part: Frame, seen: Seen, lidar: Lidar) -> View:
    """Return the view of one LiDAR, whose points are `rows` of the frame `seen`, and are in `part`.

    Ego body, specks and solidity of these points are written into `seen`.
    """
    raw, kind = raw_points(part), seen.kind[rows].copy()
    kind[is_on_body(raw, kind == GROUND, lidar)] = EGO_BODY
    sweep_time, is_last = last_looks(raw, part.sweep_time)
    projection = project(raw, lidar.pattern, is_last & (kind != EGO_BODY))
    neighbours, is_on_grid = find_neighbours(projection, kind == OBJECT), projection.cell >= 0
    # Points that are neighbours were observed in the same turn.
    earlier = np.flatnonzero(~is_last)
    if len(earlier):
        of_turn = project(np.take(raw, earlier, axis=0), lidar.pattern, kind[earlier] != EGO_BODY)
        neighbours[:, earlier] = find_neighbours(of_turn, kind[earlier] == OBJECT)
        is_on_grid[earlier] = of_turn.cell >= 0
    n_directions, seen.solidity[rows], is_between = neighbours
    kind[(n_directions == 0) & (kind == OBJECT) & is_on_grid] = SPECK
    is_object = kind == OBJECT
    is_cloud = in_clouds(raw, is_between, is_object & is_on_grid)
    seen.kind[rows] = np.where(is_cloud, np.uint8(SPECK), kind)
    if is_cloud.any():  # a cloud occupies no place, hides nothing, and what is behind it lets none of its rays through
        projection = project(raw, lidar.pattern, is_last & (kind != EGO_BODY) & ~is_cloud)
        solidity = find_neighbours(projection, is_object & ~is_cloud)[1]
        seen.solidity[rows] = np.where(projection.cell >= 0, solidity, seen.solidity[rows])
    image = make_image(projection, lidar.pattern._replace(sweep_time=sweep_time), motion_of(part), is_object)
    objects = np.ascontiguousarray(np.take(part.points, np.flatnonzero(is_object), axis=0).T)
    return View(rows, is_object, objects, n_directions[is_object] == 2, image, part.T_level_sensor)
