"""The situations a labeler must master; each module builds a world from a random generator and a duration."""

from functools import lru_cache

import numpy as np

from automos.simulation.scenarios.country import country, hills, motorway, slowdown
from automos.simulation.scenarios.crowded import campus, narrow, scooters
from automos.simulation.scenarios.junction import junction, kerbside, lights, outing, waiting
from automos.simulation.scenarios.streets import avenue, canyon, city
from automos.simulation.world import World

_SHORT = (city, motorway, slowdown, junction, campus, scooters, hills, narrow, canyon, avenue, waiting, country)
_LONG = (lights, kerbside, outing)
LONG = tuple(build.__name__ for build in _LONG)
"""Those whose worlds are made for half a minute and longer: they are about objects, not points."""
SCENARIOS = {build.__name__: build for build in (*_SHORT, *_LONG)}
"""Builders by name: (random generator, seconds) to world."""

DURATION_STEP = 10.0
"""Seconds to which durations are rounded up, so that short and long runs of a seed begin alike."""


@lru_cache(maxsize=2)
def build_world(scenario: str, seed: int, duration: float) -> World:
    """Return the world of a scenario, long enough for `duration` seconds; remembered per process."""
    seconds = DURATION_STEP * np.ceil(max(duration, 0.1) / DURATION_STEP)
    rng = np.random.default_rng([seed, sum(map(ord, scenario))])
    return SCENARIOS[scenario](rng, float(seconds))
