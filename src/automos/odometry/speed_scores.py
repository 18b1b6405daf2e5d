"""How much of what faces along the sensor's path is found again at each speed that it might have.

Over two baselines at once: what stands is found again at the sensor's speed over both, traffic at another speed has no
common peak. From nearly the same place nearly all is found again, so a speed near standing under which little is found
counts for as much less.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse
from automos.odometry.facing import EVIDENCE, expected_share, score_distances, signed_distance
from automos.odometry.links import Window
from automos.odometry.submap import make_submap
from automos.odometry.surfels import Surfels
from automos.settings import OdometrySettings

Array = npt.NDArray[np.float64]

NEAR_STEPS = 2
"""Steps of speed that are still the same speed."""
LAGS = (0.3, 0.8)
"""Seconds over which things are passed: what moves has no common peak over both."""
EVERY = 0.5
"""Seconds between the places asked."""
STEP = 0.125
"""m/s between speeds tried: 10 cm over the longer baseline."""
WEIGHTS = np.array([1.0, 1.0, 4.0])
"""Of what is low, of what is far beside, and of what is higher than any vehicle: it cannot be traffic."""
LANDMARKS = np.array([0.0, 1.0, 1.0])
"""The same where only what cannot be traffic is asked."""
REVERSE_COST = 0.3
"""Of a full score, that going backwards has behind."""
MIN_CLEAR_SPEED = 2.0
"""m/s, slower first estimates may be a mistaken standstill."""
OTHER_SPEED = 1.0
"""m/s from which on a speed is another one."""
CLEARLY_MORE = 1.2
"""Standard deviations of the evidence by which a speed must be ahead of another."""


@dataclass(frozen=True, eq=False)
class Landmarks:
    """How much of what cannot be traffic is found again at M places: of what is far beside the path, or overhead.

    Attributes
    ----------
    speeds : (M,) m/s.
    refound : (M,) how much is found again at these speeds.   expected : (M,) how much should be at least.
    """

    speeds: Array
    refound: Array
    expected: Array

    @classmethod
    def concatenate(cls, parts: list[Landmarks]) -> Landmarks:
        """Return what is found in several windows."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts] or [[]]) for f in fields(cls)))

    def explains_more_than(self, other: Landmarks) -> bool:
        """Whether these speeds have clearly more evidence than others."""
        return self.lead_over(other) > CLEARLY_MORE

    @property
    def are_missed(self) -> bool:
        """Whether clearly less is found again than should be: who stands finds again what stands beside the road."""
        missed = self.expected.sum() - self.refound.sum()
        return bool(missed > CLEARLY_MORE * np.sqrt(self.expected.sum()))

    def lead_over(self, other: Landmarks) -> float:
        """Return how much more evidence there is where speeds differ, in deviations of counts: their roots."""
        differ = np.abs(self.speeds - other.speeds) >= OTHER_SPEED
        here, there = self._evidence(differ), other._evidence(differ)
        return (here - there) / max(float(np.sqrt(here + there)), 1e-9)

    def _evidence(self, places: npt.NDArray[np.bool_]) -> float:
        """Return what is found again at some places, less what is missed of that which should be."""
        refound, expected = self.refound[places].sum(), self.expected[places].sum()
        return float(max(refound - max(expected - refound, 0.0), 0.0))


NOTHING = Landmarks(np.zeros(0), np.zeros(0), np.zeros(0))
"""What is found where nothing is asked."""


@dataclass(frozen=True, eq=False)
class SpeedScores:
    """How much is found again at each of M places under each of S speeds.

    Attributes
    ----------
    speeds : (S,) m/s.  times : (M,) seconds.  present : (M,) m/s, as the poses are.
    believed, by_landmarks : (M, S) share of what can be found, as far as it is to be believed; of landmarks alone.
    refound : (M, 3, S) weights of the surfaces found again, see `score_distances`.
    whole : (M, 3) of all there are.
    """

    speeds: Array
    times: Array
    present: Array
    believed: Array
    by_landmarks: Array
    refound: Array
    whole: Array

    @property
    def nearest(self) -> npt.NDArray[np.int64]:
        """(M,) the speed tried that is nearest to the present one."""
        at = np.round((self.present - self.speeds[0]) / STEP).astype(int)
        return np.clip(at, 0, len(self.speeds) - 1)

    def likely(self, believed: Array, min_ratio: float) -> Array:
        """Return `believed` (M, S), less where speeds are unlikely."""
        likely, present = believed.copy(), self.present[:, None]
        # What pulls registrations off pulls them towards standing still, so a clear motion is never too fast by much.
        is_slower = self.speeds * np.sign(present) < min_ratio * np.abs(present)
        likely[is_slower & (np.abs(present) > MIN_CLEAR_SPEED)] -= 1.0
        likely[:, self.speeds < -STEP] -= REVERSE_COST
        return likely

    def landmarks_along(self, path: npt.NDArray[np.int64]) -> Landmarks:
        """Return what is found again of landmarks by who drives at the speeds `path` (M,), or nearly."""
        near = np.clip(path[:, None] + np.arange(-NEAR_STEPS, NEAR_STEPS + 1), 0, len(self.speeds) - 1)
        refound = np.take_along_axis(np.einsum("k,mks->ms", LANDMARKS, self.refound), near, axis=1).max(axis=1)
        share = expected_share(self.speeds[path, None] * np.array(LAGS)).mean(axis=1)
        return Landmarks(self.speeds[path], refound, self.whole @ LANDMARKS * share)


def score_speeds(
    forward: Array, window: Window, surfels: list[Surfels], settings: OdometrySettings, pool: ThreadPoolExecutor | None
) -> SpeedScores:
    """Return how much is found again along `forward` (3,) at every speed."""
    T, period = window.T_world_sensor, window.period
    lags = sorted({min(max(round(lag / period), 1), len(window) - 1) for lag in LAGS})
    starts = np.arange(0, len(window) - max(lags), max(round(EVERY / period), 1))
    clock = window.clock
    speeds = np.arange(-settings.max_reverse, settings.max_speed, STEP)

    def score(start: int) -> tuple[Array, Array, Array, Array]:
        submap = make_submap([surfels[start]], np.eye(4)[None])
        whole = score_distances(submap, surfels[start], np.eye(4), forward, np.zeros(1), 0.0, settings.overhead)[:, 0]
        ends = start + np.array(lags)
        seconds = clock[ends] - clock[start]
        travelled = signed_distance(inverse(T[start]) @ T[ends], forward)[0]
        # Who brakes has another mean speed over each lag: another speed is a change that all of them share.
        distances = travelled[:, None] + (speeds - travelled[-1] / seconds[-1]) * seconds[:, None]
        found = np.array([
            score_distances(
                submap, surfels[end], inverse(T[start]) @ T[end], forward, distance, window.share * period / passed,
                settings.overhead,
            )
            for end, passed, distance in zip(ends, seconds, distances, strict=True)
        ])  # fmt: skip
        expected = expected_share(distances)
        believed, by_landmarks = (_believed(weights, found, whole, expected) for weights in (WEIGHTS, LANDMARKS))
        return believed, by_landmarks, found.mean(axis=0), whole

    todo = starts.tolist()
    scored = zip(*(map(score, todo) if pool is None else pool.map(score, todo)), strict=True)
    ends = starts + max(lags)
    present = signed_distance(inverse(T[starts]) @ T[ends], forward)[0] / (clock[ends] - clock[starts])
    times = np.interp(starts + np.mean(lags), np.arange(len(clock)), clock)
    return SpeedScores(speeds, times, present, *(np.array(part) for part in scored))


def _believed(weights: Array, found: Array, whole: Array, expected: Array) -> Array:
    """Return (S,) the share of what can be found that is, as far as it is to be believed.

    weights : (3,) of what is low, beside and high.   found : (L, 3, S) over each lag.   whole : (3,) all there is.
    expected : (L, S) how much of it is found again at least.
    """
    weighed = np.einsum("k,lks->ls", weights, found)
    share = weighed / np.maximum(weights @ whole * expected, 1e-9)
    return (weighed * np.minimum(share, 1.0)).sum(axis=0) / (weighed.sum(axis=0).max() + EVIDENCE)
