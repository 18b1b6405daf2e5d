"""Runs each method on one recording, in its own process, and keeps labels and cost in a folder.

    FOLDER/poses/...              the poses given to the methods, one set for each way of finding them
    FOLDER/METHOD/predictions/    a label file per scan
    FOLDER/METHOD/cost.json       seconds, memory, processor time, and the fingerprint of the inputs

Results that exist and were made with the same settings are kept. Labels of other programs can be compared, too.
"""

import os
import shutil
from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.baselines.comparison.cost import Cost, Effort, read_cost
from automos.baselines.methods import TITLES, label_scans, published
from automos.core.atomic import write_json, write_raw
from automos.core.claims import METHODS, SCRATCH, claim, remove
from automos.core.errors import InputError
from automos.core.label_files import read_labels, to_mos
from automos.core.labels import Label
from automos.core.parallel import end_with, starting_processes
from automos.core.run import Progress, Run, silent
from automos.core.scan import Pose, Sequence
from automos.core.stages import fingerprint
from automos.core.workspace import Workspace
from automos.evaluation.predictions import find_predictions
from automos.odometry.estimate import estimate_trajectory
from automos.odometry.trajectory import SequenceFrames, Trajectory
from automos.pipeline import stage_keys
from automos.settings import PRESETS, OdometrySettings, Settings, load_settings


class MethodRuns:
    """Labels of all methods on one recording, made on demand.

    predictions : the folders of other programs' labels, by name.
    """

    def __init__(
        self,
        sequence: Sequence,
        folder: Path,
        overrides: dict[str, object] | None = None,
        poses: Pose | None = None,
        workers: int = 0,
        progress: Progress | None = None,
        own_process: bool = True,
        shared: bool = False,
        repeats: int = 1,
        predictions: Mapping[str, Path] | None = None,
    ):
        """Take a recording and a results folder.

        `overrides` are settings that differ from the presets' ("candidates.ground.cell": 0.4); `poses` (N, 4, 4)
        T_world_sensor are used instead of odometry. Without them each preset finds its own, and what is not a preset is
        given the default's; `shared`: all are. Without `own_process` methods run in this one: short recordings take
        less time, but what they cost is not known. `repeats` is how often each is run. `predictions` are
        folders of label files that other programs made, by name.
        """
        self.sequence, self.folder, self.repeats = sequence, folder, repeats
        self.poses = "given" if poses is not None else "shared" if shared else "own"
        self.predictions = {
            name: find_predictions(Path(root), sequence.name, is_only=True)
            for name, root in (predictions or {}).items()
        }
        _check_predictions(sequence, self.predictions)
        self._settings = {preset: load_settings(preset, None, overrides) for preset in PRESETS}
        self._own_process = own_process
        self._workers, self._progress = workers, progress or silent
        claim(folder, METHODS)
        self._given, self._trajectories = poses, dict[str, Trajectory]()
        self.trajectory = self.trajectory_of("default")
        self.frames = SequenceFrames(sequence, self.trajectory)

    def trajectory_of(self, method: str) -> Trajectory:
        """Return the poses for `method`."""
        key, odometry = self._pose_key(method), self._odometry(method)
        if key not in self._trajectories:
            kept = Run(Workspace(self.folder / "poses"), {"odometry": key}, self.sequence.names, self._progress)
            find = partial(estimate_trajectory, self.sequence, odometry, self._given)
            found = kept.once("odometry", lambda tick: find(tick).to_arrays())
            self._trajectories[key] = Trajectory.from_arrays(found)
        return self._trajectories[key]

    def _odometry(self, method: str) -> OdometrySettings:
        return self._settings[method if self.poses == "own" and method in PRESETS else "default"].odometry

    def _pose_key(self, method: str) -> str:
        odometry = self._odometry(method).model_dump(mode="json")
        given = None if self._given is None else np.ascontiguousarray(self._given, np.float64).tobytes().hex()
        return fingerprint(self.sequence.fingerprint(), odometry, given)

    def settings(self, method: str) -> Settings:
        """Return the settings of `method`: a preset's own, the default's for baselines."""
        return self._settings.get(method, self._settings["default"])

    def _fingerprint(self, method: str) -> str:
        """Return a fingerprint of everything that shapes the labels of `method`."""
        settings = self.settings(method)
        if method in PRESETS:
            return fingerprint(self._pose_key(method), stage_keys(self.sequence, settings)["labels"])
        chosen = settings.model_dump(mode="json")
        return fingerprint(self._pose_key(method), method, repr(published(method)), chosen["candidates"]["ground"])

    def cost(self, method: str) -> Cost | None:
        """Return what `method` took; it is run where its labels are not there yet. None of another program's labels.

        Raises
        ------
        MissingExtraError
            Its library is not installed.
        """
        if method in self.predictions:
            return None
        key = self._fingerprint(method)
        file = self.folder / method / "cost.json"
        cost = read_cost(file, key)
        if cost is None or len(cost.seconds) < self.repeats:
            for earlier in (file, *file.parent.glob("predictions/*.label")):
                remove(earlier)
            trajectory = self.trajectory_of(method)
            self._progress(method, 0, len(self.sequence))
            task = (method, self.sequence, trajectory, self.settings(method), file.parent, self._workers)
            if self._own_process:
                runs = [_in_own_process(*task) for _ in range(self.repeats)]
            else:
                runs = [replace(_run(*task), memory=[float("nan")])]
            cost = Cost(*(list(chain(*parts)) for parts in zip(*(asdict(run).values() for run in runs), strict=True)))
            write_json(file, {"key": key, **asdict(cost)})
            self._progress(method, len(self.sequence), len(self.sequence))
        return cost

    def labels(self, method: str, index: int, n_points: int) -> npt.NDArray[np.uint32]:
        """Return the labels (n_points,) uint32 of scan `index` by `method`, which must have been run."""
        name = self.sequence.names[index]
        if method in self.predictions:
            return to_mos(read_labels(self.predictions[method] / f"{name}.label", n_points)).astype(np.uint32)
        return read_labels(self.folder / method / "predictions" / f"{name}.label", n_points)


def _in_own_process(*task: object) -> Cost:
    """Return `_run(*task)`, run in a fresh process: the memory of one method is not counted to the next."""
    from joblib.externals.loky import ProcessPoolExecutor

    ending = {"initializer": end_with, "initargs": (os.getpid(),)}
    with starting_processes(), ProcessPoolExecutor(max_workers=1, **ending) as pool:
        return pool.submit(_run, *task).result()


def _run(
    method: str, sequence: Sequence, trajectory: Trajectory, settings: Settings, folder: Path, workers: int
) -> Cost:
    predictions, scratch = folder / "predictions", folder / "scratch"
    predictions.mkdir(parents=True, exist_ok=True)
    claim(scratch, SCRATCH)
    with Effort() as effort:
        for i, labels in label_scans(method, sequence, trajectory, settings, scratch, workers):
            write_raw(predictions / f"{sequence.names[i]}.label", labels.astype(np.uint32))
    shutil.rmtree(scratch, ignore_errors=True)
    n = len(sequence)
    return Cost([effort.seconds / n], [effort.busy / n], [effort.peak], [effort.others])


def _check_predictions(sequence: Sequence, folders: Mapping[str, Path]) -> None:
    """Raise InputError if labels that another program made do not fit the recording, before anything is run."""
    for name in folders:
        if name in TITLES:
            raise InputError(f"--predictions {name}=...: '{name}' is a method of AutoMOS; give it another name")
    for i in range(len(sequence) if folders else 0):
        n_points = len(sequence[i])
        for folder in folders.values():
            read_labels(folder / f"{sequence.names[i]}.label", n_points)


def is_moving(labels: npt.NDArray) -> npt.NDArray[np.bool_]:
    """Return (N,) bool: which of `labels` say moving."""
    return (labels.astype(np.uint32) & 0xFFFF) == Label.MOVING
