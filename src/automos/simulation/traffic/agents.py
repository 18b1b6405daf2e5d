"""Road users and lights, as a scenario describes them: who follows which path, and the crossroads where paths meet."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.simulation.shapes.things import Thing
from automos.simulation.traffic.paths import Path, connect, through


@dataclass(frozen=True, eq=False)
class Agent:
    """A road user: one or more coupled things on a path.

    Attributes
    ----------
    parts : tuple of Thing
        Things from the front backward.
    path : Path
        The path it follows.
    start : float
        Metres along the path of the first part's origin when it enters.
    speed : float
        M/s it would like to go.
    initial : float, optional
        M/s when it enters; the desired speed where None.
    enter : float
        Seconds after which it exists.
    go : float
        Seconds until which it waits where it is.
    stop : float
        Metres along the path where it stops for good.
    offset : float
        Metres to the left of the path.
    wander : float
        Metres it strays to both sides.
    headway : float
        Seconds to whom it follows.
    on_foot : bool
        Steps aside instead of keeping distance.
    """

    parts: tuple[Thing, ...]
    path: Path
    start: float
    speed: float
    initial: float | None = None
    enter: float = 0.0
    go: float = 0.0
    stop: float = np.inf
    offset: float = 0.0
    wander: float = 0.15
    headway: float = 1.3
    on_foot: bool = False

    @cached_property
    def gaps(self) -> Array:
        """(P,) metres from the first part's origin back to each part's."""
        return np.cumsum([0.0, *(part.gap for part in self.parts[1:])])

    @cached_property
    def front(self) -> float:
        """Metres from the origin to the front bumper."""
        return float(self.parts[0].bounds[1, 0])

    @cached_property
    def rear(self) -> float:
        """Metres from the origin back to the rear bumper of the last part."""
        return float(self.gaps[-1] - self.parts[-1].bounds[0, 0])

    @cached_property
    def width(self) -> float:
        """Metres."""
        return float(max(part.size[1] for part in self.parts))

    @cached_property
    def outline(self) -> Array:
        """(K, 2) points along its middle line where it starts, about a metre apart."""
        margin = 0.5 * self.width
        ends = self.start - self.rear + margin, self.start + self.front - margin
        return self.path.at(np.linspace(*ends, 1 + int(self.front + self.rear)), self.offset)[0]


@dataclass(frozen=True)
class Signal:
    """A stop line at `at` metres along `path`, green while (time + shift) modulo `period` is below `green` seconds."""

    path: Path
    at: float
    period: float
    green: float
    shift: float = 0.0


LANE, STOP = 1.75, 11.0
"""Metres from an arm's middle line to the middle of its lanes, and from the centre of a crossing to its stop lines."""
GREEN = 7.0
"""Seconds of green for one arm."""
CLEAR = 2.5
"""Seconds of red for all after it."""
WALK = 9.0
"""Seconds in which people may cross, once per cycle."""


@dataclass(frozen=True, eq=False)
class Crossing:
    """Where arms meet, about (0, 0); traffic keeps right, each arm has its own green, so that nobody's path is cut.

    Attributes
    ----------
    headings : (A,) float64
        Radians, outward direction of each arm.
    reaches : A floats
        Metres, length of each arm.
    shift : float
        Seconds by which the cycle is ahead at the start.
    """

    headings: npt.NDArray
    reaches: Sequence[float]
    shift: float

    @property
    def period(self) -> float:
        """Seconds per cycle."""
        return len(self.headings) * (GREEN + CLEAR) + WALK + CLEAR

    def arm(self, k: int, offset: float = 0.0, inner: float = 0.0) -> Path:
        """Return the line of arm `k` from `inner` metres off the centre outward, `offset` metres to its left."""
        return through(self._line(k, inner, offset))

    def way(self, i: int, j: int) -> Path:
        """Return the path in by arm `i` and out by arm `j`."""
        (a1, a0), (b0, b1) = self._line(i, STOP, LANE), self._line(j, STOP, -LANE)
        is_right = np.sin(self.headings[j] - self.headings[i]) > 0
        return connect(a0, a1, b0, b1, 5.0 if is_right else 9.0)

    def light(self, i: int, path: Path) -> Signal:
        """Return the light of arm `i` for a `path` that comes in by it."""
        return self._signal(path, self.reaches[i] - STOP, GREEN, i)

    def walk(self, k: int) -> Path:
        """Return the path of people across arm `k`, from 14 m right of it to 14 m left."""
        return through([self._line(k, STOP - 2.5, offset)[0] for offset in (-14.0, 14.0)])

    def walk_light(self, path: Path, kerb: float) -> Signal:
        """Return the light for people on `path` who wait `kerb` metres from its start."""
        return self._signal(path, kerb, WALK - 4.0, len(self.headings))

    def _line(self, k: int, inner: float, offset: float) -> list[Array]:
        """Return both ends, (2,) each, of a line along arm `k`."""
        c, s = np.cos(self.headings[k]), np.sin(self.headings[k])
        return [away * np.array([c, s]) + offset * np.array([-s, c]) for away in (inner, self.reaches[k])]

    def _signal(self, path: Path, at: float, green: float, turn: int) -> Signal:
        """Return a light that turns green after `turn` arms had their green."""
        shift = self.shift - turn * (GREEN + CLEAR)
        return Signal(path, at, self.period, green, shift % self.period)
