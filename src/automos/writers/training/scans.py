"""One scan as trainers read it: points without gaps, motion-compensated, intensity from 0 to 1, a label beside each.

Trainers turn a point at the origin, or one that is not finite, into an index far outside their images. Such points are
left out of scan and labels alike.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label, pack
from automos.core.scan import Points
from automos.results.run_files import RunFiles
from automos.writers.point_columns import intensity_of

IDS = {
    "universal": {Label.UNLABELED: 0, Label.STATIC: 99, Label.MOVING: 259},
    "mos": {Label.UNLABELED: 0, Label.STATIC: 9, Label.MOVING: 251},
}
"""Numbers that stand for the labels.

universal: other-object and moving-other-vehicle, which trainers of all kinds know.   mos: those of the benchmark, which
semantic trainers refuse or take for cars.
"""
_MOST_INSTANCES = 0x7FFF
"""Trainers read a label and its instance as one number of 32 bits with a sign."""
_FULL_SCALES = (1.0, 255.0, 65535.0)
"""What sensors and recorders give to the strongest return: a share, a byte, or two."""


@dataclass(frozen=True, eq=False)
class TrainingScan:
    """The M points of use of a scan.

    Attributes
    ----------
    points : (M, 4) float32
        x, y, z in metres as seen from the scan's pose, and the intensity from 0 to 1.
    labels : (M,) uint32
        Number of the label in the lower 16 bits; the object, 0 for none, in the upper ones.
    """

    points: Points
    labels: npt.NDArray[np.uint32]

    @property
    def n_moving(self) -> int:
        """Number of points that move."""
        return int(np.count_nonzero((self.labels & 0xFFFF) > 250))


def training_scan(run: RunFiles, index: int, ids: str, full_scale: float) -> TrainingScan:
    """Return scan `index` of `run` with labels numbered as `ids`, one of `IDS`.

    full_scale : the intensity that becomes 1; see `full_scale_of`.
    """
    scan = run.scan(index)
    kept = scan.is_valid
    share = np.clip(intensity_of(scan) / np.float32(full_scale), 0.0, 1.0)
    points = np.column_stack([run.points_at_pose(scan, index), share]).astype(np.float32)
    found = run.labels(index, len(scan))
    number_of = np.zeros(Label.MOVING + 1, np.uint32)
    for label, number in IDS[ids].items():
        number_of[label] = number
    instances = None
    if ids == "universal":  # the benchmark's labels have none: some tools compare all 32 bits with 250
        objects = run.instances(index, len(scan))
        instances = np.where(objects > 0, (objects - 1) % _MOST_INSTANCES + 1, 0)[kept]
    return TrainingScan(points[kept], pack(number_of[found[kept]], instances))


def full_scale_of(run: RunFiles) -> float:
    """Return the intensity of the strongest return that the sensor can give: 1, 255, or 65535.

    The smallest that no point of some scans, spread over the recording, is above.
    """
    shown = (run.scan(index).intensity for index in spread(len(run), 20))
    highest = max((float(np.nan_to_num(each).max(initial=0.0)) for each in shown if each is not None), default=0.0)
    return next((scale for scale in _FULL_SCALES if highest <= scale), highest)


def spread(n: int, count: int) -> list[int]:
    """Return at most `count` of `n` numbers from 0 on, evenly spread."""
    return np.unique(np.linspace(0, n - 1, min(n, count)).astype(int)).tolist() if n else []
