"""Which points of a run's scans are written."""

from enum import Enum

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label
from automos.core.scan import Scan
from automos.results.run_files import RunFiles


class Choice(Enum):
    """Which points are kept. Those without a return are kept with what does not move, as they tell nothing.

    Attributes
    ----------
    STATIC : what is labelled static.
    NOT_MOVING : also what has no label: the vehicle that carries the sensor, and places never observed.
    MOVING : what moves, and nothing else.
    """

    STATIC = "static points"
    NOT_MOVING = "all but moving points"
    MOVING = "moving points"

    def rows(self, run: RunFiles, scan: Scan, index: int) -> npt.NDArray[np.bool_]:
        """Return (N,) which points of `scan`, number `index` of `run`, are kept."""
        labels = run.labels(index, len(scan))
        if self is Choice.MOVING:
            return labels == Label.MOVING
        return (labels != Label.MOVING) & ((labels == Label.STATIC) | ~scan.is_valid | (self is Choice.NOT_MOVING))
