"""The share of surfaces facing along the path that are re-observed under each hypothesis on the speed.

Two baselines are used at once: static surfaces are re-observed at the sensor's speed over both, traffic at another
speed has no common peak. From nearly the same position, nearly everything is re-observed, so a low speed under which
little is re-observed is weighted down accordingly.
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
"""Steps of speed within which two speeds count as the same."""
LAGS = (0.3, 0.8)
"""Seconds, baselines: moving objects have no common peak over both."""
EVERY = 0.5
"""Seconds between the evaluated places."""
STEP = 0.125
"""m/s between speeds tried: 10 cm over the longer baseline."""
WEIGHTS = np.array([1.0, 1.0, 4.0])
"""Weights of low surfaces, those far beside, and those higher than any vehicle, which cannot be traffic."""
LANDMARKS = np.array([0.0, 1.0, 1.0])
"""The same for landmarks only, which cannot be traffic."""
REVERSE_COST = 0.3
"""Penalty of driving backwards, as a share of a full score."""
MIN_CLEAR_SPEED = 2.0
"""m/s; slower initial estimates may be a mistaken standstill."""
OTHER_SPEED = 1.0
"""m/s from which two speeds are considered different."""
CLEARLY_MORE = 1.2
"""Standard deviations of the evidence by which a speed must lead another."""


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Re-observed landmarks at M places: surfaces far beside the path or overhead, which cannot be traffic.

    Attributes
    ----------
    speeds : (M,) float64, m/s.
    refound, expected : (M,) float64, evidence re-observed at these speeds, and the least expected.
    """

    speeds: Array
    refound: Array
    expected: Array

    @classmethod
    def concatenate(cls, parts: list[Landmarks]) -> Landmarks:
        """Return the landmarks of several windows."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts] or [[]]) for f in fields(cls)))

    def explains_more_than(self, other: Landmarks) -> bool:
        """Whether these speeds have clearly more evidence than the others."""
        return self.lead_over(other) > CLEARLY_MORE

    @property
    def are_missed(self) -> bool:
        """Whether clearly less is re-observed than expected: a stationary sensor re-observes roadside landmarks."""
        missed = self.expected.sum() - self.refound.sum()
        return bool(missed > CLEARLY_MORE * np.sqrt(self.expected.sum()))

    def lead_over(self, other: Landmarks) -> float:
        """Return the lead in evidence where speeds differ, in standard deviations of the counts (their roots)."""
        differ = np.abs(self.speeds - other.speeds) >= OTHER_SPEED
        here, there = self._evidence(differ), other._evidence(differ)
        return (here - there) / max(float(np.sqrt(here + there)), 1e-9)

    def _evidence(self, places: npt.NDArray[np.bool_]) -> float:
        """Return the re-observed evidence at `places`, minus the part of the expected evidence that is missing."""
        refound, expected = self.refound[places].sum(), self.expected[places].sum()
        return float(max(refound - max(expected - refound, 0.0), 0.0))


NOTHING = Landmarks(np.zeros(0), np.zeros(0), np.zeros(0))
"""The result without any places."""


@dataclass(frozen=True, eq=False)
class SpeedScores:
    """Re-observed surfaces at each of M places under each of S speeds.

    Attributes
    ----------
    speeds : (S,) m/s.  times : (M,) seconds.  present : (M,) m/s, speed of the present poses.
    by_all, by_landmarks : (M, S) scores: weighted share of re-observed surfaces; of landmarks alone.
    refound : (M, 3, S) weights of the re-observed surfaces, see `score_distances`.
    whole : (M, 3) weights of all surfaces.
    """

    speeds: Array
    times: Array
    present: Array
    by_all: Array
    by_landmarks: Array
    refound: Array
    whole: Array

    @property
    def nearest(self) -> npt.NDArray[np.int64]:
        """(M,) index of the tried speed nearest to the present one."""
        at = np.round((self.present - self.speeds[0]) / STEP).astype(int)
        return np.clip(at, 0, len(self.speeds) - 1)

    def with_priors(self, scores: Array, min_ratio: float) -> Array:
        """Return `scores` (M, S) minus the penalties of unlikely speeds."""
        out, present = scores.copy(), self.present[:, None]
        # Registrations are biased towards standstill, so a clear motion is never much too fast.
        is_slower = self.speeds * np.sign(present) < min_ratio * np.abs(present)
        out[is_slower & (np.abs(present) > MIN_CLEAR_SPEED)] -= 1.0
        out[:, self.speeds < -STEP] -= REVERSE_COST
        return out

    def landmarks_along(self, path: npt.NDArray[np.int64]) -> Landmarks:
        """Return the landmarks that are re-observed at nearly the speeds with indices `path` (M,)."""
        near = np.clip(path[:, None] + np.arange(-NEAR_STEPS, NEAR_STEPS + 1), 0, len(self.speeds) - 1)
        refound = np.take_along_axis(np.einsum("k,mks->ms", LANDMARKS, self.refound), near, axis=1).max(axis=1)
        share = expected_share(self.speeds[path, None] * np.array(LAGS)).mean(axis=1)
        return Landmarks(self.speeds[path], refound, self.whole @ LANDMARKS * share)


def score_speeds(
    forward: Array, window: Window, surfels: list[Surfels], settings: OdometrySettings, pool: ThreadPoolExecutor | None
) -> SpeedScores:
    """Return how much is re-observed along `forward` (3,) at every speed."""
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
        # A braking sensor has a different mean speed over each lag: a hypothesis changes the speed equally over all.
        distances = travelled[:, None] + (speeds - travelled[-1] / seconds[-1]) * seconds[:, None]
        found = np.array([
            score_distances(
                submap, surfels[end], inverse(T[start]) @ T[end], forward, distance, window.share * period / passed,
                settings.overhead,
            )
            for end, passed, distance in zip(ends, seconds, distances, strict=True)
        ])  # fmt: skip
        expected = expected_share(distances)
        by_all, by_landmarks = (_weighted_share(weights, found, whole, expected) for weights in (WEIGHTS, LANDMARKS))
        return by_all, by_landmarks, found.mean(axis=0), whole

    todo = starts.tolist()
    scored = zip(*(map(score, todo) if pool is None else pool.map(score, todo)), strict=True)
    ends = starts + max(lags)
    present = signed_distance(inverse(T[starts]) @ T[ends], forward)[0] / (clock[ends] - clock[starts])
    times = np.interp(starts + np.mean(lags), np.arange(len(clock)), clock)
    return SpeedScores(speeds, times, present, *(np.array(part) for part in scored))


def _weighted_share(weights: Array, found: Array, whole: Array, expected: Array) -> Array:
    """Return (S,) the score of each speed: the re-observed share, weighted down where less than expected is found.

    weights : (3,) of low, lateral and high surfaces.   found : (L, 3, S) re-observed.   whole : (3,) all surfaces.
    expected : (L, S) least share that should be re-observed.
    """
    weighed = np.einsum("k,lks->ls", weights, found)
    share = weighed / np.maximum(weights @ whole * expected, 1e-9)
    return (weighed * np.minimum(share, 1.0)).sum(axis=0) / (weighed.sum(axis=0).max() + EVIDENCE)
