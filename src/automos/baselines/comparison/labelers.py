"""All methods that can be compared, the baselines and the presets, with one interface: labels of scans."""

import difflib
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.baselines.methods import BASELINES
from automos.core.errors import InputError
from automos.core.labels import Label
from automos.core.scan import Sequence
from automos.core.workspace import Workspace
from automos.odometry.trajectory import SequenceFrames, Trajectory
from automos.pipeline import find_labels, stage_keys
from automos.settings import PRESETS, Settings

TITLES = {name: method.title for name, method in BASELINES.items()} | {
    "paper": "AutoMOS, paper",
    "default": "AutoMOS, default",
}
"""Names on the command line and in tables, in the order in which they are shown."""

NEEDS_FUTURE = {name: method.needs_future for name, method in BASELINES.items()} | dict.fromkeys(PRESETS, True)
"""Whether a scan's labels depend on scans after it."""


def choose_methods(names: Iterable[str] | None) -> list[str]:
    """Return the methods named, each once, in the order of `TITLES`; all if none is given.

    Raises
    ------
    InputError
        There is no method of that name.
    """
    wanted = list(names or TITLES)
    for name in wanted:
        if name not in TITLES:
            near = difflib.get_close_matches(name, TITLES, 1, 0.0)[0]
            raise InputError(f"there is no method '{name}': did you mean '{near}'? Known are {', '.join(TITLES)}")
    return [name for name in TITLES if name in wanted]


def label_scans(
    method: str, sequence: Sequence, trajectory: Trajectory, settings: Settings, scratch: Path, workers: int
) -> Iterator[tuple[int, npt.NDArray[np.uint8]]]:
    """Yield (index, (N,) uint8 of `Label`) of every scan, in order, one per point of the user's scan.

    Parameters
    ----------
    trajectory : Trajectory
        The poses that the method is given.
    settings : Settings
        Of the preset, where `method` is one.
    scratch : Path
        A folder for what the pipeline keeps between its stages.
    """
    if method in PRESETS:
        yield from _label_by_pipeline(sequence, trajectory, settings, scratch, workers)
        return
    frames = SequenceFrames(sequence, trajectory)
    for i, is_moving in BASELINES[method].find_moving(frames, trajectory.stamps, settings, 0):
        scan = sequence[i]
        labels = np.full(len(scan), Label.UNLABELED, np.uint8)
        labels[scan.is_valid] = np.where(is_moving, Label.MOVING, Label.STATIC)
        yield i, labels


def _label_by_pipeline(
    sequence: Sequence, trajectory: Trajectory, settings: Settings, scratch: Path, workers: int
) -> Iterator[tuple[int, npt.NDArray[np.uint8]]]:
    workspace = Workspace(scratch)
    # The pipeline takes poses that are there already for its own.
    workspace.stage("odometry", stage_keys(sequence, settings)["odometry"]).save("all", trajectory.to_arrays())
    result = find_labels(sequence, settings, workspace=workspace, workers=workers)
    for i in range(len(sequence)):
        yield i, result.labels(i)
