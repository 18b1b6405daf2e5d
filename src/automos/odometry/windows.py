"""Refinement while the recording goes by: windows of some seconds, each beginning on the end of the one before.

Memory stays that of one window however long the recording is. In the overlap the first half keeps its poses, so that
the world goes on without a step; the second half, which had no future yet, is refined again.
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from automos.odometry.links import Alignment, Consistency, Window
from automos.odometry.refine import refine_poses
from automos.odometry.speed import OFFSETS, lengthen, search_speed
from automos.odometry.surfels import Surfels
from automos.scan import Pose
from automos.settings import OdometrySettings

WINDOW = 20.0
"""Seconds of recording refined at once: many times the longest baseline."""
OVERLAP = 6.0
"""Seconds of it that are refined again with the next: as long as a pose is felt."""
SPEED_ROUNDS = 5
"""Searches for the speed, at most, each from the poses that the one before has found."""


class RollingRefinement:
    """Takes scans with first poses one by one, gives refined poses at the end."""

    def __init__(
        self,
        period: float,
        share: float,
        settings: OdometrySettings,
        pool: ThreadPoolExecutor | None = None,
        window: float = WINDOW,
        overlap: float = OVERLAP,
    ):
        """Take the usual seconds between scans, the share of it a sweep lasts, and threads to work with.

        `window` and `overlap` are the seconds refined at once, and again with the next.
        """
        self._period, self._share, self._settings, self._pool = period, share, settings, pool
        self._length = max(round(window / period), 3)
        self._overlap = min(max(round(overlap / period), 2), self._length - 1)
        self._surfels: list[Surfels | Future[Surfels]] = []
        self._twists: list[npt.NDArray[np.float64]] = []
        self._poses: list[Pose] = []  # refined up to the overlap, first poses after it
        self._gaps: list[float] = []
        self._n_known = 0  # of these scans, how many were refined before
        self._finished: list[Pose] = []
        self._before: list[Consistency] = []
        self._after: list[Consistency] = []
        self.lengthened = 0.0
        """Metres by which steps were too short, all together."""
        self.refound = np.zeros(len(OFFSETS))
        """How much of what faces along the way is found again at other speeds, see `SpeedSearch`."""

    def add(
        self, surfels: Surfels | Future[Surfels], twist: npt.NDArray[np.float64], T_last_this: Pose, gap: float
    ) -> None:
        """Add a scan: its surfels, the twist they are compensated with, its pose in and its gap to the scan before."""
        if len(self._poses) == self._length:
            self._refine()
            self._keep_last(self._overlap)
        self._poses.append(self._poses[-1] @ T_last_this if self._poses else np.eye(4))
        if len(self._poses) > 1:
            self._gaps.append(gap)
        self._surfels.append(surfels)
        self._twists.append(twist)

    def finish(self) -> tuple[Pose, Consistency, Consistency]:
        """Return the (N, 4, 4) refined poses, and the links' consistency before and after."""
        if self._poses:
            self._refine()
            self._keep_last(0)
        poses = np.array(self._finished).reshape(-1, 4, 4)
        return poses, Consistency.concatenate(self._before), Consistency.concatenate(self._after)

    def _refine(self) -> None:
        surfels = [s.result() if isinstance(s, Future) else s for s in self._surfels]
        poses, gaps = np.array(self._poses), np.array(self._gaps)
        window = Window(surfels, np.array(self._twists), poses, gaps, self._period, self._share)
        is_fixed = np.arange(len(poses)) < self._n_known // 2
        for _ in range(SPEED_ROUNDS):
            search = search_speed(window, self._settings, self._pool)
            missing = search.missing
            missing[: max(self._n_known - 1, 0)] = 0.0
            if not missing.any():
                break
            self.lengthened += float(np.linalg.norm(missing, axis=1).sum())
            window = window.moved(lengthen(window.T_world_sensor, missing))
            window = refine_poses(window, is_fixed, self._settings, Alignment(), self._pool)[0]
        self.refound += search.refound
        window, before, after = refine_poses(window, is_fixed, self._settings, Alignment(), self._pool)
        self._before.append(before)
        self._after.append(after)
        self._surfels, self._twists = list(window.surfels), list(window.twists)
        self._poses = list(window.T_world_sensor)

    def _keep_last(self, n: int) -> None:
        done = len(self._poses) - n
        self._finished += self._poses[:done]
        self._surfels, self._twists, self._poses = self._surfels[done:], self._twists[done:], self._poses[done:]
        self._gaps = self._gaps[done:]
        self._n_known = n
