"""Several LiDARs on one vehicle, kept as one cloud a sweep: what many a driver publishes.

Points of all are given in the first one's frame, each LiDAR's raw: as seen from it at the point's own time, carried
over by how it is mounted. They fire each in its own direction, so a cloud has no seam. Missing returns are left out.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from automos.core.geometry import transform
from automos.core.scan import Pose, Scan, Sequence
from automos.simulation.sensing.sensors import Sensor
from automos.simulation.sequence import SimulatedSequence


class MergedSequence(Sequence):
    """One recording of the first `n_lidars` of `MOUNTS`; labels and poses as for one LiDAR."""

    def __init__(self, first: SimulatedSequence, n_lidars: int):
        self._lidars = tuple(
            SimulatedSequence(
                first.scenario,
                first.sensor,
                len(first),
                first.seed,
                bool(first.is_compensated),
                replace(first.conditions, mount=k),
            )
            for k in range(n_lidars)
        )
        self.name = f"{first.name}_{n_lidars}_lidars"

    def __len__(self) -> int:
        return len(self._lidars[0])

    def __getitem__(self, index: int) -> Scan:
        scans = [lidar[index] for lidar in self._lidars]
        rows = [scan.is_valid for scan in scans]

        def together(columns: Iterable[npt.NDArray | None]) -> npt.NDArray:
            return np.concatenate([c[kept] for c, kept in zip(columns, rows, strict=True) if c is not None])

        beams = self.sensor.beams
        return replace(
            scans[0],
            points=together(transform(T, s.points) for s, T in zip(scans, self.T_scan_sensor, strict=True)),
            intensity=together(s.intensity for s in scans),
            time=together(s.time for s in scans),
            ring=together(s.ring + np.uint16(k * beams) for k, s in enumerate(scans) if s.ring is not None),
            sensor=np.repeat(np.arange(len(scans), dtype=np.uint8), [np.count_nonzero(kept) for kept in rows]),
            T_scan_sensor=self.T_scan_sensor,
        )

    @property
    def T_scan_sensor(self) -> Pose:
        """(K, 4, 4) where each LiDAR sits in the frame of the points."""
        return np.stack([lidar.conditions.T_first_mount for lidar in self._lidars])

    @property
    def sensor(self) -> Sensor:
        """The kind of all LiDARs."""
        return self._lidars[0].sensor

    @property
    def period(self) -> float:
        """Seconds of a sweep."""
        return self.sensor.period

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        """(len,) seconds, the middle of each sweep."""
        return self._lidars[0].stamps

    @property
    def is_compensated(self) -> bool:
        """As asked for."""
        return bool(self._lidars[0].is_compensated)

    @property
    def reference_poses(self) -> Pose:
        """(len, 4, 4) true T_world_sensor of the first LiDAR at mid-sweep."""
        return self._lidars[0].reference_poses

    def poses_at(self, times: npt.ArrayLike) -> Pose:
        """Return the (..., 4, 4) true poses of the first LiDAR at `times` seconds."""
        return self._lidars[0].poses_at(times)

    def truth(self, index: int) -> npt.NDArray[np.uint32]:
        """Return (N,) labels as a simulated sequence does."""
        return np.concatenate([lidar.truth(index)[lidar[index].is_valid] for lidar in self._lidars])

    def own_body(self, index: int) -> npt.NDArray[np.bool_]:
        """Return (N,) bool: the points of scan `index` that are on what carries the sensors."""
        return np.concatenate([lidar.own_body(index)[lidar[index].is_valid] for lidar in self._lidars])

    def fingerprint(self) -> str:
        """Return a text that changes when the recording does."""
        return "+".join(lidar.fingerprint() for lidar in self._lidars)
