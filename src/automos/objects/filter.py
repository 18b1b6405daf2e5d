"""Extended Kalman filters for many boxes at once, with constant velocity (paper III-D).

State (10): x, y, z, yaw, length, width, height, vx, vy, vz. Measurement (7): the box. Motion and measurement are
linear except for the yaw, which is wrapped: a box rotated by 180 degrees is the same box, and one rotated by 90 degrees
is the same with length and width swapped. So a measurement is converted to the equivalent box with the nearest yaw
before the innovation is computed. The noise is AB3DMOT's (Weng et al., IROS 2020), in metres and seconds, not frames.
"""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from automos.core.column_data import ColumnData
from automos.core.geometry import Array, wrap_angle
from automos.core.upright_boxes import Boxes
from automos.settings import FilterSettings

YAW, SIZE, VELOCITY = 3, slice(4, 7), slice(7, 10)
N_MEASURED, N_STATE = SIZE.stop, VELOCITY.stop


@dataclass(frozen=True, eq=False)
class Beliefs(ColumnData):
    """Gaussian beliefs about K boxes: mean (K, 10), covariance (K, 10, 10); subclasses add columns."""

    mean: Array
    covariance: Array

    def boxes(self) -> Boxes:
        """Return the expected boxes."""
        size = np.maximum(self.mean[:, SIZE], 1e-3)
        return Boxes(self.mean[:, :3], size, self.mean[:, YAW], np.ones(len(self)))


Some = TypeVar("Some", bound=Beliefs)


def start(boxes: Boxes, settings: FilterSettings, velocity_variance: npt.ArrayLike) -> Beliefs:
    """Return beliefs for new boxes (K): at their measured place, with an unknown velocity around zero.

    velocity_variance : (K,) or one for all, (m/s)^2.
    """
    mean = np.hstack([_measurements(boxes), np.zeros((len(boxes), 3))])
    variance = np.full((len(boxes), N_STATE), settings.initial_variance)
    variance[:, VELOCITY] = np.reshape(velocity_variance, (-1, 1))
    return Beliefs(mean, variance[:, :, None] * np.eye(N_STATE))


def predict(beliefs: Some, dt: float, settings: FilterSettings) -> Some:
    """Return `beliefs` `dt` seconds later."""
    F = np.eye(N_STATE)
    F[:3, VELOCITY] = dt * np.eye(3)
    noise = np.r_[np.full(N_MEASURED, settings.process_variance), np.full(3, settings.process_velocity_variance)]
    # Noise rates are per second, so two short steps are as uncertain as one long step.
    Q = np.diag(noise * dt)
    return replace(beliefs, mean=beliefs.mean @ F.T, covariance=F @ beliefs.covariance @ F.T + Q)


def update(beliefs: Some, boxes: Boxes, settings: FilterSettings) -> Some:
    """Return `beliefs` (K) updated with the measured `boxes` (K), row by row."""
    P, R = beliefs.covariance, settings.measurement_variance * np.eye(N_MEASURED)
    S = P[:, :N_MEASURED, :N_MEASURED] + R
    gain = np.swapaxes(np.linalg.solve(S, P[:, :N_MEASURED, :]), -1, -2)  # (K, 10, 7), both symmetric
    innovation = same_box_nearest(_measurements(boxes), beliefs.mean[:, YAW]) - beliefs.mean[:, :N_MEASURED]
    mean = beliefs.mean + np.einsum("kij,kj->ki", gain, innovation)
    mean[:, YAW] = wrap_angle(mean[:, YAW])
    left = np.eye(N_STATE) - np.concatenate([gain, np.zeros((len(P), N_STATE, 3))], axis=2)
    # Joseph's form stays symmetric and positive definite over thousands of updates.
    covariance = left @ P @ np.swapaxes(left, -1, -2) + gain @ R @ np.swapaxes(gain, -1, -2)
    return replace(beliefs, mean=mean, covariance=covariance)


def _measurements(boxes: Boxes) -> Array:
    return np.column_stack([boxes.center, boxes.yaw, boxes.size])


def same_box_nearest(measured: Array, yaw: Array) -> Array:
    """Return `measured` (K, 7), each as the equivalent box whose heading is nearest to `yaw` (K,).

    The result's heading is within 45 degrees of `yaw` and not wrapped, so that it can be subtracted.
    """
    out = measured.copy()
    quarters = np.round((yaw - measured[:, YAW]) / (0.5 * np.pi))
    out[:, YAW] += quarters * 0.5 * np.pi
    is_swapped = quarters.astype(np.int64) % 2 == 1
    out[is_swapped, 4], out[is_swapped, 5] = measured[is_swapped, 5], measured[is_swapped, 4]
    return out
