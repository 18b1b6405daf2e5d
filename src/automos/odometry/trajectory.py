"""The trajectory of the sensor, and the motion-compensated scans along it."""

import json
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import Array
from automos.core.scan import Frame, Mask, Pose, Scan, Sequence
from automos.odometry.clock import SHORTEST_PERIOD
from automos.odometry.compensation import frame_of
from automos.odometry.elevation import raised_scan
from automos.odometry.sweep_timing import SweepTiming

ARRAYS = ("T_world_sensor", "stamps", "sweep_motion", "T_level_world")
"""Attributes of a trajectory that are arrays, as they are stored."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses of all scans of a recording at their reference time (mid-sweep).

    Attributes
    ----------
    T_world_sensor : (N, 4, 4) float64; world is the first scan's sensor frame.
    stamps : (N,) float64, seconds.
    sweep_motion : (N, 6) float64, se(3) motion of the sensor during one sweep, in the sensor frame at mid-sweep; zero
        if the scans need no compensation.
    timing : SweepTiming, the source of the point times.
    T_level_world : (4, 4) float64; the level frame has z up and the ground under the first scan at z = 0.
    diagnostics : dict, quality figures of the poses, and warnings in sentences.
    elevation : float, radians by which all beams point higher than the scans say.
    """

    T_world_sensor: Pose
    stamps: Array
    sweep_motion: Array
    timing: SweepTiming
    T_level_world: Pose
    diagnostics: dict[str, Any] = field(default_factory=dict)
    elevation: float = 0.0

    def __repr__(self) -> str:
        path = np.linalg.norm(np.diff(self.T_world_sensor[:, :3, 3], axis=0), axis=1).sum()
        return f"<Trajectory: {len(self.stamps)} poses, {path:.1f} m in {np.ptp(self.stamps) if path else 0.0:.1f} s>"

    def __post_init__(self) -> None:
        n = len(self.T_world_sensor)
        for name, shape in zip(ARRAYS, [(n, 4, 4), (n,), (n, 6), (4, 4)], strict=True):
            if (got := getattr(self, name).shape) != shape:
                raise ValueError(f"{name} must be {shape}, got shape {got}")

    def __len__(self) -> int:
        return len(self.T_world_sensor)

    @property
    def T_level_sensor(self) -> Pose:
        """(N, 4, 4) float64."""
        return self.T_level_world @ self.T_world_sensor

    def with_repeats(self, is_repeat: Mask) -> Self:
        """Return the trajectory of all N scans from this one of the distinct ones: a repeat has the original's pose.

        It is stamped later than the one before by the shortest period, because stamps must increase; by less if many
        would reach beyond the next distinct one.
        """
        row = np.cumsum(~is_repeat) - 1
        nth = np.arange(len(row)) - np.flatnonzero(~is_repeat)[row]  # 0 for a distinct scan, 1 for its first repeat
        gaps = np.diff(self.stamps, append=self.stamps[-1] + 1.0)
        delay = np.minimum(SHORTEST_PERIOD, 0.5 * gaps / np.bincount(row))
        return replace(
            self,
            T_world_sensor=self.T_world_sensor[row],
            stamps=self.stamps[row] + delay[row] * nth,
            sweep_motion=self.sweep_motion[row],
        )

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return everything as arrays, for `numpy.savez` and `from_arrays`."""
        notes = {"timing": self.timing.to_dict(), "diagnostics": self.diagnostics, "elevation": self.elevation}
        return {**{name: getattr(self, name) for name in ARRAYS}, "notes": np.array(json.dumps(notes))}

    @classmethod
    def from_arrays(cls, arrays: dict[str, npt.NDArray]) -> Self:
        """Return the trajectory from the arrays of `to_arrays`."""
        notes = json.loads(str(arrays["notes"]))
        timing = SweepTiming.from_dict(notes["timing"])
        parts = {name: np.asarray(arrays[name]) for name in ARRAYS}
        return cls(**parts, timing=timing, diagnostics=notes["diagnostics"], elevation=notes.get("elevation", 0.0))


def make_frame(scan: Scan, trajectory: Trajectory, index: int) -> Frame:
    """Return the valid points of `scan`, number `index` of the recording, compensated for the sensor's motion.

    Its beams point where the trajectory has found that they do.
    """
    scan = raised_scan(scan, trajectory.elevation)
    T_level_sensor = trajectory.T_level_world @ trajectory.T_world_sensor[index]
    stamp = float(trajectory.stamps[index])
    return frame_of(scan, trajectory.timing, trajectory.sweep_motion[index], T_level_sensor, stamp)


class SequenceFrames:
    """The frames of a recording, each made from its scan on access; InputError if a scan has changed."""

    def __init__(self, sequence: Sequence, trajectory: Trajectory):
        """Take a recording and its trajectory."""
        self.sequence = sequence
        self.trajectory = trajectory
        self._counts: dict[int, tuple[int, int]] = {}

    @property
    def T_level_sensor(self) -> Pose:
        """(N, 4, 4) float64, poses of all frames."""
        return self.trajectory.T_level_sensor

    @property
    def stamps(self) -> Array:
        """(N,) seconds."""
        return self.trajectory.stamps

    def __len__(self) -> int:
        return len(self.sequence)

    def __getitem__(self, index: int) -> Frame:
        frame = make_frame(self.sequence[index], self.trajectory, index)
        now = (frame.n_points, len(frame.points))
        before = self._counts.setdefault(int(index), now)
        if now != before:  # earlier results are of other points: the file was rewritten, or differs on every read
            raise InputError(
                f"scan {self.sequence.names[index]} had {before[0]} points ({before[1]} valid) and now has {now[0]} "
                f"({now[1]}): the recording changed while it was labelled; label it again when nothing writes to it"
            )
        return frame
