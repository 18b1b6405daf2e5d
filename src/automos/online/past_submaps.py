"""Registers a scan to submaps of the scans half a second to two seconds before it.

Registration to the scans just before accumulates errors, and the rings of a spinning sensor coincide wherever it goes,
which biases the motion towards zero. Walls, poles and kerbs observed earlier have neither effect, see
`odometry.refine`; this is its causal part.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.geometry import adjoint, inverse, se3_exp, se3_log
from automos.core.scan import Pose
from automos.odometry.links import MIN_MATCHED, Alignment
from automos.odometry.refine import CONVERGED, INFORMATION
from automos.odometry.submap import Fit, Submap, fit_surfels, make_submap
from automos.odometry.surfels import Surfels
from automos.settings import OdometrySettings

Array = npt.NDArray[np.float64]
ON_PAST = Alignment()
SUDDEN = 2.0
"""Usual accelerations at which the weight of the prior is half that of a normal distribution."""
FIRST_MOTION = np.array([2.0, 0.2])
"""Metres and radians, expected motion from the first scan to the second."""


@dataclass(frozen=True, eq=False)
class _Kept:
    stamp: float
    T_world_sensor: Pose
    surfels: Surfels


@dataclass(frozen=True, eq=False)
class _Place:
    stamp: float
    T_world_center: Pose
    submap: Submap


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted motion of the sensor from the previous scan to this one.

    Attributes
    ----------
    stamp : float
        Seconds.
    T_world_last : (4, 4) float64
        Pose of the previous scan, `gap` usual periods earlier.
    twist, variance : (6,) float64
        Expected motion per usual period, which is `period` seconds, and its variance.
    share : float
        Sweep duration over the time between scans.
    is_first : bool
        Whether `twist` is a guess, because there are no earlier scans.
    """

    stamp: float
    T_world_last: Pose
    gap: float
    twist: Array
    variance: Array
    period: float
    share: float
    is_first: bool

    def prior_weights(self, off: Array, settings: OdometrySettings) -> Array:
        """Return (6,) weights of the prior on even motion, for a motion that is `off` (6,) from the prediction.

        The prediction inherits the variance of the motion it is based on, so an uncertain speed is only a weak prior.
        The tails are heavy (Cauchy), which permits hard braking in traffic.
        """
        usual = np.array([settings.usual_acceleration, np.radians(settings.usual_turn_acceleration_deg)])
        spread = usual * self.period**2 * self.gap
        spread = np.maximum(spread, FIRST_MOTION) if self.is_first else spread
        variance = np.repeat(spread**2, 3) + self.gap**2 * self.variance
        far = (off**2 / variance).reshape(2, 3).sum(axis=1) / SUDDEN**2
        return 1.0 / variance / (1.0 + np.repeat(far, 3))


@dataclass(frozen=True, eq=False)
class ScanAlignment:
    """An aligned scan: (4, 4) T_world_sensor, and its surfels compensated for the resulting motion.

    share : share of the surfels that lie on a surface; 0 without overlapping submaps.
    variance : (6,) variance of the motion.
    """

    T_world_sensor: Pose
    surfels: Surfels
    share: float
    variance: Array


class PastSubmaps:
    """Submaps of the last seconds, from scans with final poses."""

    def __init__(self, settings: OdometrySettings):
        self._settings = settings
        self._kept: deque[_Kept] = deque()
        self._places: deque[_Place] = deque()

    def add(self, stamp: float, T_world_sensor: Pose, surfels: Surfels, period: float) -> None:
        """Add a scan at its final pose; a submap is made of the last few scans at regular intervals."""
        half = int(ON_PAST.submap_length / period / 2.0)
        self._kept.append(_Kept(stamp, T_world_sensor, surfels))
        while len(self._kept) > 2 * half + 1:
            self._kept.popleft()
        is_first = not self._places
        center = self._kept[-1 if is_first else len(self._kept) // 2]
        is_due = is_first or center.stamp >= self._places[-1].stamp + ON_PAST.submap_every - 0.5 * period
        if is_due and (is_first or len(self._kept) == 2 * half + 1):
            T_center_parts = inverse(center.T_world_sensor) @ np.array([k.T_world_sensor for k in self._kept])
            parts = [k.surfels for k in self._kept]
            submap = make_submap(parts, T_center_parts)
            self._places.append(_Place(center.stamp, center.T_world_sensor, submap))
        reach = max(ON_PAST.lags) + ON_PAST.submap_every
        while self._places[0].stamp < stamp - reach and len(self._places) > 1:
            self._places.popleft()

    def align(self, guesses: list[Pose], surfels: Surfels, prediction: Prediction) -> ScanAlignment:
        """Return the best alignment of a scan, starting from each of the `guesses`, (4, 4) T_world_sensor.

        surfels : those of the scan, compensated for `prediction.share` times the motion `prediction.twist`.
        """
        places = self._near(prediction.stamp, guesses[0])
        if not places:
            return ScanAlignment(guesses[0], surfels, 0.0, prediction.variance)
        found = [self._align_from(places, guess, surfels, prediction) for guess in guesses]
        return max(found, key=lambda aligned: aligned.share)

    def _align_from(self, places: list[_Place], T: Pose, surfels: Surfels, prediction: Prediction) -> ScanAlignment:
        """Return the alignment of the scan, starting from the guess `T`."""
        used, unmatched = prediction.twist, ScanAlignment(T, surfels, 0.0, prediction.variance)
        for kernel in ON_PAST.kernels:
            fits = self._fit(places, T, surfels, kernel)
            A = adjoint(np.array([inverse(place.T_world_center) @ T for place in places]))
            weights = INFORMATION * np.array([fit.n_matched >= MIN_MATCHED for fit in fits])
            H = np.einsum("k,kji,kjl,klm->im", weights, A, np.array([fit.H for fit in fits]), A)
            g = np.einsum("k,kji,kj->i", weights, A, np.array([fit.g for fit in fits]))
            if not H.any():
                return unmatched
            off = se3_log(inverse(prediction.T_world_last) @ T) - prediction.gap * prediction.twist
            prior = prediction.prior_weights(off, self._settings)
            known = H + np.diag(prior)
            step = -np.linalg.solve(known, g + prior * off)
            T = T @ se3_exp(step)
            twist = se3_log(inverse(prediction.T_world_last) @ T) / prediction.gap
            surfels = surfels.compensated(prediction.share * (twist - used))
            used = twist
            if np.abs(step[:3]).max() < CONVERGED:
                break
        fits = self._fit(places, T, surfels, ON_PAST.kernels[-1])
        share = sum(fit.n_close for fit in fits) / sum(fit.n_surfels for fit in fits)
        return ScanAlignment(T, surfels, share, np.diag(np.linalg.inv(known)))

    def _near(self, stamp: float, T: Pose) -> list[_Place]:
        """Return the submap nearest to each lag, the oldest one if the past is shorter."""
        chosen = {}
        for lag in ON_PAST.lags:
            near = min(self._places, key=lambda place: abs(place.stamp - (stamp - lag)), default=None)
            if near is not None and np.linalg.norm(near.T_world_center[:3, 3] - T[:3, 3]) < ON_PAST.max_distance:
                chosen[near.stamp] = near
        return list(chosen.values())

    def _fit(self, places: list[_Place], T: Pose, surfels: Surfels, kernel: float) -> list[Fit]:
        every = max(-(-len(surfels) // ON_PAST.max_surfels), 1)  # a different subset for each submap
        return [
            fit_surfels(
                place.submap, surfels[k % every :: every], inverse(place.T_world_center) @ T, kernel)
            for k, place in enumerate(places)
        ]  # fmt: skip
