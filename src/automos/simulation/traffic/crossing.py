"""A signalled crossroads: the paths through it, one light per arm, a phase in which people walk."""

from dataclasses import dataclass

import numpy as np

from automos.core.geometry import Array
from automos.simulation.traffic.agents import Signal
from automos.simulation.traffic.paths import Path, connect, through

GREEN = 7.0
"""Seconds of green for one arm."""
CLEAR = 2.5
"""Seconds of red for all after it."""
WALK = 9.0
"""Seconds in which people may cross, once per cycle."""


@dataclass(frozen=True, eq=False)
class Crossing:
    """A place where arms meet; traffic keeps to the right, each arm has its own green, so that nobody's path is cut.

    Attributes
    ----------
    center : (2,) float64
        Metres.
    headings : (A,) float
        Radians, outward direction of each arm.
    reaches : (A,) float
        Metres, length of each arm.
    lane : float
        Metres from an arm's middle line to the middle of its lanes.
    stop : float
        Metres from the centre to the stop lines.
    shift : float
        Seconds by which the cycle is ahead at the start.
    """

    center: Array
    headings: tuple[float, ...]
    reaches: tuple[float, ...]
    lane: float = 1.75
    stop: float = 11.0
    shift: float = 0.0

    @property
    def period(self) -> float:
        """Seconds per cycle."""
        return len(self.headings) * (GREEN + CLEAR) + WALK + CLEAR

    def arm(self, k: int, offset: float = 0.0, inner: float = 0.0) -> Path:
        """Return the line of arm `k` from `inner` metres off the centre outward, `offset` metres to its left."""
        out, left = self._axes(k)
        start = self.center + inner * out + offset * left
        return through([start, self.center + self.reaches[k] * out + offset * left])

    def way(self, i: int, j: int) -> Path:
        """Return the path in by arm `i` and out by arm `j`."""
        (out_i, left_i), (out_j, left_j) = self._axes(i), self._axes(j)
        a0 = self.center + self.reaches[i] * out_i + self.lane * left_i
        b1 = self.center + self.reaches[j] * out_j - self.lane * left_j
        a1 = self.center + self.stop * out_i + self.lane * left_i
        b0 = self.center + self.stop * out_j - self.lane * left_j
        is_right = np.sin(self.headings[j] - self.headings[i]) > 0
        return connect(a0, a1, b0, b1, 5.0 if is_right else 9.0)

    def light(self, i: int, path: Path) -> Signal:
        """Return the light of arm `i` for a `path` that comes in by it."""
        shift = self.shift - i * (GREEN + CLEAR)
        return Signal(path, self.reaches[i] - self.stop, self.period, GREEN, shift % self.period)

    def walk(self, k: int) -> Path:
        """Return the path of people across arm `k`, from 14 m right of it to 14 m left."""
        out, left = self._axes(k)
        middle = self.center + (self.stop - 2.5) * out
        return through([middle - 14.0 * left, middle + 14.0 * left])

    def walk_light(self, path: Path, kerb: float) -> Signal:
        """Return the light for people on `path` who wait `kerb` metres from its start."""
        shift = self.shift - len(self.headings) * (GREEN + CLEAR)
        return Signal(path, kerb, self.period, WALK - 4.0, shift % self.period)

    def _axes(self, k: int) -> tuple[Array, Array]:
        c, s = np.cos(self.headings[k]), np.sin(self.headings[k])
        return np.array([c, s]), np.array([-s, c])
