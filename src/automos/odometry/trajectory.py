"""Where the sensor was and how it moved: what the odometry gives to every later stage."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.odometry.motion import SweepTiming
from automos.scan import Pose


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses of all scans of a recording at their reference time (mid-sweep).

    Attributes
    ----------
    T_world_sensor : (N, 4, 4) float64; world is the first scan's sensor frame.
    stamps : (N,) float64, seconds.
    sweep_motion : (N, 6) float64, se(3) motion of the sensor during one sweep, in the sensor frame at mid-sweep; zero
        where the scans need no compensation.
    timing : how the time of each point within its sweep is known.
    T_level_world : (4, 4) float64; the level frame has z up and the ground under the first scan at z = 0.
    diagnostics : figures that tell how far to trust the poses, and warnings in sentences.
    """

    T_world_sensor: Pose
    stamps: npt.NDArray[np.float64]
    sweep_motion: npt.NDArray[np.float64]
    timing: SweepTiming
    T_level_world: Pose
    diagnostics: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        way = np.linalg.norm(np.diff(self.T_world_sensor[:, :3, 3], axis=0), axis=1).sum()
        return f"<Trajectory: {len(self.stamps)} poses, {way:.1f} m in {np.ptp(self.stamps) if way else 0.0:.1f} s>"

    def __post_init__(self) -> None:
        n = len(self.T_world_sensor)
        shapes = {"T_world_sensor": (n, 4, 4), "stamps": (n,), "sweep_motion": (n, 6), "T_level_world": (4, 4)}
        for name, shape in shapes.items():
            got = getattr(self, name).shape
            if got != shape:
                raise ValueError(f"{name} must be {shape}, got shape {got}")

    def __len__(self) -> int:
        return len(self.T_world_sensor)

    @property
    def T_level_sensor(self) -> Pose:
        """(N, 4, 4) float64."""
        return self.T_level_world @ self.T_world_sensor

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return everything as arrays, for `numpy.savez`; `from_arrays` undoes it."""
        notes = json.dumps({"timing": self.timing.to_dict(), "diagnostics": self.diagnostics})
        return {
            "T_world_sensor": self.T_world_sensor,
            "stamps": self.stamps,
            "sweep_motion": self.sweep_motion,
            "T_level_world": self.T_level_world,
            "notes": np.array(notes),
        }

    @staticmethod
    def from_arrays(arrays: dict[str, npt.NDArray]) -> Trajectory:
        """Return the trajectory that `to_arrays` took apart."""
        notes = json.loads(str(arrays["notes"]))
        return Trajectory(
            np.asarray(arrays["T_world_sensor"]),
            np.asarray(arrays["stamps"]),
            np.asarray(arrays["sweep_motion"]),
            SweepTiming.from_dict(notes["timing"]),
            np.asarray(arrays["T_level_world"]),
            notes["diagnostics"],
        )
