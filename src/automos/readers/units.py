"""The unit of a file's coordinates: metres, but for recorders that write centimetres or millimetres.

What a LiDAR sees lies between a step and a few hundred metres around it, some of it near. Ranges of thousands that
begin near the origin are not metres; the unit under which they are those of a LiDAR is taken instead, with a warning.
Coordinates of a map are in metres: they are far away from its origin, all of them, or as dense there as anywhere.

Ranges and angles are no coordinates. A sensor that turns measures as often in each direction, while coordinates are
densest where it is: numbers of which one goes evenly through a whole turn are range, azimuth and elevation, or angle
from above, in some order. So are others that have this property of ranges about as much, if read so, as they stand, or
of a narrower view clearly more: what is seen in nearly one direction is mostly one thing.
"""

from itertools import permutations, product

import numpy as np
import numpy.typing as npt

from automos.core.scan import MIN_RANGE, Array, Ints

UNITS = {"centimetres": 0.01, "millimetres": 0.001}
"""Metres of what recorders write beside metres."""
FARTHEST = 500.0
"""Metres: where more than one in twenty points is further off, these are not metres."""
USUAL = 50.0
"""Metres within which a LiDAR outdoors sees all but one in twenty of its points."""
NEAREST = 30.0
"""Metres within which every LiDAR sees at least one in twenty."""
_ASKED, _AMONG = 2000, 20_000
"""Points whose range is compared, with one among so many."""
_EVEN, _SECTORS = 0.97, 36
"""Share of the entropy that directions may have, counted in so many, from which all are alike: of sensors outdoors they
have 0.985 and more, and coordinates 0.94 at most."""
_NEARLY = 0.05
"""Share of a turn by which measured azimuths may miss it or go beyond."""
_AS_SMOOTH = 2.0
"""Times the spread of ranges in one direction: angles have at most 1.8 times of what they have read as coordinates, and
coordinates at least 2.5 times of it read as angles."""
_CLEARLY = 1.8
"""Times as much as where they are read as angles, of those of a narrow view; in a small room, coordinates have 1.2."""
CROWDED = 0.6
"""Of the range that all but one in twenty points are within, where a sensor has half of them: it sees most nearby."""
MIN_POINTS = 100
"""Number of points from which ranges determine the unit."""


def unit_of(cloud: npt.NDArray[np.floating]) -> tuple[float, list[str]]:
    """Return metres per unit of the coordinates of a scan, `cloud` (N, 3), and what to say of it.

    Examples
    --------
    >>> unit_of(100.0 * np.random.default_rng(0).normal(0.0, 15.0, (1000, 3)))[0]
    0.01
    """
    few = cloud[:: max(len(cloud) // 2000, 1)]
    ranges = np.linalg.norm(few[np.isfinite(few).all(axis=1)].astype(np.float64), axis=1)
    ranges = ranges[ranges > MIN_RANGE]
    if len(ranges) < MIN_POINTS:
        return 1.0, []
    near, middle, far = np.percentile(ranges, [5, 50, 95])
    if far <= FARTHEST:
        return 1.0, []
    name, unit = min(UNITS.items(), key=lambda item: abs(np.log(item[1] * far / USUAL)))
    if unit * far > FARTHEST or unit * near > NEAREST or middle > CROWDED * far:
        return 1.0, []
    return unit, [f"coordinates reach {far:,.0f} from the sensor, which are not metres; they are taken for {name}."]


def are_angles(cloud: npt.NDArray[np.floating], turns: bool = False) -> bool:
    """Return whether the columns of a scan, `cloud` (N, 3), are a range and two angles, if `turns`, of a whole turn."""
    known = cloud[np.isfinite(cloud).all(axis=1) & cloud.any(axis=1)].astype(np.float64)
    known = known[np.random.default_rng(0).permutation(len(known))[:_AMONG]]
    spread: float | None = None
    for order, turn, from_above in product(permutations(range(3)), (np.pi, 180.0), (False, True)):
        away, around, up = known[:, order].T
        width = np.ptp(around) / (2.0 * turn) if len(known) >= MIN_POINTS else np.inf
        is_narrow = width < 1.0 - _NEARLY
        is_far = np.abs(around).max(initial=0.0) > 2.0 * turn  # as places on a map are
        if width > 1.0 + _NEARLY or (is_narrow and (turns or is_far or 2 * len(known) < _ASKED)):
            continue
        up = 0.5 * turn - up if from_above else up
        is_steep = abs(np.median(up)) > 0.25 * turn
        if away.min() < 0.0 or not away.any() or np.abs(up).max() > 0.5 * turn or (from_above and is_steep):
            continue
        if not is_narrow and entropy(np.histogram(around, _SECTORS)[0]) > _EVEN * np.log2(_SECTORS):
            return True
        around, up = around * np.pi / turn, up * np.pi / turn
        level = away * np.cos(up)
        polar = np.column_stack([level * np.cos(around), level * np.sin(around), away * np.sin(up)])
        spread = _spread_of_ranges(known) if spread is None else spread
        if _spread_of_ranges(polar) < (1.0 / _CLEARLY if is_narrow else _AS_SMOOTH) * spread:
            return True
    return False


def entropy(count: Ints) -> float:
    """Return the entropy, bits, of what was counted (K,) times in each of K classes."""
    share = count[count > 0] / count.sum()
    return float(-np.sum(share * np.log2(share)))


def _spread_of_ranges(cloud: Array) -> float:
    """Return by what share, on the mean, the range of one of (N, 3) points differs from that in the next direction."""
    from scipy.spatial import KDTree

    away = np.linalg.norm(cloud, axis=1)
    rays, away = cloud[away > 0.0] / away[away > 0.0, None], np.log(away[away > 0.0])
    beside = KDTree(rays).query(rays[:_ASKED], k=2)[1][:, 1]
    return float(np.minimum(np.abs(away[:_ASKED] - away[beside]), 0.5).mean())
