"""The method, stage by stage: raw scans in, a label for every point out.

    recording -> poses -> candidates -> instances -> tracks -> verdicts -> labels
                 III-A    III-B         III-C        III-D     III-D       III-D

This file alone knows the order. Each stage takes what the ones before it found and keeps its own results in the
workspace, scan by scan where it can; a stage whose results are there already, made from the same recording with the
same settings, is not run again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import numpy.typing as npt

from automos import __version__
from automos.candidates.cue import cue_fingerprint
from automos.odometry import Trajectory, estimate_trajectory
from automos.odometry.frames import SequenceFrames
from automos.run import Progress, Run
from automos.scan import Pose, Sequence
from automos.settings import Settings, load_settings
from automos.stages import find_candidates, find_segments, follow_and_judge, hear_network, paint
from automos.tracking.tracks import Tracks
from automos.tracking.verdict import Verdicts
from automos.workspace import Stage, Workspace, fingerprint


def label(
    sequence: Sequence,
    settings: Settings | None = None,
    *,
    poses: Pose | None = None,
    workspace: Workspace | None = None,
    workers: int = 0,
    progress: Progress | None = None,
) -> Result:
    """Label every point of every scan of `sequence` as moving or static.

    Parameters
    ----------
    sequence : the recording, `automos.open_sequence(path)` or `automos.ArraySequence(arrays)`.
    settings : `automos.load_settings("paper")` and the like; the default preset where not given.
    poses : (N, 4, 4) T_world_sensor; estimated from the scans where not given.
    workspace : where results are kept and found again; in memory where not given.
    workers : processes; 0 takes one per core. The labels do not depend on it.
    progress : called with a stage's name, the scans done and their total.

    Raises
    ------
    InputError : the recording or the poses cannot be used; the message says why and what to do.
    """
    settings = settings or load_settings("default")
    workspace = workspace or Workspace()
    names = sequence.names
    run = Run(workspace, stage_keys(sequence, settings, poses), names, progress)

    trajectory = Trajectory.from_arrays(
        run.once("odometry", lambda tick: estimate_trajectory(sequence, settings.odometry, poses, tick).to_arrays())
    )
    frames = SequenceFrames(sequence, trajectory)
    find = partial(find_candidates, frames, trajectory.stamps, settings, workers)
    candidates = run.each("candidates", partial(hear_network, find, frames, names, settings.self_training))
    instances = run.each("instances", partial(find_segments, frames, candidates, names, settings.instances, workers))
    followed = run.once("tracking", lambda tick: follow_and_judge(trajectory, instances, names, settings))
    tracks, verdicts = Tracks.from_arrays(followed), Verdicts.from_arrays(followed)
    labels = run.each(
        "labels", partial(paint, frames, candidates, instances, names, tracks, verdicts, settings, workers)
    )

    workspace.keep_only(run.keys)
    return Result(trajectory, tracks, verdicts, names, run.seconds, run.keys, labels)


def stage_keys(sequence: Sequence, settings: Settings, poses: Pose | None = None) -> dict[str, str]:
    """Return each stage's fingerprint: it changes with all that shapes the stage's results."""
    given = None if poses is None else np.ascontiguousarray(poses, np.float64).tobytes().hex()
    key = fingerprint(__version__, sequence.fingerprint(), given)
    keys, chosen = {}, settings.model_dump(mode="json")
    for stage in ("odometry", "candidates", "instances", "tracking", "labels"):
        key = fingerprint(key, stage, chosen.get(stage))
        if stage == "candidates" and settings.candidates.method not in ("free_space", "erasor"):
            key = fingerprint(key, chosen["baselines"])
        if stage == "candidates" and settings.self_training.folder:
            key = fingerprint(key, chosen["self_training"], cue_fingerprint(settings.self_training))
        keys[stage] = key
    return keys


@dataclass(frozen=True, eq=False)
class Result:
    """What labelling a recording gives.

    Attributes
    ----------
    trajectory, tracks, verdicts : what the stages found; `verdicts` has one row per track.
    names : one per scan.
    seconds : wall time of each stage, 0 where its results were there already.
    keys : fingerprint of each stage.
    """

    trajectory: Trajectory
    tracks: Tracks
    verdicts: Verdicts
    names: list[str]
    seconds: Mapping[str, float]
    keys: Mapping[str, str]
    stage: Stage = field(repr=False)

    def __len__(self) -> int:
        return len(self.names)

    def labels(self, index: int) -> npt.NDArray[np.uint8]:
        """Return (N,) uint8 of `Label`, one per point of scan `index`, in the scan's order."""
        return self.stage.load(self.names[index])["label"]

    def track_ids(self, index: int) -> npt.NDArray[np.int32]:
        """Return (N,) int32: the moving track each point of scan `index` belongs to, -1 for none."""
        return self.stage.load(self.names[index])["track"]

    def confidence(self, index: int) -> npt.NDArray[np.float32]:
        """Return (N,) float32 in [0, 1]: how sure each point's label is, 0 for points that were not looked at."""
        return self.stage.load(self.names[index])["confidence"].astype(np.float32) / np.float32(255.0)
