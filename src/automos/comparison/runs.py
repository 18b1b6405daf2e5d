"""Methods run on one recording, each in a process of its own, their labels and cost kept in a folder.

    FOLDER/poses/...              the poses that all methods are given, found once
    FOLDER/METHOD/predictions/    a label file per scan
    FOLDER/METHOD/cost.json       seconds, peak memory, and the fingerprint of what made them

What is there already, made with the same settings, is not made again.
"""

from __future__ import annotations

import json
import shutil
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.atomic import write_text
from automos.baselines.methods import BUILDS_ON
from automos.comparison.labelers import label_scans
from automos.comparison.memory import PeakMemory
from automos.errors import InputError
from automos.evaluation.report import read_prediction
from automos.labels import Label
from automos.odometry import Trajectory, estimate_trajectory
from automos.odometry.frames import SequenceFrames
from automos.pipeline import stage_keys
from automos.run import Progress
from automos.scan import Pose, Sequence
from automos.settings import PRESETS, Settings, load_settings
from automos.working_folder import starting_processes
from automos.workspace import Workspace, fingerprint


@dataclass(frozen=True)
class Cost:
    """What a method took: seconds per scan (wall), and the process's peak memory in bytes, nan where unknown."""

    seconds_per_scan: float
    peak_memory: float


class MethodRuns:
    """The methods' labels of one recording, made when first asked for."""

    def __init__(
        self,
        sequence: Sequence,
        folder: Path,
        overrides: dict[str, object] | None = None,
        poses: Pose | None = None,
        workers: int = 0,
        progress: Progress | None = None,
        own_process: bool = True,
    ):
        """Take a recording and where results are kept.

        `overrides` are settings that differ from the presets' ("baselines.removert.voxel": 0.1); `poses` (N, 4, 4)
        T_world_sensor are used instead of odometry. Without `own_process` methods run in this one: short recordings
        take less time, but peak memory is not known.
        """
        self.sequence, self.folder, self.has_given_poses = sequence, folder, poses is not None
        self._settings = {preset: load_settings(preset, None, overrides) for preset in PRESETS}
        self._own_process = own_process
        self._workers, self._progress = workers, progress or (lambda name, done, total: None)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder} cannot be made ({error.strerror}): choose another --out") from None
        odometry = self._settings["default"].odometry
        given = None if poses is None else np.ascontiguousarray(poses, np.float64).tobytes().hex()
        self._key = fingerprint(sequence.fingerprint(), odometry.model_dump(mode="json"), given)
        stage = Workspace(folder / "poses").stage("odometry", self._key)
        if not stage.has("all"):
            found = estimate_trajectory(sequence, odometry, poses, lambda done, n: self._progress("odometry", done, n))
            stage.save("all", found.to_arrays())
        self.trajectory = Trajectory.from_arrays(stage.load("all"))
        self.frames = SequenceFrames(sequence, self.trajectory)

    def settings(self, method: str) -> Settings:
        """Return the settings of `method`: a preset's own, the default's for baselines."""
        return self._settings.get(method, self._settings["default"])

    def _fingerprint(self, method: str) -> str:
        """Return what changes with all that shapes what `method` finds."""
        settings = self.settings(method)
        if method in PRESETS:
            return fingerprint(self._key, stage_keys(self.sequence, settings)["labels"])
        chosen = settings.model_dump(mode="json")
        own = [chosen["baselines"].get(name) for name in (method, *BUILDS_ON.get(method, ()))]
        return fingerprint(self._key, method, own, chosen["candidates"]["ground"], chosen["candidates"]["erasor"])

    def cost(self, method: str) -> Cost:
        """Return what `method` took; it is run where its labels are not there yet.

        Raises
        ------
        MissingExtraError
            Its library is not installed.
        """
        key = self._fingerprint(method)
        file = self.folder / method / "cost.json"
        cost = _read_cost(file, key)
        if cost is None:
            shutil.rmtree(self.folder / method, ignore_errors=True)
            self._progress(method, 0, len(self.sequence))
            task = (method, self.sequence, self.trajectory, self.settings(method), file.parent, self._workers)
            cost = _in_own_process(*task) if self._own_process else replace(_run(*task), peak_memory=float("nan"))
            write_text(file, json.dumps({"key": key, **cost.__dict__}))
            self._progress(method, len(self.sequence), len(self.sequence))
        return cost

    def labels(self, method: str, index: int, n_points: int) -> npt.NDArray[np.uint32]:
        """Return (n_points,) uint32 of `Label`, what `method` says of scan `index`; it must have been run."""
        name = self.sequence.names[index]
        return read_prediction(self.folder / method / "predictions" / f"{name}.label", n_points)


def _read_cost(file: Path, key: str) -> Cost | None:
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        return Cost(found["seconds_per_scan"], found["peak_memory"]) if found["key"] == key else None
    except (OSError, ValueError, KeyError):
        return None


def _in_own_process(*task: object) -> Cost:
    """Return `_run(*task)`, run in a fresh process: the memory of one method is not counted to the next."""
    from joblib.externals.loky import ProcessPoolExecutor

    with starting_processes(), ProcessPoolExecutor(max_workers=1) as pool:
        return pool.submit(_run, *task).result()


def _run(
    method: str, sequence: Sequence, trajectory: Trajectory, settings: Settings, folder: Path, workers: int
) -> Cost:
    predictions, scratch = folder / "predictions", folder / "scratch"
    predictions.mkdir(parents=True, exist_ok=True)
    with PeakMemory() as memory:
        start = time.perf_counter()
        for i, labels in label_scans(method, sequence, trajectory, settings, scratch, workers):
            labels.astype(np.uint32).tofile(predictions / f"{sequence.names[i]}.label")
        seconds = time.perf_counter() - start
    shutil.rmtree(scratch, ignore_errors=True)
    return Cost(seconds / len(sequence), memory.peak)


def is_moving(labels: npt.NDArray) -> npt.NDArray[np.bool_]:
    """Return (N,) bool: which of `labels` say moving."""
    return (labels.astype(np.uint32) & 0xFFFF) == Label.MOVING
