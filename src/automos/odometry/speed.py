"""The sensor's speed along its path, from how far things that face along the path have come.

In a street canyon whose traffic keeps pace with the sensor, façades and ground fit anywhere along the street, and the
cars beside fit best where they were: registrations of neighbouring scans agree on steps that are too short, down to
standing still. Only the few surfaces that face along the street (poles, recesses, corners) tell, and they do so sharply
once only they are asked: how much of them finds a surface again, over two baselines at once, as a function of speed,
has its peak where the world stands still. Traffic has no common peak. What is higher than any vehicle cannot be traffic
and counts more. From nearly the same place nearly all is found again, so a speed near standing under which little is
found counts for as much less. The path of speeds over time with the greatest sum and possible accelerations is followed
(Viterbi); the registration's own speed is somewhat ahead, driving backwards somewhat behind.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.geometry import inverse
from automos.odometry.facing import EVIDENCE, expected_share, score_distances, signed_distance, stands, without_body
from automos.odometry.links import Window
from automos.odometry.motion import chain
from automos.odometry.submap import make_submap
from automos.odometry.surfels import Surfels
from automos.scan import Pose
from automos.settings import OdometrySettings

Array = npt.NDArray[np.float64]

OFFSETS = np.arange(-40.0, 40.01, 0.125)
"""m/s by which the sensor might be faster than its poses say."""
SAME_SPEED, OTHER_SPEED = 0.3, 1.5
"""m/s up to which a speed is the present one, and from which it is another."""
NEAR_STEPS = 2
"""Steps of speed that are still the same speed."""
LAGS = (0.3, 0.8)
"""Seconds over which things come by: what moves has no common peak over both."""
EVERY = 0.5
"""Seconds between the places asked."""
STEP = 0.125
"""m/s between speeds tried: 10 cm over the longer baseline."""
OVERHEAD_WEIGHT = 4.0
"""Of what is higher than any vehicle: it cannot be traffic."""
PRIOR = 0.2
"""Of a full score, that the registration's own speed has ahead."""
REVERSE_COST = 0.3
"""Of a full score, that going backwards has behind."""
GAIN = 0.2
"""Share by which another speed must explain more."""
ACCELERATION_COST = 0.3
"""Share that an acceleration of the usual size must explain."""
MIN_RATIO = 0.8
"""Of true speed to first estimate, at least."""
MIN_CLEAR_SPEED = 2.0
"""m/s, slower first estimates may be a mistaken standstill."""
MIN_STEP = 0.1
"""Metres, shorter steps have no direction."""
MIN_STRAIGHTNESS = 0.8
"""How much steps agree on their direction in the sensor's frame, 0 to 1, to have one."""


@dataclass(frozen=True, eq=False)
class SpeedSearch:
    """What the surfaces that face along the path say of the speed.

    Attributes
    ----------
    missing : (N - 1, 3) metres, in the sensor frame, by which steps are shorter than the world says; zero wherever no
        other speed explains clearly more than the present one.
    refound : (K,) how much of them that is higher than any vehicle is found again, were the sensor faster all along by
        `OFFSETS` m/s.
    """

    missing: Array
    refound: Array


def search_speed(window: Window, settings: OdometrySettings, pool: ThreadPoolExecutor | None = None) -> SpeedSearch:
    """Return by how much steps are too short, and how much each other speed would explain."""
    steps = inverse(window.T_world_sensor[:-1]) @ window.T_world_sensor[1:]
    best, best_gain, refound = np.zeros((len(steps), 3)), 0.0, np.zeros(len(OFFSETS))
    if len(steps) == 0:
        return SpeedSearch(best, refound)
    surfels = without_body(window.surfels)
    known = _direction(steps)
    # A registration that wrongly stands still has none: then either axis of the sensor, usually the vehicle's, may do.
    for forward in np.eye(3)[:2] if known is None else [known]:
        scores = _score_speeds(forward, window, surfels, settings, pool)
        refound += scores.refound_overhead()
        growth, gain = _follow_speed(scores, window, settings, is_guess=known is None)
        if gain > best_gain:
            best, best_gain = growth[:, None] * forward, gain
    return SpeedSearch(best, refound)


def rival_speed(refound: Array) -> dict[str, float]:
    """Return how much is found again at the present speed, at the best other one, and by how much that is faster, m/s.

    What is asked is higher than any vehicle, so it cannot be traffic: where another speed explains more of it, the
    poses follow something else than the world.
    """
    is_other = np.abs(OFFSETS) >= OTHER_SPEED
    best = int(np.argmax(np.where(is_other, refound, -1.0)))
    return {
        "refound_overhead": float(refound[np.abs(OFFSETS) <= SAME_SPEED].max()),
        "refound_at_rival": float(refound[best]),
        "rival_faster_m_s": float(OFFSETS[best]),
    }


def lengthen(T_world_sensor: Pose, missing: Array) -> Pose:
    """Return the poses with `missing` (N - 1, 3) added to each step, in the frame of the scan it starts from."""
    steps = inverse(T_world_sensor[:-1]) @ T_world_sensor[1:]
    steps[:, :3, 3] += missing
    return chain(T_world_sensor[0], steps)


@dataclass(frozen=True, eq=False)
class _Scores:
    """How much is found again at each of M places under each of S speeds.

    speeds : (S,) m/s.  times : (M,) seconds.  present : (M,) m/s, as the poses are.
    believed : (M, S) share of what can be found, as far as it is to be believed.
    refound : (M, 2, S) weights of the surfaces found again, low and overhead.  whole : (M, 2) of all there are.
    """

    speeds: Array
    times: Array
    present: Array
    believed: Array
    refound: Array
    whole: Array

    @property
    def nearest(self) -> npt.NDArray[np.int64]:
        """(M,) the speed tried that is nearest to the present one."""
        at = np.round((self.present - self.speeds[0]) / STEP).astype(int)
        return np.clip(at, 0, len(self.speeds) - 1)

    def refound_overhead(self) -> Array:
        """Return (K,) how much overhead is found again were the sensor faster by `OFFSETS`."""
        places = zip(self.present, self.refound[:, 1], strict=True)
        return sum((np.interp(now + OFFSETS, self.speeds, high, left=0.0, right=0.0) for now, high in places),
                   np.zeros(len(OFFSETS)))  # fmt: skip


def _score_speeds(
    forward: Array, window: Window, surfels: list[Surfels], settings: OdometrySettings, pool: ThreadPoolExecutor | None
) -> _Scores:
    """Return how much is found again along `forward` (3,) at every speed."""
    T, period = window.T_world_sensor, window.period
    lags = sorted({min(max(round(lag / period), 1), len(window) - 1) for lag in LAGS})
    starts = np.arange(0, len(window) - max(lags), max(round(EVERY / period), 1))
    clock = np.concatenate([[0.0], np.cumsum(window.gaps)]) * period
    speeds = np.arange(-settings.max_reverse, settings.max_speed, STEP)
    weights = np.array([1.0, OVERHEAD_WEIGHT])

    def score(start: int) -> tuple[Array, Array, Array]:
        submap = make_submap([surfels[start]], np.eye(4)[None])
        whole = score_distances(submap, surfels[start], np.eye(4), forward, np.zeros(1), 0.0, settings.overhead)[:, 0]
        refound, believed = np.zeros((2, len(speeds))), np.zeros(len(speeds))
        for end in start + np.array(lags):
            T_start_end = inverse(T[start]) @ T[end]
            seconds = clock[end] - clock[start]
            per_sweep = window.share * period / seconds
            distances = speeds * seconds
            found = score_distances(submap, surfels[end], T_start_end, forward, distances, per_sweep, settings.overhead)
            weighed, expected = weights @ found, weights @ whole * expected_share(distances)
            believed += weighed * np.minimum(weighed / np.maximum(expected, 1e-9), 1.0)
            refound += found
        return believed / ((weights @ refound).max() + EVIDENCE), refound / len(lags), whole

    todo = starts.tolist()
    believed, refound, whole = zip(*(map(score, todo) if pool is None else pool.map(score, todo)), strict=True)
    ends = starts + max(lags)
    present = signed_distance(inverse(T[starts]) @ T[ends], forward)[0] / (clock[ends] - clock[starts])
    times = np.interp(starts + np.mean(lags), np.arange(len(clock)), clock)
    return _Scores(speeds, times, present, np.array(believed), np.array(refound), np.array(whole))


def _follow_speed(scores: _Scores, window: Window, settings: OdometrySettings, is_guess: bool) -> tuple[Array, float]:
    """Return the (N - 1,) metres by which steps are too short, and how much more these explain.

    A direction that `is_guess` must not be found by those who pass a vehicle that stands: little may be where it was.
    """
    present, speeds, nearest = scores.present, scores.speeds, scores.nearest
    rows, nothing = np.arange(len(present)), np.zeros(len(window) - 1)
    if is_guess and stands(scores.refound[rows, :, nearest].mean(axis=0), scores.whole.mean(axis=0)):
        return nothing, 0.0
    believed = scores.believed.copy()
    # What pulls registrations off pulls them towards standing still, so a clear motion is never too fast by much.
    is_slower = speeds * np.sign(present)[:, None] < MIN_RATIO * np.abs(present)[:, None]
    believed[is_slower & (np.abs(present) > MIN_CLEAR_SPEED)[:, None]] -= 1.0
    believed[:, speeds < -STEP] -= REVERSE_COST
    is_present = np.abs(speeds - present[:, None]) < 1.5 * STEP
    lead = 0.0 if is_guess else PRIOR  # a mistaken standstill has nothing ahead
    path = _best_path(believed + lead * is_present, speeds, scores.times, settings.usual_acceleration)
    gain = believed[rows, path] - believed[rows, nearest]
    is_better = gain > GAIN
    if not is_better.any():
        return nothing, 0.0
    is_right = ~is_better & (np.abs(path - nearest) <= NEAR_STEPS) & (believed[rows, nearest] > GAIN)
    change = np.where(is_better, speeds[path] - present, 0.0)
    is_known = is_better | is_right  # where nothing tells, the error is taken to be that of the places around
    change = np.interp(scores.times, scores.times[is_known], change[is_known])
    clock = np.concatenate([[0.0], np.cumsum(window.gaps)]) * window.period
    growth = np.interp(0.5 * (clock[1:] + clock[:-1]), scores.times, change) * np.diff(clock)
    return growth, float(gain[is_better].sum())


def _direction(steps: Pose) -> Array | None:
    """Return the (3,) direction, in the sensor frame, in which the sensor usually moves; None where it has none."""
    length = np.linalg.norm(steps[:, :3, 3], axis=1)
    if len(length) == 0 or length.max() < MIN_STEP:
        return None
    is_moving = length >= 0.5 * np.percentile(length, 90)
    mean = np.mean(steps[is_moving, :3, 3] / np.maximum(length[is_moving, None], 1e-9), axis=0)
    norm = float(np.linalg.norm(mean))
    return mean / norm if norm > MIN_STRAIGHTNESS else None


def _best_path(scores: Array, speeds: Array, times: Array, usual_acceleration: float) -> npt.NDArray[np.int64]:
    """Return (M,) columns of `scores` (M, S) with the greatest sum, less the cost of the accelerations between them."""
    best = scores[0].copy()
    came_from = []
    for row in range(1, len(scores)):
        seconds = times[row] - times[row - 1]
        acceleration = (speeds[:, None] - speeds[None, :]) / seconds  # (to, from)
        cost = ACCELERATION_COST * (acceleration / usual_acceleration) ** 2
        total = best[None, :] - cost
        came_from.append(np.argmax(total, axis=1))
        best = total.max(axis=1) + scores[row]
    path = [int(np.argmax(best))]
    for source in reversed(came_from):
        path.append(int(source[path[-1]]))
    return np.array(path[::-1])
