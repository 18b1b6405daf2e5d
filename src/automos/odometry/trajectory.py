"""The result of the odometry for later stages: poses, motion, and compensated scans."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.errors import InputError
from automos.geometry import FARTHEST, Array, inverse, is_rigid
from automos.odometry.drifting_seam import drifting_times
from automos.odometry.motion import SweepTiming, compensate, sweep_times
from automos.scan import Frame, Mask, Pose, Scan, Sequence

REPEAT_DELAY = 1e-3
"""Seconds by which a repeated scan is stamped later than the original, because stamps must increase."""
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
    """

    T_world_sensor: Pose
    stamps: Array
    sweep_motion: Array
    timing: SweepTiming
    T_level_world: Pose
    diagnostics: dict[str, Any] = field(default_factory=dict)

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

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return everything as arrays, for `numpy.savez` and `from_arrays`."""
        notes = json.dumps({"timing": self.timing.to_dict(), "diagnostics": self.diagnostics})
        return {**{name: getattr(self, name) for name in ARRAYS}, "notes": np.array(notes)}

    @staticmethod
    def from_arrays(arrays: dict[str, npt.NDArray]) -> Trajectory:
        """Return the trajectory from the arrays of `to_arrays`."""
        notes = json.loads(str(arrays["notes"]))
        timing = SweepTiming.from_dict(notes["timing"])
        parts = {name: np.asarray(arrays[name]) for name in ARRAYS}
        return Trajectory(**parts, timing=timing, diagnostics=notes["diagnostics"])


def make_frame(scan: Scan, trajectory: Trajectory, index: int) -> Frame:
    """Return the valid points of `scan`, number `index` of the recording, compensated for the sensor's motion."""
    T_level_sensor = trajectory.T_level_world @ trajectory.T_world_sensor[index]
    stamp = float(trajectory.stamps[index])
    return frame_of(scan, trajectory.timing, trajectory.sweep_motion[index], T_level_sensor, stamp)


def frame_of(scan: Scan, timing: SweepTiming, motion: Array, T_level_sensor: Pose, stamp: float) -> Frame:
    """Return the valid points of `scan`, compensated for the sensor's `motion` (6,) during the sweep.

    The original points are compensated, in their order, never a cloud returned by a registration: those are clipped and
    downsampled, so their rows no longer match the labels.
    """
    kept = np.flatnonzero(scan.is_valid)
    points = scan.points if len(kept) == len(scan) else np.take(scan.points, kept, axis=0)
    times = settled_times(scan, timing, motion, kept)
    if times is not None:
        points = compensate(points, times, motion)
    return Frame(
        points=points,
        kept=kept,
        n_points=len(scan),
        T_level_sensor=T_level_sensor,
        stamp=stamp,
        sweep_time=times,
        sweep_motion=motion,
        sensor=None if scan.sensor is None else scan.sensor[kept],
        T_scan_sensor=scan.T_scan_sensor,
    )


def settled_times(
    scan: Scan, timing: SweepTiming, twist: Array, rows: npt.NDArray[np.intp]
) -> npt.NDArray[np.float32] | None:
    """Return (M,) float32 times of the points in `rows` (M,) of `scan`, one each, or None if unknown.

    A static surface observed twice in one scan is observed at the same position: of a point's two possible times, a
    turn apart, the one is chosen that places the point closer to points of the other turn.
    """
    if timing.source != "azimuth" or timing.seam_deg is not None:
        known = sweep_times(scan, timing)
        return None if known is None else np.take(known, rows)
    all_times, is_any_twofold = drifting_times(scan.points, timing.turn, timing.turns)
    times, is_twofold = np.take(all_times, rows), np.take(is_any_twofold, rows)
    if is_twofold.sum() < 2 or not np.any(twist):
        return times
    from scipy.spatial import cKDTree  # imported only for such recordings

    points, first = np.take(scan.points, rows[is_twofold], axis=0), times[is_twofold]
    second = np.minimum(first + np.float32(1.0 / timing.turns), np.float32(0.5))
    if_first, if_second = compensate(points, first, twist), compensate(points, second, twist)
    off_first, off_second = cKDTree(if_second).query(if_first)[0], cKDTree(if_first).query(if_second)[0]
    times[is_twofold] = np.where(off_second < off_first, second, first)
    return times


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


def checked_poses(poses: Pose, n: int) -> Pose:
    """Return (n, 4, 4) `poses` with exact rotations, in the frame of the first one.

    Raises
    ------
    InputError
        They are not one rigid transform per scan, or not on Earth.
    """
    poses = np.array(poses, np.float64)
    if poses.shape != (n, 4, 4):
        raise InputError(f"poses must be ({n}, 4, 4), one per scan, got shape {poses.shape}; give one pose per scan.")
    if not (is_valid := is_rigid(poses)).all():
        raise InputError(f"pose {np.argmin(is_valid)} is not a rigid transform; check the pose file's format.")
    if not (is_near := (np.abs(poses[:, :3, 3]) < FARTHEST).all(axis=1)).all():
        row = np.argmin(is_near)
        raise InputError(f"pose {row} is not on Earth (further than {FARTHEST:.0e} m from the origin); check its unit.")
    u, _, vt = np.linalg.svd(poses[:, :3, :3])  # pose files are rounded
    poses[:, :3, :3] = u @ vt
    return inverse(poses[0]) @ poses


class DistinctScans(Sequence):
    """The scans of a recording without repeats of the previous scan."""

    def __init__(self, sequence: Sequence, is_repeat: Mask):
        """Take the recording and a mask (N,) of the scans to leave out."""
        self._sequence, self._ids = sequence, np.flatnonzero(~is_repeat)
        self.name, self.source = sequence.name, sequence.source

    def __len__(self) -> int:
        return len(self._ids)

    def __getitem__(self, index: int) -> Scan:
        return self._sequence[int(self._ids[index])]

    @property
    def names(self) -> list[str]:
        """Names of the distinct scans."""
        names = self._sequence.names
        return [names[i] for i in self._ids]

    @property
    def stamps(self) -> Array | None:
        """Stamps of the distinct scans, seconds."""
        stamps = self._sequence.stamps
        return None if stamps is None else stamps[self._ids]

    @property
    def is_compensated(self) -> bool | None:
        """As in the full recording."""
        return self._sequence.is_compensated


def with_repeats(trajectory: Trajectory, is_repeat: Mask) -> Trajectory:
    """Return the trajectory of all N scans from that of the distinct ones: a repeat has the pose of the original."""
    row = np.cumsum(~is_repeat) - 1
    nth = np.arange(len(row)) - np.flatnonzero(~is_repeat)[row]  # 0 for a distinct scan, 1 for its first repeat
    return replace(
        trajectory,
        T_world_sensor=trajectory.T_world_sensor[row],
        stamps=trajectory.stamps[row] + REPEAT_DELAY * nth,
        sweep_motion=trajectory.sweep_motion[row],
    )
