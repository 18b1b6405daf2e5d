"""The share of surfaces facing along the path that are re-observed, for each distance travelled and for each speed.

For a speed, two baselines are used at once: static surfaces are re-observed at the sensor's speed over both, traffic at
another speed has no common peak. From nearly the same position, nearly everything is re-observed, so a low speed under
which little is re-observed is weighted down accordingly.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

from automos.core.cells import moved
from automos.core.covariances import total_variance, variance_along
from automos.core.geometry import Array, inverse
from automos.core.kernels import kernel
from automos.core.scan import Pose
from automos.core.voxels import find_slot
from automos.odometry.isolated import CLOSE, count_met_again, isolated_points
from automos.odometry.motion import signed_distance
from automos.odometry.submap import CLOSE as SURFACE
from automos.odometry.submap import Submap, make_submap, voxel_of
from automos.odometry.surfels import Surfels
from automos.odometry.window import Window
from automos.settings import OdometrySettings

LEAST_CONSTRAINT = 0.1
"""Squared cosine between a surface's normal and the path from which the surface constrains the position along it."""
EVIDENCE = 5.0
"""Re-observed surfels that count for half of full certainty."""
STANDSTILL_SHARE = 0.1
"""Least share of the surfaces facing along the path that a stationary sensor re-observes."""
NEAR_SHARE = 0.5
"""Share of the surfaces facing along the path that are re-observed from nearly the same position."""
NEAR_VIEW = 1.5
"""Metres over which this share decreases to a third."""

BESIDE = 12.0
"""Metres from the path, beyond all lanes of the sensor's own direction: nothing there keeps pace with the sensor."""
LAGS = (0.3, 0.8)
"""Seconds, baselines: moving objects have no common peak over both."""
STEP = SURFACE / max(LAGS)
"""m/s between speeds tried: what surfaces may be off over the longer baseline."""
ALL = np.array([True, True, True])
"""Low surfaces, those far beside, and those higher than any vehicle."""
LANDMARKS = np.array([False, True, True])
"""Which of these are landmarks, which cannot be traffic."""
SAME_SPEED = 1.0
"""Metres per second within which two speeds count as the same."""
MIN_RATIO = 0.8
"""Least ratio of the true speed to the initial estimate."""
UNLIKELY = 0.2
"""Share of a full score: the penalty of driving backwards, and of an acceleration of the usual size, and by how much
the score of another speed than the registration's own must be higher."""


def score_distances(
    submap: Submap,
    surfels: Surfels,
    T_submap_surfels: Pose,
    forward: Array,
    distances: Array,
    per_sweep: float,
    overhead: float,
) -> Array:
    """Return how much surface facing along the path is re-observed if the sensor has travelled `distances` (D,) metres.

    Returns (3, D): surfaces that may be vehicles keeping pace, surfaces too far beside the path for that, and surfaces
    higher than any vehicle, `overhead` metres above the sensor. The surfels are compensated for each distance:
    `per_sweep` is the share of it that is travelled during a sweep.
    """
    present, direction = signed_distance(T_submap_surfels, forward)
    T = np.array(T_submap_surfels, np.float64)  # at no distance along the path
    T[:3, 3] -= present * direction
    shift = per_sweep * (distances - present)
    # How much each voxel constrains the position along the path, and the path in the surfels' frame.
    constrains = np.where(submap.variance < 0.0, 0.0, (submap.axes @ direction) ** 2).sum(axis=1)
    along = T[:3, :3].T @ direction
    points = (surfels.mean, surfels.covariance, surfels.time)
    return _score(submap, constrains, points, T, (direction, along), distances, shift, overhead)


def facing_surfaces(surfels: Surfels, forward: Array, overhead: float) -> tuple[Submap, Array]:
    """Return one scan as a submap, and the (3,) weights of all its surfaces facing along the path."""
    submap = make_submap([surfels], np.eye(4)[None])
    return submap, score_distances(submap, surfels, np.eye(4), forward, np.zeros(1), 0.0, overhead)[:, 0]


def is_stationary(refound: Array, whole: Array) -> bool:
    """Return whether as much of `whole` (3,) is re-observed in place as by a stationary sensor.

    Overhead surfaces decide if there are any; nearly all lower ones may be traffic.
    """
    if whole[2] > EVIDENCE:
        return bool(refound[2] > STANDSTILL_SHARE * whole[2])
    return bool(refound.sum() > STANDSTILL_SHARE * whole.sum())


def expected_share(distances: Array) -> Array:
    """Return the least share (D,) of the surfaces facing along the path that is re-observed after `distances` (D,)."""
    return NEAR_SHARE * np.exp(-np.abs(distances) / NEAR_VIEW)


def weighed_down(scores: Array, whole: float, distances: Array) -> Array:
    """Return `scores`, less where less of `whole` is re-observed than expected after `distances`, all (..., D)."""
    return scores * np.minimum(scores / np.maximum(whole * expected_share(distances), 1e-9), 1.0)


PlaceScores = tuple[Array, Array, Array, Array]
"""What is re-observed from one scan on: rows of `by_all`, `by_landmarks`, `refound` and `whole` of `SpeedScores`."""
ScoredPlaces = dict[tuple[int, ...], dict[int, PlaceScores]]
"""These by the number of the scan, for each range of speeds, longest baseline and side of the sensor."""


@dataclass(frozen=True, eq=False)
class SpeedScores:
    """Re-observed surfaces at each of M places under each of S speeds."""

    speeds: Array  # (S,) m/s
    times: Array  # (M,) seconds
    present: Array  # (M,) m/s, speed of the present poses
    by_all: Array  # (M, S) scores: weighted share of the surfaces that are re-observed
    by_landmarks: Array  # (M, S) the same of landmarks alone
    refound: Array  # (M, 3, S) weights of the re-observed surfaces, see `score_distances`
    whole: Array  # (M, 3) weights of all surfaces

    @property
    def nearest(self) -> npt.NDArray[np.int64]:
        """(M,) index of the tried speed nearest to the present one."""
        at = np.round((self.present - self.speeds[0]) / STEP).astype(int)
        return np.clip(at, 0, len(self.speeds) - 1)

    def with_priors(self, scores: Array) -> Array:
        """Return `scores` (M, S) minus the penalties of unlikely speeds."""
        present = self.present[:, None]
        # Registrations are biased towards standstill, so a clear motion is never much too fast.
        is_slower = self.speeds * np.sign(present) < MIN_RATIO * np.abs(present)
        return scores - UNLIKELY * (self.speeds < -STEP) - (is_slower & (np.abs(present) > SAME_SPEED))


def score_speeds(
    forward: Array,
    window: Window,
    settings: OdometrySettings,
    pool: ThreadPoolExecutor | None,
    max_reverse: float,
    scored: ScoredPlaces | None = None,
) -> SpeedScores:
    """Return how much is re-observed along `forward` (3,) at every speed, backwards up to `max_reverse` (m/s).

    Places that were `scored` in earlier windows of the same path are not scored again; it has those of this one then.
    """
    T, surfels, period = window.T_world_sensor, window.surfels, window.period
    lags = sorted({min(max(round(lag / period), 1), len(window) - 1) for lag in LAGS})
    every, n_places = max(max(lags) // 2, 1), len(window) - max(lags)
    # At the same scans as in earlier windows.
    starts = np.arange(0 if scored is None or n_places < every else -window.first % every, n_places, every)
    clock = window.clock
    speeds = np.arange(-max_reverse, settings.max_speed, STEP)
    alone = cache(lambda i: isolated_points(surfels[i], forward, settings.overhead, BESIDE))

    def score(number: int) -> PlaceScores:
        start = number - window.first
        submap, whole = facing_surfaces(surfels[start], forward, settings.overhead)
        ends = [start + lag for lag in lags]
        seconds = clock[ends] - clock[start]
        steps = inverse(T[start]) @ T[ends]
        metres = signed_distance(steps, forward)[0]
        # A braking sensor has a different mean speed over each lag: a hypothesis changes the speed equally over all.
        distances = metres[:, None] + (speeds - metres[-1] / seconds[-1]) * seconds[:, None]
        found = np.zeros((len(lags), 3, len(speeds)))
        for k, (end, step, share) in enumerate(zip(ends, steps, window.share * period / seconds, strict=True)):
            found[k] = score_distances(submap, surfels[end], step, forward, distances[k], share, settings.overhead)
            found[k, 1] += count_met_again(alone(start), alone(end), step, forward, distances[k], share)
        by_all, by_landmarks = (_weighted_share(weights, found, whole, distances) for weights in (ALL, LANDMARKS))
        return by_all, by_landmarks, found.mean(axis=0), whole

    kind = (len(speeds), max(lags), *np.round(forward).astype(int).tolist())
    known = {} if scored is None else scored.get(kind, {})
    numbers = (window.first + starts).tolist()
    new = [number for number in numbers if number not in known]
    known |= zip(new, map(score, new) if pool is None else pool.map(score, new), strict=True)
    places = {number: known[number] for number in numbers}
    if scored is not None:
        scored[kind] = places
    ends = starts + max(lags)
    present = signed_distance(inverse(T[starts]) @ T[ends], forward)[0] / (clock[ends] - clock[starts])
    times = np.interp(starts + np.mean(lags), np.arange(len(clock)), clock)
    return SpeedScores(speeds, times, present, *(np.array(part) for part in zip(*places.values(), strict=True)))


def _weighted_share(weights: Array, found: Array, whole: Array, distances: Array) -> Array:
    """Return (S,) the score of each speed: the share of `whole` (3,) `found` (L, 3, S) after `distances` (L, S)."""
    weighed = np.einsum("k,lks->ls", weights, found)
    share = weighed_down(weighed, float(weights @ whole), distances).sum(axis=0)
    return share / (weighed.sum(axis=0).max() + EVIDENCE)


@kernel
def _score(submap, constrains, surfels, T, path, distances, shift, overhead):  # type: ignore[no-untyped-def]
    """Return what `score_distances` does; `shift` : (D,) metres of motion during a sweep to compensate."""
    keys, rows, mean, axes, variance = submap
    points, covariance, times = surfels
    direction, along = path
    scores = np.zeros((3, len(distances)))
    for i in range(len(points)):
        c = covariance[i]
        if variance_along(c, along) > 0.2 * total_variance(c):  # surface parallel to the path
            continue
        x0, y0, z0 = moved(T, float(points[i, 0]), float(points[i, 1]), float(points[i, 2]))
        beside = abs(along[0] * points[i, 1] - along[1] * points[i, 0])
        where = 2 if points[i, 2] > overhead else int(beside > BESIDE)
        last, row = np.int64(-1), -1  # voxel, and its row if it constrains: neighbouring distances share it
        for d in range(len(distances)):
            e = distances[d] + times[i] * shift[d]
            x, y, z = x0 + e * direction[0], y0 + e * direction[1], z0 + e * direction[2]
            key = voxel_of(x, y, z)
            if key != last:
                slot = find_slot(keys, key)
                last, row = key, -1 if keys[slot] == -1 or constrains[rows[slot]] <= LEAST_CONSTRAINT else rows[slot]
            if row < 0:
                continue
            worst = 0.0
            for k in range(2):
                if variance[row, k] < 0.0:
                    break
                off = axes[row, k, 0] * (x - mean[row, 0]) + axes[row, k, 1] * (y - mean[row, 1])
                worst = max(worst, abs(off + axes[row, k, 2] * (z - mean[row, 2])))
            if worst < CLOSE:
                scores[where, d] += constrains[row]
    return scores
