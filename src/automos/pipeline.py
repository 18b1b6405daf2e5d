"""The method, stage by stage: raw scans in, a label for every point out.

    recording -> poses -> candidates -> instances -> tracks -> verdicts -> labels
                 III-A    III-B         III-C        III-D     III-D       III-D

This file alone knows the order. Each stage takes what the ones before it found and keeps its own results in the
workspace, scan by scan where it can; a stage whose results are there already, made from the same recording with the
same settings, is not run again.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import numpy.typing as npt

from automos import __version__
from automos.candidates.erasor import find_candidates
from automos.candidates.ground import segment_ground
from automos.geometry import Boxes
from automos.instances.find import find_instances
from automos.odometry import Trajectory, estimate_trajectory
from automos.odometry.frames import SequenceFrames
from automos.parallel import map_in_order
from automos.run import Progress, Run
from automos.scan import Frame, Frames, Pose, Sequence
from automos.settings import InstancesSettings, Settings, load_settings
from automos.tracking.painting import paint_points
from automos.tracking.tracker import track_objects
from automos.tracking.tracks import Tracks
from automos.tracking.verdict import Verdict, Verdicts, judge_by_trajectory
from automos.workspace import Arrays, Stage, Workspace, fingerprint


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
    run = Run(workspace, stage_keys(sequence, settings, poses), sequence.names, progress)

    trajectory = Trajectory.from_arrays(
        run.once("odometry", lambda tick: estimate_trajectory(sequence, settings.odometry, poses, tick).to_arrays())
    )
    frames = SequenceFrames(sequence, trajectory)
    candidates = run.each("candidates", partial(_candidates, frames, settings))
    instances = run.each("instances", partial(_instances, frames, candidates, run.names, settings.instances, workers))
    followed = run.once("tracking", lambda tick: _tracking(trajectory, instances, run.names, settings))
    tracks, verdicts = Tracks.from_arrays(followed), Verdicts.from_arrays(followed)
    labels = run.each("labels", partial(_labels, frames, instances, run.names, tracks, verdicts))

    workspace.keep_only(run.keys)
    return Result(trajectory, tracks, verdicts, run.names, run.seconds, run.keys, labels)


def stage_keys(sequence: Sequence, settings: Settings, poses: Pose | None = None) -> dict[str, str]:
    """Return each stage's fingerprint: it changes with all that shapes the stage's results."""
    given = None if poses is None else np.ascontiguousarray(poses, np.float64).tobytes().hex()
    key = fingerprint(__version__, sequence.fingerprint(), given)
    keys = {}
    for stage in ("odometry", "candidates", "instances", "tracking", "labels"):
        key = fingerprint(key, stage, settings.model_dump(mode="json").get(stage))
        keys[stage] = key
    return keys


def _candidates(frames: Frames, settings: Settings, missing: list[int]) -> Iterable[tuple[int, Arrays]]:
    for i, score in find_candidates(frames, settings.candidates.erasor, start=missing[0]):
        yield i, {"score": np.round(255 * score).astype(np.uint8)}


def _instances(
    frames: Frames, candidates: Stage, names: list[str], settings: InstancesSettings, workers: int, missing: list[int]
) -> Iterable[tuple[int, Arrays]]:
    todo = ((frames[i], candidates.load(names[i])["score"]) for i in missing)
    found = map_in_order(partial(_instances_of_frame, settings), todo, workers)
    return zip(missing, found, strict=True)


def _instances_of_frame(settings: InstancesSettings, task: tuple[Frame, npt.NDArray[np.uint8]]) -> Arrays:
    frame, score = task
    horizontal = np.hypot(frame.points[:, 0], frame.points[:, 1])
    is_eligible = (horizontal > settings.ego_radius) & (horizontal < settings.max_range)
    is_eligible &= ~segment_ground(frame.points_level, frame.origin_level, settings.ground)
    instances = find_instances(frame.points_level, score / 255.0, is_eligible, settings.hdbscan)
    return {"ids": instances.ids, **instances.boxes.to_arrays()}


def _tracking(trajectory: Trajectory, instances: Stage, names: list[str], settings: Settings) -> Arrays:
    boxes = (Boxes.from_arrays(instances.load(name)) for name in names)
    tracks = track_objects(zip(trajectory.stamps, boxes, strict=True), settings.tracking)
    verdicts = judge_by_trajectory(tracks, settings.tracking.verdict)
    return {**tracks.to_arrays(), **verdicts.to_arrays()}


def _labels(
    frames: Frames, instances: Stage, names: list[str], tracks: Tracks, verdicts: Verdicts, missing: list[int]
) -> Iterable[tuple[int, Arrays]]:
    is_moving = verdicts.verdict[tracks.track] == Verdict.MOVING
    moving = tracks[np.flatnonzero(is_moving)]
    for i in missing:
        frame, here = frames[i], moving[np.flatnonzero(moving.scan == i)]
        label, track = paint_points(frame.points_level, instances.load(names[i])["ids"], here)
        yield i, {"label": frame.scatter(label), "track": frame.scatter(track, fill=-1)}


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
