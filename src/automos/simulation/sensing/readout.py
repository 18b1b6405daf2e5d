"""From returns to a scan: which beams are kept as points, in what order, and what each of them is on."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array, inverse
from automos.core.scan import Scan
from automos.simulation.sensing.returns import Returns
from automos.simulation.sensing.scene import EGO, Hits
from automos.simulation.sensing.sensors import Pattern, Sensor


@dataclass(frozen=True, eq=False)
class Cast:
    """A scan and, for each of its points, the object it is on (0 scenery, EGO, AIR) and whether that is known."""

    scan: Scan
    object: npt.NDArray[np.int32]
    is_clear: npt.NDArray[np.bool_]


def read_out(
    sensor: Sensor, pattern: Pattern, hits: Hits, returns: Returns, points: npt.NDArray, stamp: float, name: str
) -> Cast:
    """Return the scan of a sweep's (N, 3) `points`, one per beam, as the sensor gives it away."""
    object_ = np.where(returns.is_return, hits.object, EGO).astype(np.int32)
    straddling = returns.straddles >= 0
    is_clear = returns.is_return & ~(straddling & (hits.object != hits.object[returns.straddles]))
    if sensor.organised:
        points[~returns.is_return] = 0.0
        rows = np.arange(len(points)).reshape(sensor.columns, sensor.beams).T.ravel()
    else:
        rows = np.flatnonzero(returns.is_return)
    scan = Scan(
        np.ascontiguousarray(points[rows], np.float32),
        intensity=np.where(returns.is_return, returns.intensity, 0.0).astype(np.float32)[rows],
        time=((pattern.phase[rows] + 0.5) * sensor.period).astype(np.float32),
        ring=pattern.ring[rows],
        stamp=stamp,
        name=name,
    )
    return Cast(scan, object_[rows], is_clear[rows])


def compensate(points: npt.NDArray, pattern: Pattern, T_site_sensor: Array, T_site_middle: Array) -> npt.NDArray:
    """Return the points as seen from where the sensor is at mid-sweep."""
    T = (inverse(T_site_middle) @ T_site_sensor)[pattern.column]
    return (np.einsum("nij,nj->ni", T[:, :3, :3], points) + T[:, :3, 3]).astype(np.float32)
