"""The unit of a file's coordinates: metres, but for recorders that write centimetres or millimetres.

What a LiDAR sees lies between a step and a few hundred metres around it, some of it near. Ranges of thousands that
begin near the origin are not metres; the unit under which they are those of a LiDAR is taken instead, with a warning.
Coordinates of a map are in metres: they are far away from its origin, all of them, or as dense there as anywhere.
"""

import numpy as np
import numpy.typing as npt

from automos.core.scan import MIN_RANGE

UNITS = {"centimetres": 0.01, "millimetres": 0.001}
"""Metres of what recorders write beside metres."""
FARTHEST = 500.0
"""Metres: where more than one in twenty points is further off, these are not metres."""
USUAL = 50.0
"""Metres within which a LiDAR outdoors sees all but one in twenty of its points."""
NEAREST = 30.0
"""Metres within which every LiDAR sees at least one in twenty."""


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
    found = _ranges(cloud)
    if len(found) < MIN_POINTS:
        return 1.0, []
    near, middle, far = np.percentile(found, [5, 50, 95])
    if far <= FARTHEST:
        return 1.0, []
    name, unit = min(UNITS.items(), key=lambda item: abs(np.log(item[1] * far / USUAL)))
    if unit * far > FARTHEST or unit * near > NEAREST or middle > CROWDED * far:
        return 1.0, []
    return unit, [f"coordinates reach {far:,.0f} from the sensor, which are not metres; they are taken for {name}."]


def _ranges(cloud: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
    few = cloud[:: max(len(cloud) // 2000, 1)]
    ranges = np.linalg.norm(few[np.isfinite(few).all(axis=1)].astype(np.float64), axis=1)
    return ranges[ranges > MIN_RANGE]
