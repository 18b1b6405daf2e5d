"""What each LiDAR saw in one scan: its range image, and the points that may be objects, as seen from where it sits.

A scan of one LiDAR has one view. Merged clouds have one for each LiDAR that a scan names, with rays that start there
and a pattern of their own; the ground is that of all points together.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.candidates.ego_body import EgoBody, find_ego_body, nobody
from automos.candidates.free_space_image import (
    PyramidShape,
    RangeImage,
    find_neighbours,
    make_image,
    project,
    pyramid_shape,
)
from automos.candidates.free_space_pattern import BeamPattern, learn_pattern, raw_points, seen_in
from automos.candidates.ground import fit_ground, is_on_ground
from automos.scan import EGO_BODY, GROUND, OBJECT, SPECK, Frame, Frames, Mask, Pose
from automos.settings import EgoBodySettings, GroundSettings


@dataclass(frozen=True, eq=False)
class Lidar:
    """What is learnt of one LiDAR: where it sits in a scan's frame, how its rays lie, what of the vehicle they meet."""

    T_scan_sensor: Pose
    pattern: BeamPattern
    pyramid: PyramidShape
    body: EgoBody


@dataclass(frozen=True, eq=False)
class View:
    """What one LiDAR saw in a scan.

    Attributes
    ----------
    rows : which of the frame's points it measured.   is_object : (R,) which of these may be objects.
    objects : (3, K) float32, metres, these points in the LiDAR's frame at mid-sweep.
    is_supported : (K,) which of these other rays of the scan have met as well, above or below and beside.
    image : of all its points.   motion : (6,) float32, twist of the LiDAR over the sweep, zeros where unknown.
    pattern : the LiDAR's, with the times of this scan.   pyramid : how the image's coarser levels lie.
    """

    rows: npt.NDArray[np.int64] | slice
    is_object: Mask
    objects: npt.NDArray[np.float32]
    is_supported: Mask
    image: RangeImage
    motion: npt.NDArray[np.float32]
    pattern: BeamPattern
    pyramid: PyramidShape
    T_level_sensor: Pose


@dataclass(frozen=True, eq=False)
class Seen:
    """What is kept of a frame of M points while others may ask about it.

    Attributes
    ----------
    kind : (M,) uint8.   height : (M,) metres above the ground.
    solidity : (M,) uint8, share of the rays beside an object that ended beside it, 255 for all.
    """

    kind: npt.NDArray[np.uint8]
    height: npt.NDArray[np.float32]
    solidity: npt.NDArray[np.uint8]
    views: list[View]

    def moved(self, T_after_before: Pose) -> Seen:
        """Return the same, seen from elsewhere: all poses moved by (4, 4) in the level frame."""
        views = [replace(view, T_level_sensor=T_after_before @ view.T_level_sensor) for view in self.views]
        return replace(self, views=views)


class FramesOfLidar:
    """The frames of one of several LiDARs, each made when asked for."""

    def __init__(self, frames: Frames, lidar: int, T_level_sensor: Pose):
        """Take all frames, which LiDAR, and the poses (N, 4, 4) of that one."""
        self._frames, self._lidar, self.T_level_sensor = frames, lidar, T_level_sensor

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        """(N,) seconds."""
        return self._frames.stamps

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: int) -> Frame:
        return self._frames[index].of_sensor(self._lidar)[1]


def learn_lidars(frames: Frames, sample: list[Frame], ego_body: EgoBodySettings, threads: int) -> list[Lidar]:
    """Return what `sample`, a few of `frames`, tells of each LiDAR, in the order of their numbers."""
    lidars, mounts = [], next((frame.T_scan_sensor for frame in sample if frame.T_scan_sensor is not None), None)
    for k, T_scan_sensor in enumerate([np.eye(4)] if mounts is None else mounts):
        pattern = learn_pattern([frame.of_sensor(k)[1] for frame in sample])
        lidars.append(Lidar(T_scan_sensor, pattern, pyramid_shape(pattern), nobody(pattern)))
    return with_body(lidars, frames, ego_body, threads)


def with_body(lidars: list[Lidar], frames: Frames, ego_body: EgoBodySettings, threads: int) -> list[Lidar]:
    """Return `lidars` with what `frames` show each of them to meet of its own vehicle."""
    found = []
    for k, lidar in enumerate(lidars):
        own = FramesOfLidar(frames, k, frames.T_level_sensor @ lidar.T_scan_sensor)
        found.append(replace(lidar, body=find_ego_body(own, lidar.pattern, ego_body, threads)))
    return found


def ray_steps(lidars: list[Lidar]) -> npt.NDArray[np.float64]:
    """Return (2,) radians between neighbouring rows and columns of rays, of the sparsest of `lidars`."""
    return np.max([(lidar.pattern.row_height, lidar.pattern.column_width) for lidar in lidars], axis=0)


def look(frame: Frame, lidars: list[Lidar], ground: GroundSettings) -> Seen:
    """Return what `frame` saw."""
    points = frame.points_level
    surface = fit_ground(points, frame.origin_level, ground)
    is_ground = is_on_ground(points, frame.origin_level, surface, ground)
    kind = np.where(is_ground, np.uint8(GROUND), np.uint8(OBJECT))
    height = points[:, 2] - surface.height_at(points)
    solidity = np.zeros(len(points), np.uint8)
    views = [_view(*frame.of_sensor(k), kind, solidity, lidar) for k, lidar in enumerate(lidars)]
    return Seen(kind, height, solidity, views)


def _view(
    rows: npt.NDArray[np.int64] | slice,
    part: Frame,
    kind: npt.NDArray[np.uint8],
    solidity: npt.NDArray[np.uint8],
    lidar: Lidar,
) -> View:
    """Return what one LiDAR saw: the points `rows` of a frame of M.

    The body and the specks that it finds are written into `kind` (M,), how solid things are into `solidity` (M,).
    """
    raw = raw_points(part)
    of_here = np.where(lidar.body.covers(raw, kind[rows] == GROUND), np.uint8(EGO_BODY), kind[rows])
    pattern, is_last = seen_in(part, raw, lidar.pattern)
    projection = project(raw, is_last & (of_here != EGO_BODY), pattern)
    ways, solidity[rows] = find_neighbours(projection, of_here)
    of_here[(ways == 0) & (of_here == OBJECT) & (projection.cell >= 0)] = SPECK
    kind[rows] = of_here
    image = make_image(projection, of_here, lidar.pyramid)
    knows_motion = part.sweep_motion is not None and part.sweep_time is not None
    motion = np.asarray(part.sweep_motion if knows_motion else np.zeros(6), np.float32)
    is_object = of_here == OBJECT
    objects = np.take(part.points, np.flatnonzero(is_object), axis=0)
    return View(
        rows, is_object, np.ascontiguousarray(objects.T), ways[is_object] == 2, image, motion, pattern,
        lidar.pyramid, part.T_level_sensor,
    )  # fmt: skip
