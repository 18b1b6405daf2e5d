"""Online rivals of LMNet that need no foreign weights (IV-C): what may move moves, and what flows moves.

Rivals that do need them are scored by their prediction folders, `automos reproduce table2 --predictions NAME=FOLDER`.
"""

import numpy as np
import numpy.typing as npt

from automos.core.geometry import inverse, transform
from automos.core.labels import Label
from automos.core.scan import Sequence
from automos.odometry.trajectory import Trajectory, make_frame

_MAX_RANGE = 50.0
"""Metres; points further away count as static."""
_MIN_HEIGHT = 0.3
"""Metres above the ground under the first scan; lower points are static."""
_NEIGHBOURS = 16
"""Points whose median flow a point takes."""
_MIN_SPEED, _MAX_SPEED = 1.4, 44.0
"""m/s: from the first on a point moves (SeFlow's 0.14 m a scan), faster than the second is a point that appeared."""

Labels = npt.NDArray[np.uint8]


def movable_labels(truth: npt.NDArray[np.uint32]) -> Labels:
    """Return (N,) labels that call everything movable moving, from a scan's true classes and instances.

    Semantics are taken as perfect: vehicles and people of SemanticKITTI (10 to 33 and 251 to 259), and every point that
    belongs to an instance where the truth names no classes but 9 and 251.
    """
    semantic, instance = truth & 0xFFFF, truth >> 16
    is_movable = ((semantic >= 10) & (semantic <= 33)) | ((semantic >= 251) & (semantic <= 259)) | (instance > 0)
    return np.where(is_movable, Label.MOVING, Label.STATIC).astype(np.uint8)


def flow_labels(sequence: Sequence, trajectory: Trajectory, index: int) -> Labels:
    """Return (N,) labels of scan `index`, from it and the one before: what flows faster than a threshold moves.

    The flow is the way to the nearest point of the scan before. The sensor's own motion is taken out first, and a
    point's flow is the median over its neighbours, since a surface slides along itself without a trace.
    """
    from scipy.spatial import KDTree

    stamps = trajectory.stamps
    frame = make_frame(sequence[index], trajectory, index)
    moving = np.zeros(len(frame.points), np.bool_)
    near = np.linalg.norm(frame.points, axis=1) < _MAX_RANGE
    height = frame.points_level[:, 2]
    rows = np.flatnonzero(near & (height > _MIN_HEIGHT))
    if index > 0 and len(rows):
        before = make_frame(sequence[index - 1], trajectory, index - 1)
        T_now_before = inverse(frame.T_level_sensor) @ before.T_level_sensor
        earlier = transform(T_now_before, before.points)
        points = frame.points[rows]
        _, nearest = KDTree(earlier, balanced_tree=False).query(points, workers=1)
        flow = points - earlier[nearest]
        _, around = KDTree(points, balanced_tree=False).query(points, k=min(_NEIGHBOURS, len(points)), workers=1)
        smooth = np.median(flow[around.reshape(len(points), -1)], axis=1)
        speed = np.linalg.norm(smooth, axis=1) / (stamps[index] - stamps[index - 1])
        moving[rows] = (speed > _MIN_SPEED) & (speed < _MAX_SPEED)
    return frame.scatter(np.where(moving, Label.MOVING, Label.STATIC).astype(np.uint8))
