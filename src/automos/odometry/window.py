"""Consecutive scans of a recording, as surfels at poses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array, inverse
from automos.core.scan import Mask, Pose
from automos.odometry.motion import step_twists
from automos.odometry.submap import NOISE
from automos.odometry.surfels import NEAR, Surfels

SAME_POSE = NOISE / 10.0
"""Metres within which poses are the same, a tenth of a surfel's noise: iterations end, and what fitted still does."""
ROUNDS = 4
"""Estimates of what hangs on the poses that hang on it (the speed, missing scans, the beams), at most."""


def is_moved(T: Pose, T_now: Pose) -> Mask:
    """Return (...,) whether poses (..., 4, 4) differ by more than `SAME_POSE` where surfaces are near."""
    turned = np.abs(T_now[..., :3, :3] - T[..., :3, :3]).max(axis=(-2, -1))
    return np.linalg.norm(T_now[..., :3, 3] - T[..., :3, 3], axis=-1) + NEAR * turned > SAME_POSE


def small_motion(T: Pose, T_now: Pose) -> Array:
    """Return the (..., 6) twist of the small motion that takes poses (..., 4, 4) to others, in their target frame."""
    change = T_now @ inverse(T)
    R, rho = change[..., :3, :3], change[..., :3, 3]
    skew = 0.5 * (R - np.swapaxes(R, -1, -2))
    return np.concatenate([rho, np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1)], axis=-1)


@dataclass(frozen=True, eq=False)
class Window:
    """N consecutive scans as surfels, compensated with an assumed motion."""

    surfels: list[Surfels]  # sensor frame at mid-sweep
    twists: Array  # (N, 6) motion per sweep used for the compensation
    T_world_sensor: Pose  # (N, 4, 4)
    gaps: Array  # (N - 1,) time between scans in units of the usual one
    period: float  # seconds, the usual time between scans
    share: float  # sweep duration over the usual time between scans
    first: int = 0  # number of the first scan in the recording

    def __len__(self) -> int:
        return len(self.surfels)

    @property
    def clock(self) -> Array:
        """(N,) seconds since the first scan."""
        return np.concatenate([[0.0], np.cumsum(self.gaps)]) * self.period

    @property
    def steps(self) -> Pose:
        """(N - 1, 4, 4) from each scan to the one before."""
        return inverse(self.T_world_sensor[:-1]) @ self.T_world_sensor[1:]

    def moved(self, T_world_sensor: Pose) -> Window:
        """Return the same scans at other poses, with surfels compensated for the motion between these."""
        changes = self.share * step_twists(T_world_sensor, self.gaps) - self.twists
        is_other = np.linalg.norm(changes[:, :3], axis=1) + NEAR * np.linalg.norm(changes[:, 3:], axis=1) > SAME_POSE
        changes[~is_other] = 0.0
        surfels = [s.compensated(c) if m else s for s, c, m in zip(self.surfels, changes, is_other, strict=True)]
        return replace(self, surfels=surfels, twists=self.twists + changes, T_world_sensor=T_world_sensor)

    def then(self, gap: npt.ArrayLike, later: Window) -> Window:
        """Return the scans and `later` ones, after one `gap` (1,), or none (0,) if there are no scans before them."""
        return replace(
            later,
            surfels=[*self.surfels, *later.surfels],
            twists=np.vstack([self.twists, later.twists]),
            T_world_sensor=np.concatenate([self.T_world_sensor, later.T_world_sensor]),
            gaps=np.concatenate([self.gaps, gap, later.gaps]),
            first=self.first,
        )

    def part(self, start: int, stop: int | None = None) -> Window:
        """Return some of the scans, from number `start` of the window on."""
        stop = len(self) if stop is None else stop
        return replace(
            self,
            surfels=self.surfels[start:stop],
            twists=self.twists[start:stop],
            T_world_sensor=self.T_world_sensor[start:stop],
            gaps=self.gaps[start : max(stop - 1, start)],
            first=self.first + start,
        )
