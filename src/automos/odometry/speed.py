"""The sensor's speed along its path, from surfaces facing along it.

In a street canyon, façades and ground align anywhere along the street, and traffic that keeps pace aligns best at zero
motion: registrations of neighbouring scans agree on steps that are too short. Only surfaces facing along the street
(poles, recesses, corners) reveal the true speed (`facing`). The speeds over time with the greatest score and plausible
accelerations are chosen (Viterbi), with priors for the registration's own speed and against driving backwards.

If most observed surfaces are traffic, traffic wins. Its rival is the sequence of speeds under which landmarks alone are
re-observed: what is higher than any vehicle, or farther beside the path than the lanes of the same direction.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.scan import Pose
from automos.odometry.facing import (
    LAGS,
    LANDMARKS,
    SAME_SPEED,
    STEP,
    UNLIKELY,
    ScoredPlaces,
    SpeedScores,
    expected_share,
    is_stationary,
    score_speeds,
)
from automos.odometry.landmarks import Landmarks
from automos.odometry.motion import MIN_STEP
from automos.odometry.window import Window
from automos.settings import OdometrySettings

MIN_STRAIGHTNESS = 0.8
"""Least agreement of steps on a direction in the sensor's frame, 0 to 1."""
AHEAD = 0.1
"""Share of the landmarks re-observed at the rival speed by which it must lead to put the current speed in doubt."""


@dataclass(frozen=True, eq=False)
class SpeedSearch:
    """The speed according to surfaces facing along the path.

    `missing` is zero if no other speed has a clearly higher score than the present one.
    """

    missing: Array  # (N - 1, 3) metres, sensor frame, by which steps are too short
    rival: Array  # (N - 1, 3) the same from landmarks alone
    landmarks: Landmarks  # re-observed with the present poses
    landmarks_at_rival: Landmarks  # re-observed with the rival's steps
    landmarks_else: Landmarks  # re-observed at the speeds that are best apart from the rival's

    @property
    def is_clear(self) -> bool:
        """Whether landmarks favour the present speed, and clearly."""
        is_best = self.landmarks_at_rival.lead_over(self.landmarks) <= 0.0
        return is_best and self.landmarks.explains_more_than(self.landmarks_else)


def search_speed(
    window: Window,
    settings: OdometrySettings,
    pool: ThreadPoolExecutor | None = None,
    scored: ScoredPlaces | None = None,
) -> SpeedSearch:
    """Return by how much steps are too short, and which landmarks are re-observed; for `scored`, see `score_speeds`."""
    steps = window.steps
    nothing = np.zeros((len(steps), 3))
    if len(steps) == 0:
        return SpeedSearch(nothing, nothing, *[Landmarks.nothing()] * 3)
    known = direction_of(steps)
    best, best_gain, found = nothing, 0.0, []
    # A mistaken standstill has no direction: try both horizontal axes of the sensor, usually those of the vehicle.
    for forward in np.eye(3)[:2] if known is None else [known]:
        scores = score_speeds(forward, window, settings, pool, settings.max_reverse, scored)
        growth, gain = _follow_speed(scores, window, settings, known is None)
        if gain > best_gain:
            best, best_gain = growth[:, None] * forward, gain
        by_landmarks = scores.with_priors(scores.by_landmarks)
        found.append(_follow_landmarks(by_landmarks, scores, window, settings, forward))
    rival = max(found, key=lambda search: search.landmarks_at_rival.lead_over(search.landmarks))
    return replace(rival, missing=best)


def rivals_from_rest(
    still: Window,
    direction: Array | None,
    settings: OdometrySettings,
    pool: ThreadPoolExecutor | None,
    scored: ScoredPlaces | None,
) -> Iterator[SpeedSearch]:
    """Yield the rivals of standstill along both horizontal axes, that nearest to `direction` (3,), if any, first.

    Around a wrong speed nothing is expected of the true one: that it is at least as great, or its side.
    """
    axes = np.eye(3)[:2]
    near = np.zeros(2) if direction is None else np.abs(axes @ direction)
    for forward in axes[np.argsort(-near, kind="stable")] if len(still) > 1 else []:
        scores = score_speeds(forward, still, settings, pool, settings.max_speed, scored)
        yield _follow_landmarks(scores.by_landmarks, scores, still, settings, forward)


def speed_figures(searches: list[SpeedSearch]) -> dict[str, float | bool]:
    """Return the certainty of the speed: how many landmarks, which cannot be traffic, are re-observed.

    landmarks_refound, landmarks_expected : re-observed, and the least number expected from nearly the same position.
    refound_at_rival : re-observed at the rival speeds, which are `rival_faster_m_s` higher on average.
    is_speed_doubted : whether too few are re-observed, or clearly more at the rival speeds.
    """
    here = Landmarks.concatenate([search.landmarks for search in searches])
    there = Landmarks.concatenate([search.landmarks_at_rival for search in searches])
    refound, expected, at_rival = here.refound.sum(), here.expected.sum(), there.refound.sum()
    is_rival_ahead = there.explains_more_than(here) and at_rival - refound > AHEAD * at_rival
    return {
        "landmarks_refound": float(refound),
        "landmarks_expected": float(expected),
        "refound_at_rival": float(at_rival),
        "rival_faster_m_s": float(np.mean(there.speeds - here.speeds)) if len(here.speeds) else 0.0,
        "is_speed_doubted": bool(is_rival_ahead or here.are_missed),
    }


def lengthen(T_world_sensor: Pose, missing: Array) -> Pose:
    """Return the poses with `missing` (N - 1, 3) added to each step, in the frame of the scan it starts from.

    Rotations are kept: decomposing and chaining steps repeatedly would accumulate rounding errors in them.
    """
    longer = T_world_sensor.copy()
    longer[1:, :3, 3] += np.cumsum(np.einsum("nij,nj->ni", T_world_sensor[:-1, :3, :3], missing), axis=0)
    return longer


def _follow_speed(
    scores: SpeedScores, window: Window, settings: OdometrySettings, is_guess: bool
) -> tuple[Array, float]:
    """Return the (N - 1,) metres by which steps are too short, and the gain in score.

    A direction that `is_guess` is rejected if the sensor is stationary: then a passing vehicle may look like a speed.
    """
    present, speeds, nearest = scores.present, scores.speeds, scores.nearest
    rows, nothing = np.arange(len(present)), np.zeros(len(window) - 1)
    if is_guess and is_stationary(scores.refound[rows, :, nearest].sum(axis=0), scores.whole.sum(axis=0)):
        return nothing, 0.0
    penalised = scores.with_priors(scores.by_all)
    is_present = np.abs(speeds - present[:, None]) < 1.5 * STEP
    lead = 0.0 if is_guess else UNLIKELY  # no prior for a mistaken standstill
    path = _best_path(penalised + lead * is_present, speeds, scores.times, settings.usual_acceleration)
    gain = penalised[rows, path] - penalised[rows, nearest]
    is_better = gain > UNLIKELY
    if not is_better.any():
        return nothing, 0.0
    is_same = np.abs(speeds[path] - speeds[nearest]) <= SAME_SPEED
    is_right = ~is_better & is_same & (penalised[rows, nearest] > UNLIKELY)
    change = np.where(is_better, speeds[path] - present, 0.0)
    is_known = is_better | is_right  # elsewhere, the error is interpolated
    change = np.interp(scores.times, scores.times[is_known], change[is_known])
    return _growth(scores.times, change, window), float(gain[is_better].sum())


def _follow_landmarks(
    by_landmarks: Array, scores: SpeedScores, window: Window, settings: OdometrySettings, forward: Array
) -> SpeedSearch:
    """Return the speed along `forward` (3,) according to the scores (M, S) of landmarks alone."""
    speeds, nothing = scores.speeds, np.zeros((len(window) - 1, 3))
    path = _best_path(by_landmarks, speeds, scores.times, settings.usual_acceleration)
    is_near = np.abs(speeds - speeds[path, None]) <= 2.0 * SAME_SPEED
    another = _best_path(by_landmarks - is_near, speeds, scores.times, settings.usual_acceleration)
    here, there, elsewhere = (_landmarks_along(scores, at) for at in (scores.nearest, path, another))
    growth = _growth(scores.times, there.speeds - scores.present, window)
    return SpeedSearch(nothing, growth[:, None] * forward, here, there, elsewhere)


def _landmarks_along(scores: SpeedScores, path: npt.NDArray[np.int64]) -> Landmarks:
    """Return the landmarks that are re-observed at nearly the speeds with indices `path` (M,)."""
    reach = int(SAME_SPEED / STEP)
    near = np.clip(path[:, None] + np.arange(-reach, reach + 1), 0, len(scores.speeds) - 1)
    refound = np.take_along_axis(np.einsum("k,mks->ms", LANDMARKS, scores.refound), near, axis=1).max(axis=1)
    share = expected_share(scores.speeds[path, None] * np.array(LAGS)).mean(axis=1)
    return Landmarks(scores.speeds[path], refound, scores.whole @ LANDMARKS * share)


def _growth(times: Array, change: Array, window: Window) -> Array:
    """Return (N - 1,) metres by which steps grow if the sensor is faster by `change` (M,) m/s at `times` (M,)."""
    clock = window.clock
    return np.interp(0.5 * (clock[1:] + clock[:-1]), times, change) * np.diff(clock)


def direction_of(steps: Pose) -> Array | None:
    """Return the usual (3,) direction of motion in the sensor frame; None if there is none."""
    length = np.linalg.norm(steps[:, :3, 3], axis=1)
    if len(length) == 0 or length.max() < MIN_STEP:
        return None
    is_moving = length >= 0.5 * np.percentile(length, 90)
    mean = np.mean(steps[is_moving, :3, 3] / np.maximum(length[is_moving, None], 1e-9), axis=0)
    norm = float(np.linalg.norm(mean))
    return mean / norm if norm > MIN_STRAIGHTNESS else None


def _best_path(scores: Array, speeds: Array, times: Array, usual_acceleration: float) -> npt.NDArray[np.int64]:
    """Return (M,) columns of `scores` (M, S) with the greatest sum, minus the cost of accelerations between them."""
    best, came_from, rows = scores[0].copy(), [], np.arange(len(speeds))
    change = UNLIKELY * ((speeds[:, None] - speeds[None, :]) / usual_acceleration) ** 2  # (to, from)
    for row in range(1, len(scores)):
        total = best - change / (times[row] - times[row - 1]) ** 2
        came_from.append(np.argmax(total, axis=1))
        best = total[rows, came_from[-1]] + scores[row]
    path = [int(np.argmax(best))]
    for source in reversed(came_from):
        path.append(int(source[path[-1]]))
    return np.array(path[::-1])
