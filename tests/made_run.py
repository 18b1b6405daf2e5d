"""The results folder of a run made by hand, on a sensor mounted at a tilt, and the recording it belongs to."""

import numpy as np
from scipy.spatial.transform import Rotation

from automos.core.array_sequence import ArraySequence
from automos.core.geometry import make_transform
from automos.core.scan import Scan
from automos.core.workspace import Workspace
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.trajectory import Trajectory
from automos.pipeline import Found
from automos.results.run_files import RunFiles
from automos.results.writing import write_results
from automos.settings import load_settings
from automos.writers import export_run

STAMPS = 1_500_000_000.0 + 0.1 * np.arange(3)
LABELS = [[9, 251, 251, 0, 9, 251], [], [251, 9, 9, 0]]
INSTANCES = [[0, 2, 2, 0, 0, 0], [], [2, 0, 0, 0]]
"""Track 2 moves; one moving point is on no track."""

TILT = make_transform(Rotation.from_euler("xy", [10.0, -5.0], degrees=True).as_matrix())
T_LEVEL_WORLD = make_transform(t=[0.0, 0.0, 1.8]) @ TILT
T_WORLD_SENSOR = np.stack([np.linalg.inv(TILT) @ make_transform(
    Rotation.from_euler("z", 0.3 * i).as_matrix(), [0.5 * i, 0.1 * i, 0.0]) @ TILT for i in range(3)])  # fmt: skip

CENTERS = {(1, 0): [5.0, 0.0, 1.0], (2, 0): [1.0, 2.0, 3.0], (2, 1): [1.5, 2.0, 3.0], (2, 2): [2.0, 2.0, 3.0]}
"""Boxes' centres in the level frame, by track and scan."""
SIZE, YAW = [4.0, 2.0, 1.5], {1: 0.5, 2: 0.1}
VELOCITY = [5.0, 0.0, 0.0]


def make_scans():
    """Return three scans: six points, none, and four, one of them NaN; with everything a scan can have."""
    rng = np.random.default_rng(1)
    scans = []
    for i, n in enumerate((6, 0, 4)):
        points = rng.normal(size=(n, 3)).astype(np.float32) * 10
        if n == 4:
            points[3] = np.nan
        scans.append(
            Scan(
                points,
                intensity=rng.integers(0, 255, n).astype(np.float32),
                time=np.linspace(0, 0.09, n).astype(np.float32),
                ring=np.arange(n).astype(np.uint16),
                stamp=float(STAMPS[i]),
                name=f"{i:06d}",
            )
        )
    return scans


def make_run(folder, name="street", scans=None, timing=None, sweep_motion=None, sequence=None):
    """Write the results into `folder`; return them, read back with the recording."""
    sequence = sequence or ArraySequence(scans or make_scans(), STAMPS, name)
    stage = Workspace(folder).stage("labels", "key")
    for scan, label, ids in zip(sequence.names, LABELS, INSTANCES, strict=True):
        stage.save(
            scan, {"label": np.array(label, np.uint8), "track": np.array(ids, np.int32) - 1, "n_body": np.array(1)}
        )
    motion = np.zeros((3, 6)) if sweep_motion is None else sweep_motion
    trajectory = Trajectory(T_WORLD_SENSOR, STAMPS, motion, timing or SweepTiming(), T_LEVEL_WORLD, {})
    Workspace(folder).stage("odometry", "first").save("all", trajectory.to_arrays())
    keys = sorted(CENTERS)
    tracks = Tracks(
        track=np.array([track - 1 for track, _ in keys]),
        scan=np.array([scan for _, scan in keys]),
        segment=np.array([0, 1, -1, 0]),
        center=np.array([CENTERS[key] for key in keys]),
        size=np.tile(SIZE, (4, 1)),
        yaw=np.array([YAW[track] for track, _ in keys]),
        velocity=np.tile(VELOCITY, (4, 1)),
    )
    verdicts = Verdicts(np.array([Verdict.STATIC, Verdict.MOVING], np.int8), np.array([1.0, 0.875]))
    result = Found(trajectory, tracks, verdicts, sequence.names, {}, {"odometry": "first", "labels": "key"}, stage)
    write_results(folder, sequence, result, load_settings("paper"))
    return RunFiles(folder, sequence)


def export(run, format, out):
    """Write a run in another tool's format; return where."""
    (written,) = export_run(run.folder, [run.sequence], format, out)
    return written
