"""How good labels are, and what they cost: of a preset, with or without changes, or of any method that is compared."""

import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from ablation import changed, parsed
from cases import Recording, noisy
from experiment import code_digest
from recordings import opened

from automos import Workspace, label, load_settings
from automos.baselines.comparison.compare import compare
from automos.baselines.comparison.cost import Effort
from automos.baselines.comparison.runs import MethodRuns
from automos.core.label_files import OUTLIER, to_mos
from automos.core.labels import Label
from automos.core.scan import Sequence
from automos.evaluation.moving import Counts, count
from automos.evaluation.trajectory import path_length
from automos.odometry.estimate import estimate_trajectory
from automos.settings import Settings

N_BINS = 20
"""Steps of confidence by which points are counted."""
WARM_UP = 12
"""Scans that are labelled first, so that kernels are there: compiling and loading them is not what is measured."""


def score(recording: str, store: Path, method: str = "default", change: str = "", workers: int = 1) -> dict[str, Any]:
    """Return points right and wrong, calibration, seconds and memory of a preset, with `change` (`ablation.py`).

    Seconds are of the wall, and of processors, this process's and its children's, without the warm-up.
    """
    overrides, constants = parsed(change)
    settings = load_settings(method, None, overrides)
    with opened(recording, store) as made, changed(constants):
        label(First(made.sequence, WARM_UP), settings, workers=workers)
        with _poses_kept(store, f"{recording}, {method}", change, constants) as workspace:
            poses = _noisy_poses(made.sequence, settings) if made.has_noisy_poses else None
            with Effort() as effort:
                result = label(made.sequence, settings, poses=poses, workspace=workspace, workers=workers)
            found, trajectory = _counted(made, result), result.trajectory
    return found | {
        "way_m": float(path_length(trajectory.T_world_sensor)[-1]),
        "is_timed": trajectory.timing.source != "none",
        "scans": len(made.sequence),
        "cpu_seconds": effort.busy,
        "wall_seconds": effort.seconds,
        "peak_mb": effort.peak / 1e6,
    }


def _noisy_poses(sequence: Sequence, settings: Settings) -> npt.NDArray[np.float64]:
    return noisy(estimate_trajectory(sequence, settings.odometry).T_world_sensor)


@contextmanager
def _poses_kept(store: Path, name: str, change: str, constants: dict[str, Any]) -> Iterator[Workspace]:
    """Give a workspace; where something is changed after the odometry, with the poses that were found before."""
    kept = store / "poses" / code_digest() / name.replace("/", "_")
    is_shared = bool(change) and not any(".odometry" in place for place in constants)
    with tempfile.TemporaryDirectory() as folder:
        stages = Path(folder) / "stages"
        if is_shared and kept.exists():
            shutil.copytree(kept, stages)
        yield Workspace(Path(folder))
        if is_shared and not kept.exists():
            for stage in stages.glob("odometry-*"):
                shutil.copytree(stage, kept / stage.name, dirs_exist_ok=True)


def _counted(made: Recording, result: Any) -> dict[str, Any]:
    """Return what is right and wrong over all scans, points on the carrier and in the air apart."""
    counts, reliability = Counts(), np.zeros((2, N_BINS, 3))
    on = dict.fromkeys(("points", "called_moving", "body_points", "body_moving", "air_points", "air_moving"), 0)

    def add(part: str, rows: npt.NDArray[np.bool_] | slice, labels: npt.NDArray) -> None:
        on[f"{part}_points"] += len(labels[rows])
        on[f"{part}_moving"] += int(np.count_nonzero(labels[rows] == Label.MOVING))

    for i in range(len(made.sequence)):
        labels, truth = result.labels(i), made.sequence.truth(i)
        on["points"] += len(labels)
        on["called_moving"] += int(np.count_nonzero(labels == Label.MOVING))
        if made.bodies is not None:
            add("body", made.bodies(i), labels)
        if truth is not None:
            add("air", truth & 0xFFFF == OUTLIER, labels)
            counts += count(labels, truth)
            reliability += _reliability(labels, truth, result.confidence(i))
    return on | scores_of(counts) | {"reliability": reliability.tolist()}


def scores_of(counts: Counts) -> dict[str, Any]:
    """Return ratios and points of the moving class, those with truth alone."""
    scores = counts.scores
    return {
        "iou": scores.iou,
        "precision": scores.precision,
        "recall": scores.recall,
        "true_points": scores.true_dynamic,
        "false_points": scores.false_dynamic,
        "missed_points": scores.false_static,
        "scored_points": scores.n_points,
    }


def _reliability(labels: npt.NDArray, truth: npt.NDArray, confidence: npt.NDArray) -> npt.NDArray[np.float64]:
    """Return (2, N_BINS, 3): of points called static and moving, by confidence: how many, confidence's sum, right."""
    true = to_mos(truth)
    out = np.zeros((2, N_BINS, 3))
    for k, kind in enumerate((Label.STATIC, Label.MOVING)):
        rows = (labels == kind) & ((true == Label.STATIC) | (true == Label.MOVING))
        bins = np.minimum((confidence[rows] * N_BINS).astype(int), N_BINS - 1)
        for j, weight in enumerate((None, confidence[rows], true[rows] == kind)):
            out[k, :, j] = np.bincount(bins, weight, N_BINS)
    return out


def calibration_error(reliability: npt.ArrayLike) -> float:
    """Return the expected calibration error of (N_BINS, 3) points, confidence's sum and points right, nan of none."""
    n, confidence, right = np.asarray(reliability).T
    return float(np.abs(confidence - right).sum() / n.sum()) if n.sum() else float("nan")


def compared(recording: str, store: Path, method: str, repeats: int = 1) -> dict[str, Any]:
    """Return scores and cost of a method as `automos compare` has them, the odometry of rivals left out of the cost."""
    with opened(recording, store) as made:
        folder = store / "compared" / code_digest() / recording.replace("/", "_")
        runs = MethodRuns(made.sequence, folder, own_process=repeats > 1, repeats=repeats)
        found = compare(runs, [method]).to_dict()["methods"][method]
    points = {"true_points": "true_dynamic", "false_points": "false_dynamic", "missed_points": "false_static"}
    return {"scans": len(runs.sequence), **found, **{name: found.get(of) for name, of in points.items()}}


def by_network(recording: str, store: Path) -> dict[str, Any]:
    """Return the scores of the network that comes along, online, over all points, and how many it calls moving."""
    from automos.evaluation.report import evaluate_folder
    from automos.network.segment import open_network, segment_recording

    network = open_network(None)
    with opened(recording, store) as made, tempfile.TemporaryDirectory() as folder:
        run = segment_recording(made.sequence, Path(folder) / "run", network, load_settings("default"))
        counts = evaluate_folder(Path(folder) / "run" / "predictions", made.sequence).counts
    points = {"points": sum(run["points"].values()), "called_moving": run["points"]["moving"]}
    return {"engine": network.engine, **points, **scores_of(counts)}


class First(Sequence):
    """The first scans of a recording."""

    def __init__(self, inner: Sequence, n: int):
        self._inner, self._n, self.name = inner, min(n, len(inner)), inner.name

    def __len__(self) -> int:
        return self._n

    def __getitem__(self, index: int) -> Any:
        return self._inner[range(self._n)[index]]

    @property
    def stamps(self) -> npt.NDArray | None:
        return None if self._inner.stamps is None else self._inner.stamps[: self._n]

    @property
    def is_compensated(self) -> bool | None:
        return self._inner.is_compensated

    def truth(self, index: int) -> npt.NDArray | None:
        return self._inner.truth(index)


def timed(calls: Iterable[Callable[[], object]]) -> list[float]:
    """Return the milliseconds of each call."""
    spent = []
    for call in calls:
        start = time.perf_counter()
        call()
        spent.append(1e3 * (time.perf_counter() - start))
    return spent
