"""Road users, as a scenario describes them: what they are, which path they follow, how they would like to go."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from automos.core.geometry import Array
from automos.simulation.shapes.things import Thing
from automos.simulation.traffic.paths import Path


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
    gaps : tuple of float
        Metres behind the first part's origin of each part's origin.
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
    gaps: tuple[float, ...] = (0.0,)
    headway: float = 1.3
    on_foot: bool = False

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
