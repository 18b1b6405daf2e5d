"""Free-space evidence between the scans of the last seconds."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array, inverse
from automos.core.scan import Pose
from automos.evidence.free_space import SPAN_TOLERANCE, ask, partners_of
from automos.evidence.observations import Seen, View
from automos.settings import FreeSpaceSettings

SURE = 4.0
"""Poses are off by less than so many times what the last one was refined by."""


@dataclass(eq=False)
class _PastScan:
    stamp: float
    is_far: bool
    seen: Seen
    T_level_sensor: Pose


class EvidenceWindow:
    """Holds the scans that may still be compared: all of the last few seconds, some of the earlier ones."""

    def __init__(self, settings: FreeSpaceSettings):
        """Take the settings of the free-space comparison."""
        self._settings = settings
        self._scans: list[_PastScan] = []
        self._doubt = 0.0, 0.0

    def __len__(self) -> int:
        return len(self._scans)

    @property
    def poses(self) -> dict[float, Pose]:
        """(4, 4) T_level_sensor of all scans held, by stamp."""
        return {scan.stamp: scan.T_level_sensor for scan in self._scans}

    def add(self, stamp: float, seen: Seen, T_level_sensor: Pose, doubt: Array) -> None:
        """Store the observations of the scan at `stamp`, later than all others, and its (4, 4) pose.

        doubt : (6,) float64, twist by which the pose may be off, and those of the scans just before.
        """
        self._doubt = tuple((SURE * np.linalg.norm(doubt.reshape(2, 3), axis=1)).tolist())
        step = self._settings.far_step
        is_far = not self._scans or np.floor(stamp / step) > np.floor(self._scans[-1].stamp / step)
        self._scans.append(_PastScan(stamp, is_far, seen, T_level_sensor))

    def renew(self, seen: dict[float, tuple[Seen, Pose]], T_after_before: Pose) -> None:
        """Replace observations and poses of some scans, by stamp, and move those of all by (4, 4) `T_after_before`."""
        for scan in self._scans:
            known, T = seen.get(scan.stamp, (scan.seen, scan.T_level_sensor))
            scan.seen = (known if len(scan.seen.kind) else as_partner(known)).moved(T_after_before)
            scan.T_level_sensor = T_after_before @ T

    def place(self, poses: dict[float, Pose]) -> None:
        """Move the scans of which `poses` gives a refined (4, 4) T_level_sensor, by stamp."""
        scans = [scan for scan in self._scans if scan.stamp in poses]
        T_now = np.array([poses[scan.stamp] for scan in scans]).reshape(-1, 4, 4)
        T_before = np.array([scan.T_level_sensor for scan in scans]).reshape(-1, 4, 4)
        for scan, T, change in zip(scans, T_now, T_now @ inverse(T_before), strict=True):
            scan.seen, scan.T_level_sensor = scan.seen.moved(change), T

    def comparison(self, stamp: float, mine: Seen) -> Callable[[ThreadPoolExecutor | None], npt.NDArray[np.float32]]:
        """Return a function that compares the scan at `stamp`, with observations `mine`, with all scans held now.

        It takes a thread pool, or None in one of the pool's threads. Its result does not depend on when it is called.
        """
        stamps = np.array([scan.stamp for scan in self._scans])
        is_far = np.array([scan.is_far for scan in self._scans], np.bool_)
        chosen = partners_of(stamp, stamps, is_far, self._settings)
        others = [self._scans[k].seen for k in chosen]
        return partial(ask, mine, others, stamps[chosen] - stamp, self._settings, self._doubt)

    def forget(self, stamp: float) -> None:
        """Drop scans not needed at `stamp` or later, and the points of all earlier scans."""
        reach = 1.0 + SPAN_TOLERANCE
        near, far = stamp - reach * self._settings.far_from, stamp - reach * self._settings.longest_span
        self._scans = [scan for scan in self._scans if scan.stamp >= (far if scan.is_far else near)]
        for scan in self._scans:
            if scan.stamp < stamp and len(scan.seen.kind):
                scan.seen = as_partner(scan.seen)


def as_partner(seen: Seen) -> Seen:
    """Return what other scans need: the images without the points."""
    nothing = np.zeros(0, np.uint8)
    return Seen(nothing, nothing.astype(np.float32), nothing, [_without_points(view) for view in seen.views])


def _without_points(view: View) -> View:
    nobody = np.zeros(0, np.bool_)
    return replace(view, rows=slice(0), is_object=nobody, is_supported=nobody, objects=np.zeros((3, 0), np.float32))
