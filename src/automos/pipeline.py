"""The pipeline: from raw scans to a label for every point.

    recording -> poses -> candidates -> instances -> objects -> labels
                 III-A    III-B         III-C        III-D      III-D

A point becomes moving in `objects/labels.py`, if its segment belongs to a moving track. Whether a track moves is
decided in `objects/judge.py`, or in `objects/paper/verdict.py` for the preset `paper`.

Only this file defines the order of the stages. Each is one call: `odometry/estimate.py`, `evidence/stage.py`,
`objects/instances.py`, `objects/tracking.py`, `objects/labels.py`. A stage takes the results of the earlier stages and
stores its own, scan by scan if possible. A stage whose results exist already, for the same recording and settings, is
not run again.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt

from automos import __version__
from automos.core.errors import InputError
from automos.core.labels import as_probability
from automos.core.parallel import checked_workers
from automos.core.run import Progress, Run, Tick
from automos.core.scan import Pose, Sequence
from automos.core.stages import Arrays, Stage, Stages, fingerprint
from automos.evidence.published import handed_in
from automos.evidence.stage import find_candidates
from automos.objects.instances import find_segments
from automos.objects.labels import label_scans
from automos.objects.tracking import Scans, TrackedObjects, follow_and_judge
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdicts
from automos.odometry.clock import rate_of
from automos.odometry.estimate import estimate_trajectory
from automos.odometry.trajectory import SequenceFrames, Trajectory
from automos.settings import Settings


@dataclass(frozen=True, eq=False)
class Found:
    """What the stages found in a recording of N scans: what a results folder is written from.

    Attributes
    ----------
    trajectory, tracks, verdicts : the poses, the boxes of all objects, and which of them moved.
    names : of the scans.
    seconds, keys : wall time of each stage, 0 where its results were there already, and its fingerprint.
    stage : where labels, tracks and confidences of the points are.
    """

    trajectory: Trajectory
    tracks: Tracks
    verdicts: Verdicts
    names: list[str]
    seconds: Mapping[str, float]
    keys: Mapping[str, str]
    stage: Stage

    def __len__(self) -> int:
        return len(self.names)

    def labels(self, index: int) -> npt.NDArray[np.uint8]:
        """Return (M,) `Label` of each point of scan `index`."""
        return self.stage.load(self.names[index], "label")["label"]

    def track_ids(self, index: int) -> npt.NDArray[np.int32]:
        """Return (M,) the moving track of each point of scan `index`, a row in `verdicts`; -1 for none."""
        return self.stage.load(self.names[index], "track")["track"]

    def confidence(self, index: int) -> npt.NDArray[np.float32]:
        """Return (M,) the probability that each label of scan `index` is right; 0 where it was not evaluated."""
        return as_probability(self.stage.load(self.names[index], "confidence")["confidence"])


class Steps:
    """The stages of one recording; each first runs the earlier stages whose results are missing.

    Candidates, instances and labels need only the poses and points of other scans, so separate processes can compute
    them for parts of the scans with the same result. Poses and tracks need the recording as a whole.

    Equation: joint
    """

    def __init__(
        self,
        sequence: Sequence,
        settings: Settings,
        poses: Pose | None = None,
        workspace: Stages | None = None,
        workers: int = 0,
        progress: Progress | None = None,
    ):
        """Take a recording, and where results are kept and found: in memory where no `workspace` is given.

        poses : (N, 4, 4) T_world_sensor to use instead of odometry.   workers : processes, 0: one per core.
        """
        self.sequence, self.settings, self.poses = sequence, settings, poses
        self.workers, self._workspace = checked_workers(workers), workspace or Stages()
        self._workspace.require_names(sequence.names, len(sequence))
        self.run = Run(self._workspace, stage_keys(sequence, settings, poses), sequence.names, progress)

    def found(self) -> Found:
        """Run all stages whose results are missing, forget those of other settings; return what they found."""
        labels, objects, run = self.labels(), self.objects, self.run
        self._workspace.keep_only(run.keys)
        return Found(self.trajectory, objects.tracks, objects.verdicts, run.names, run.seconds, run.keys, labels)

    @cached_property
    def trajectory(self) -> Trajectory:
        """The poses of the sensor (III-A)."""

        def estimate(tick: Tick) -> Arrays:
            about, rate = self.settings.odometry, rate_of(self.settings.recording, self.sequence.name)
            return estimate_trajectory(self.sequence, about, self.poses, tick, self.workers, rate).to_arrays()

        return Trajectory.from_arrays(self.run.once("odometry", estimate))

    @cached_property
    def frames(self) -> SequenceFrames:
        """The scans with their poses, made on demand."""
        return SequenceFrames(self.sequence, self.trajectory)

    def candidates(self, scans: range | None = None) -> Stage:
        """Return the evidence of motion of each point (III-B), at least for `scans`."""
        find = partial(find_candidates, self.frames, self.trajectory.stamps, self.settings, self.workers)
        return self.run.each("candidates", find, scans)

    def instances(self, scans: range | None = None) -> Stage:
        """Return the segments and their boxes (III-C), at least for `scans`."""
        candidates, about = self.candidates(scans), self.settings.instances
        find = partial(find_segments, self.frames, candidates, self.run.names, about, self.workers)
        return self.run.each("instances", find, scans)

    @cached_property
    def objects(self) -> TrackedObjects:
        """All tracks and their verdicts (III-D)."""
        scans = Scans(self.frames, self.run.names, self.candidates(), self.instances())
        follow = partial(follow_and_judge, scans, self.settings, self.workers)
        return TrackedObjects.from_arrays(self.run.once("tracking", lambda tick: follow().to_arrays()))

    def labels(self, scans: range | None = None) -> Stage:
        """Return every point's label (III-D), at least for `scans`."""
        objects = self.objects
        about = Scans(self.frames, self.run.names, self.candidates(scans), self.instances(scans))
        return self.run.each("labels", partial(label_scans, about, objects, self.settings, self.workers), scans)


def stage_keys(sequence: Sequence, settings: Settings, poses: Pose | None = None) -> dict[str, str]:
    """Return each stage's fingerprint, which changes with everything that affects the stage's results."""
    try:
        given = None if poses is None else np.ascontiguousarray(poses, np.float64).tobytes().hex()
    except (TypeError, ValueError) as error:
        raise InputError(f"poses must be (N, 4, 4) numbers, T_world_sensor of each scan: {error}") from None
    rate = rate_of(settings.recording, sequence.name) if sequence.stamps is None else None
    key = fingerprint(__version__, sequence.fingerprint(), given, *([] if rate is None else [rate]))
    keys, chosen = {}, settings.model_dump(mode="json")
    for stage in ("odometry", "candidates", "instances", "tracking", "labels"):
        key = fingerprint(key, stage, chosen.get(stage))
        if stage == "candidates" and settings.candidates.method not in ("free_space", "erasor"):
            key = fingerprint(key, handed_in(settings.candidates.method).key)
        keys[stage] = key
    return keys
