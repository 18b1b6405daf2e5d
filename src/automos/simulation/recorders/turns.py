"""Sweeps of one turn each, whose points lack times: when each was measured, from where it lies.

Files of such sweeps (KITTI's) hold the points beam by beam, each beam's by azimuth, cut somewhere that need not be
where the sweep was cut in time.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from automos.core.pose_files import interpolate_poses
from automos.core.scan import Pose, Scan, Sequence

PERIOD = 0.1
"""Seconds of a turn where the recording has no clock."""
BACK_TO_START = 5.5
"""Radians by which azimuth falls from one point to the next where the next beam's begin."""


class TurnsByAzimuth(Sequence):
    """A sequence of sweeps of one turn each, with times from azimuth and, where they have none, beams from order.

    Parameters
    ----------
    inner : Sequence
        The sweeps, raw.
    turn : int
        +1 for a sensor that turns counter-clockwise seen from above, -1 for clockwise.
    seam_deg : float
        Azimuth at which sweeps begin and end, degrees from +x towards +y.
    """

    def __init__(self, inner: Sequence, turn: int = -1, seam_deg: float = 180.0):
        self._inner, self._turn, self._seam = inner, turn, np.radians(seam_deg)
        self.name = inner.name

    def __len__(self) -> int:
        return len(self._inner)

    def __getitem__(self, index: int) -> Scan:
        scan = self._inner[index]
        azimuth = np.arctan2(scan.points[:, 1], scan.points[:, 0]).astype(np.float64)
        share = (self._turn * (azimuth - self._seam) / (2.0 * np.pi)) % 1.0
        ring = rings_from_order(azimuth) if scan.ring is None else scan.ring
        return replace(scan, time=(share * self.period).astype(np.float32), ring=ring)

    @property
    def names(self) -> list[str]:
        """As the sweeps' own."""
        return self._inner.names

    @property
    def period(self) -> float:
        """Seconds of a turn."""
        stamps = self._inner.stamps
        return PERIOD if stamps is None or len(stamps) < 2 else float(np.median(np.diff(stamps)))

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        """(len,) seconds of the sweeps' middles; PERIOD apart where there is no clock."""
        stamps = self._inner.stamps
        return PERIOD * (np.arange(len(self), dtype=np.float64) + 0.5) if stamps is None else stamps

    @property
    def reference_poses(self) -> Pose | None:
        """As the sweeps' own."""
        return self._inner.reference_poses

    def poses_at(self, times: npt.NDArray[np.float64]) -> Pose:
        """Return the (len(times), 4, 4) reference poses at `times`, between those of the sweeps."""
        poses = self._inner.reference_poses
        if poses is None:
            raise ValueError(f"{self.name} has no poses")
        return interpolate_poses(self.stamps, poses, times)

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """As the sweeps' own."""
        return self._inner.truth(index)


def rings_from_order(azimuth: npt.NDArray[np.float64]) -> npt.NDArray[np.uint16]:
    """Return (N,) beams of points kept beam by beam, each beam's by rising azimuth from 0 to a full turn.

    A beam that saw nothing is not counted: numbers are in order, and may be too low.
    """
    onward = azimuth % (2.0 * np.pi)
    return np.concatenate([[0], np.cumsum(np.diff(onward) < -BACK_TO_START)]).astype(np.uint16)[: len(azimuth)]
