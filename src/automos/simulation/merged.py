"""Several LiDARs on one vehicle, kept as one cloud a sweep: what many a driver publishes.

Points of all are given in the first one's frame, each LiDAR's raw: as seen from it at the point's own time, carried
over by how it is mounted. They fire each in its own direction, so a cloud has no seam. Missing returns are left out.
"""

from dataclasses import dataclass, replace

import numpy as np

from automos.core.geometry import transform
from automos.core.scan import Pose
from automos.simulation.recorders.convention import joined, rows_of
from automos.simulation.sensing.returns import Cast
from automos.simulation.sequence import SimulatedSequence


@dataclass(unsafe_hash=True, repr=False)
class MergedSequence(SimulatedSequence):
    """One recording of the first `n_lidars` of `MOUNTS`, all of a kind; labels and poses as for the first one alone."""

    n_lidars: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        self.name = f"{self.name}_{self.n_lidars}_lidars"

    @property
    def _lidars(self) -> list[SimulatedSequence]:
        shared = self.scenario, self.sensor, self.n_scans, self.seed, self.compensated
        return [SimulatedSequence(*shared, replace(self.conditions, mount=k)) for k in range(self.n_lidars)]

    @property
    def T_scan_sensor(self) -> Pose:
        """(K, 4, 4) where each LiDAR sits in the frame of the points."""
        return np.stack([lidar.conditions.T_first_mount for lidar in self._lidars])

    def fingerprint(self) -> str:
        """Return a text that changes when the recording does."""
        return "+".join(lidar.fingerprint() for lidar in self._lidars)

    def _cast_anew(self, index: int) -> Cast:
        T, scans, objects, are_clear = self.T_scan_sensor, [], [], []
        for k, lidar in enumerate(self._lidars):
            cast = lidar._cast(index)
            rows = np.flatnonzero(cast.scan.is_valid)
            scan = rows_of(cast.scan, rows)
            assert scan.ring is not None
            points, ring = transform(T[k], scan.points), scan.ring + np.uint16(k * self.sensor.beams)
            sensor = np.full(len(scan), k, np.uint8)
            scans.append(replace(scan, points=points, ring=ring, sensor=sensor, T_scan_sensor=T))
            objects.append(cast.object[rows])
            are_clear.append(cast.is_clear[rows])
        return Cast(joined(scans), np.concatenate(objects), np.concatenate(are_clear))
