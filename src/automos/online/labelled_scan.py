"""The result of online labelling: one scan with its labels and moving objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label
from automos.core.scan import OBJECT, Pose
from automos.core.stages import Arrays
from automos.objects.detections import Detections
from automos.objects.tracks import Tracks

OBJECT_FIELDS = [("track", "i8"), ("center", "3f8"), ("size", "3f8"), ("yaw", "f8"), ("velocity", "3f8")]


@dataclass(frozen=True, eq=False)
class LabelledScan:
    """A labelled scan of N points, in the order of the scan.

    Attributes
    ----------
    index : int
        Number of scans pushed before it.
    stamp : float
        Seconds.
    pose : (4, 4) float64
        T_world_sensor at mid-sweep. The world frame has z up and the ground under the first scan at z = 0.
    labels : (N,) uint8
        `Label` of each point: 251 moving, 9 static, 0 for missing returns, the ego body, and places never observed
        before.
    track_ids : (N,) int32
        Number of the moving object of each point, -1 for none. An object keeps its number.
    confidence : (N,) float32
        Probability in [0, 1] that the label is correct; for unlabelled points, that they are static.
    objects : (K,) structured array
        One row per moving object in this scan, in the world frame: `track` (its number), `center` (3) and `size`
        (3: length, width, height) in metres, `yaw` in radians, `velocity` (3) in m/s.
    """

    index: int
    stamp: float
    pose: Pose
    labels: npt.NDArray[np.uint8]
    track_ids: npt.NDArray[np.int32]
    confidence: npt.NDArray[np.float32]
    objects: npt.NDArray

    @staticmethod
    def of_nothing(index: int, stamp: float, pose: Pose, n: int) -> LabelledScan:
        """Return an unlabelled scan of `n` points."""
        nothing = np.zeros(n, np.uint8), np.full(n, -1, np.int32), np.zeros(n, np.float32)
        return LabelledScan(index, stamp, pose, *nothing, np.zeros(0, OBJECT_FIELDS))

    def __repr__(self) -> str:
        n_moving = int(np.count_nonzero(self.labels == Label.MOVING))
        return f"<LabelledScan {self.index}: {len(self.labels)} points, {n_moving} moving, {len(self.objects)} objects>"


def objects_of(tracks: Tracks) -> npt.NDArray:
    """Return the rows of `tracks` as (K,) `OBJECT_FIELDS`."""
    out = np.zeros(len(tracks.track), OBJECT_FIELDS)
    for name in out.dtype.names or ():
        out[name] = getattr(tracks, name)
    return out


def is_unknown(about: Arrays, segments: Arrays) -> npt.NDArray[np.bool_]:
    """Return (M,) whether a point has no evidence: no scan observed its position, nor any other of its segment."""
    found = Detections.from_arrays(segments)
    spoken = np.append(found.n_moving + found.n_static > 0.0, False)  # the last entry is for id -1
    is_silent = about["log_odds"] == 0.0
    return (about["kind"] == OBJECT) & is_silent & ~spoken[segments["ids"]] & ~spoken[segments["stayed"]]
