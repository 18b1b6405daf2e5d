"""One scan, ready for every later stage: valid points, moved to mid-sweep, with their pose."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from automos.odometry.motion import compensate, sweep_times
from automos.odometry.trajectory import Trajectory
from automos.scan import Frame, Pose, Scan, Sequence


def make_frame(scan: Scan, trajectory: Trajectory, index: int) -> Frame:
    """Return the valid points of `scan`, number `index` of the recording, compensated for the sensor's motion.

    The user's own points are compensated, in their order, never a cloud that came back from a registration: those are
    clipped and thinned, and their rows no longer line up with the labels.
    """
    kept = np.flatnonzero(scan.is_valid)
    points = scan.points if len(kept) == len(scan) else np.take(scan.points, kept, axis=0)
    times = sweep_times(scan, trajectory.timing)
    motion = trajectory.sweep_motion[index]
    if times is not None:
        times = times if len(kept) == len(scan) else times[kept]
        points = compensate(points, times, motion)
    return Frame(
        points=points,
        kept=kept,
        n_points=len(scan),
        T_level_sensor=trajectory.T_level_world @ trajectory.T_world_sensor[index],
        stamp=float(trajectory.stamps[index]),
        sweep_time=times,
        sweep_motion=motion,
        sensor=None if scan.sensor is None else scan.sensor[kept],
        T_scan_sensor=scan.T_scan_sensor,
    )


class SequenceFrames:
    """The frames of a whole recording, each made from its scan when asked for."""

    def __init__(self, sequence: Sequence, trajectory: Trajectory):
        """Take a recording and where its sensor was."""
        self.sequence = sequence
        self.trajectory = trajectory

    @property
    def T_level_sensor(self) -> Pose:
        """(N, 4, 4) float64, poses of all frames."""
        return self.trajectory.T_level_sensor

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        """(N,) seconds."""
        return self.trajectory.stamps

    def __len__(self) -> int:
        return len(self.sequence)

    def __getitem__(self, index: int) -> Frame:
        return make_frame(self.sequence[index], self.trajectory, index)
