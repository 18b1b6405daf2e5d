"""Clouds in the frame of a map or of a drive's beginning: whether they are, and where the sensor was.

A name alone does not tell: some drivers call the sensor's own frame `map`. From where a sweep was measured nothing in
it is hidden behind anything else, so of the places that a sensor may have been at, the one from which least is hidden
is believed.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import inverse, transform
from automos.core.scan import MIN_RANGE, Points, Pose

_NAMES = r"(^|[_/])(map|odom|world|global|earth|init|local_origin|enu|utm|gravity)(\d*$|[_/])"
_LOOKED_AT = 5
"""Scans that are compared."""
_CELL, _BEHIND = 1.0, 0.2
"""Degrees of a direction, and times the nearest range in it that a point lies behind that one if it is hidden."""
_MOST = 0.5
"""Share of a cloud that is hidden from the sensor, at most: recordings have 0.3, and 0.6 to 1 from 100 m away."""
_NEAR, _FAR = 2.0, 6.0
"""Metres from the sensor, and from the middle of a cloud, of places from which more must be hidden."""
_CLEARLY = 0.9
"""Times the share hidden from elsewhere: where less is hidden, the sensor was there whatever it is called."""


def is_named_world(frame: str) -> bool:
    """Return whether a frame has one of the names that frames have which a sensor moves in."""
    return re.search(_NAMES, frame.lower()) is not None


def is_elsewhere(points: Points) -> bool:
    """Return whether points (N, 3), metres, were measured from far off the origin of their frame, whatever its name."""
    return share_hidden(points, np.zeros(3)) > _MOST


def find_sensor(
    clouds: Callable[[int], Points], frame: str, poses: dict[str, Pose], n: int, where: Path
) -> Pose | None:
    """Return (n, 4, 4) T_frame_sensor of clouds in a `frame` that may not be the sensor's; None where it is.

    Parameters
    ----------
    clouds : returns the (N, 3) points of scan `i`, metres, in the frame.
    poses : (n, 4, 4) that were recorded, of what may be the sensor, by the name of who tells them.

    Raises
    ------
    InputError
        The clouds are not in the sensor's frame, and no poses say where it was; `where` names them.
    """
    as_is = np.tile(np.eye(4), (n, 1, 1))
    told = list(poses.values())
    farthest = max((np.linalg.norm(T[:, :3, 3], axis=1) for T in told), key=np.max, default=np.arange(n))
    looked_at = np.unique(np.argsort(farthest)[np.linspace(n // 2, n - 1, _LOOKED_AT).astype(int)])
    seen = {int(i): clouds(int(i)) for i in looked_at}

    def hidden(T: Pose) -> float:
        return float(np.mean([share_hidden(points, T[i, :3, 3]) for i, points in seen.items()]))

    if told:
        best = min(told, key=hidden)
        return None if hidden(as_is) < _CLEARLY * hidden(best) else best
    if all(_is_measured_here(points) for points in seen.values()):
        return None
    raise InputError(
        f"{where} holds clouds in a world frame ({frame!r}), not in the sensor's, and no odometry or /tf in the bag "
        "says where the sensor was; record the sensor's own topic, or the odometry, too"
    )


def moved_to_sensor(points: Points, T_frame_sensor: Pose) -> Points:
    """Return (N, 3) points of a frame in that of the sensor at (4, 4)."""
    return transform(inverse(T_frame_sensor), points)


def share_hidden(points: Points, origin: npt.ArrayLike) -> float:
    """Return which share of points (N, 3) lies behind another one, seen from `origin` (3,); 0 of none.

    From far away, a cloud lies in few directions, and as near as its nearest point is no measure for its depth.
    """
    points = np.asarray(points, np.float64)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return 0.0
    size = np.median(np.linalg.norm(points - np.median(points, axis=0), axis=1))
    rays = points - np.asarray(origin, np.float64)
    ranges = np.linalg.norm(rays, axis=1)
    rays, ranges = rays[ranges > MIN_RANGE], ranges[ranges > MIN_RANGE]
    azimuth = np.degrees(np.arctan2(rays[:, 1], rays[:, 0])) // _CELL
    elevation = np.degrees(np.arcsin(rays[:, 2] / ranges)) // _CELL
    _, cell = np.unique(azimuth * 360.0 + elevation, return_inverse=True)
    nearest = np.full(len(ranges), np.inf)
    np.minimum.at(nearest, cell, ranges)
    nearest = nearest[cell]
    return float((ranges > nearest + _BEHIND * np.minimum(nearest, size)).mean()) if len(ranges) else 0.0


def _is_measured_here(points: Points) -> bool:
    """Return whether less of a cloud is hidden from its frame's origin than from beside it, and from its middle."""
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return True
    around = np.array([[x, y, 0.0] for x in (-1, 0, 1) for y in (-1, 0, 1)])
    middle = np.append(np.median(points[:, :2], axis=0), 0.0)
    others = [*(_NEAR * around[around.any(axis=1)]), *(middle + _FAR * around)]
    others = [place for place in others if np.linalg.norm(place) > 0.5 * _NEAR]
    return _CLEARLY * share_hidden(points, np.zeros(3)) <= min(share_hidden(points, place) for place in others)
