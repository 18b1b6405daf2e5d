"""The pipeline: from raw scans to a label for every point.

    recording -> poses -> candidates -> instances -> objects -> labels
                 III-A    III-B         III-C        III-D      III-D

A point becomes moving in `objects/labels.py`, if its segment belongs to a moving track. Whether a track moves is
decided in `objects/judge.py`, or in `objects/paper/verdict.py` for the preset `paper`.

Only this file defines the order of the stages. Each is one call: `odometry/estimate.py`, `evidence/stage.py`,
`objects/instances.py`, `objects/tracking.py`, `objects/labels.py`. A stage takes the results of the earlier stages and
stores its own in the workspace, scan by scan if possible. A stage whose results exist already, for the same recording
and settings, is not run again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt

from automos import __version__
from automos.core.arguments import require_kind
from automos.core.array_sequence import as_sequence
from automos.core.errors import InputError
from automos.core.parallel import checked_workers
from automos.core.recording_warnings import recording_warnings
from automos.core.run import Progress, Run, Tick
from automos.core.scan import Pose, Sequence
from automos.core.workspace import Arrays, Stage, Workspace, fingerprint
from automos.evidence.network_cue import cue_fingerprint
from automos.evidence.published import handed_in
from automos.evidence.stage import add_network_cue, find_candidates
from automos.objects.instances import find_segments
from automos.objects.labels import label_scans
from automos.objects.tracking import Scans, TrackedObjects, follow_and_judge
from automos.odometry.clock import rate_of
from automos.odometry.estimate import estimate_trajectory
from automos.odometry.loops.closing import close_loops
from automos.odometry.trajectory import SequenceFrames, Trajectory
from automos.result import Result
from automos.settings import Settings, given_settings


def label(
    recording: Sequence | Iterable[npt.ArrayLike],
    settings: Settings | None = None,
    *,
    poses: Pose | None = None,
    workspace: Workspace | None = None,
    workers: int = 0,
    progress: Progress | None = None,
) -> Result:
    """Label every point of every scan of `recording` as moving or static.

    Parameters
    ----------
    recording : Sequence or list of (M, 3) or (M, 4) float arrays
        A recording from `automos.open_sequence`, or one array per scan: x, y, z in metres in the sensor frame, and
        optionally the intensity. Use `automos.ArraySequence` to give the times of the scans, too.
    settings : Settings, optional
        Result of `automos.load_settings`. The default preset if not given.
    poses : (N, 4, 4) float64, optional
        T_world_sensor of each of the N scans, in metres. Estimated from the scans if not given.
    workspace : Workspace, optional
        Where the results of each stage are stored and looked up. In memory if not given.
    workers : int, default 0
        Number of processes; 0 uses one per core. The labels do not depend on it.
    progress : callable, optional
        Called as `progress(stage, done, total)` after each scan of each stage, for example `print`.

    Returns
    -------
    Result
        Label, confidence and track number of each point; trajectory, tracks and verdicts.

    Raises
    ------
    InputError
        The recording or the poses cannot be used. The message gives the reason and the remedy.

    Examples
    --------
    >>> import numpy as np
    >>> import automos
    >>> noise = np.random.default_rng(0)
    >>> room = noise.uniform([-9, -9, -1.5], [9, 9, 2.5], (2000, 3))
    >>> scans = [room + noise.normal(0.0, 0.01, room.shape) for _ in range(10)]
    >>> result = automos.label(scans, workers=1)
    >>> print(np.count_nonzero(result.labels(0) == automos.Label.MOVING))
    0
    """
    if workspace is None:
        workspace = Workspace()
    require_kind(workspace, Workspace, "workspace", "automos.Workspace(folder)")
    if progress is not None:
        require_kind(progress, Callable, "progress", "a function of stage, done and total, as print")
    steps = Steps(as_sequence(recording), given_settings(settings), poses, workspace, workers, progress)
    labels = steps.labels()
    workspace.keep_only(steps.run.keys)
    path, found, run = steps.trajectory, steps.objects, steps.run
    rate = rate_of(steps.settings.recording, steps.sequence.name)
    warnings = [*recording_warnings(steps.sequence, rate), *path.diagnostics.get("warnings", [])]
    return Result(path, found.tracks, found.verdicts, run.names, run.seconds, run.keys, labels, warnings)


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
        workspace: Workspace | None = None,
        workers: int = 0,
        progress: Progress | None = None,
    ):
        """Take the arguments of `label`."""
        self.sequence, self.settings, self.poses = sequence, settings, poses
        self.workers = checked_workers(workers)
        workspace = workspace or Workspace()
        workspace.require_names(sequence.names, len(sequence))
        self.run = Run(workspace, stage_keys(sequence, settings, poses), sequence.names, progress)

    @cached_property
    def trajectory(self) -> Trajectory:
        """The poses of the sensor (III-A)."""

        def estimate(tick: Tick) -> Arrays:
            about = self.settings.odometry
            rate = rate_of(self.settings.recording, self.sequence.name)
            found = estimate_trajectory(self.sequence, about, self.poses, tick, self.workers, rate)
            if about.loop_closure:
                found = close_loops(SequenceFrames(self.sequence, found), found, about.loops)
            return found.to_arrays()

        return Trajectory.from_arrays(self.run.once("odometry", estimate))

    @cached_property
    def frames(self) -> SequenceFrames:
        """The scans with their poses, made on demand."""
        return SequenceFrames(self.sequence, self.trajectory)

    def candidates(self, scans: range | None = None) -> Stage:
        """Return the evidence of motion of each point (III-B), at least for `scans`."""
        find = partial(find_candidates, self.frames, self.trajectory.stamps, self.settings, self.workers)
        add = partial(add_network_cue, find, self.frames, self.run.names, self.settings.self_training)
        return self.run.each("candidates", add, scans)

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
        if stage == "candidates" and settings.self_training.folder:
            key = fingerprint(key, chosen["self_training"], cue_fingerprint(settings.self_training))
        keys[stage] = key
    return keys
