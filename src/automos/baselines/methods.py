"""The methods by name, baselines and presets, all with one interface: a recording in, labels of its scans out.

Every map-based method turns its map into labels of scans by the same rule: a point has the label of the voxel that it
fell into itself, never that of whatever is nearest in the cleaned map.
"""

import difflib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.labels import Label
from automos.core.scan import Frames, Mask, Sequence
from automos.core.workspace import Workspace
from automos.odometry.trajectory import SequenceFrames, Trajectory
from automos.pipeline import Steps, stage_keys
from automos.settings import PRESETS, Settings


@dataclass(frozen=True)
class Method:
    """A labeler and what it is called in tables.

    Attributes
    ----------
    name, title : str
        In settings, and in tables and pictures.
    takes : tuple of str
        What it needs beside frames and parameters: "stamps", "ground".
    needs_future : bool
        Whether a scan's labels depend on scans after it.
    """

    name: str
    title: str
    takes: tuple[str, ...] = ()
    needs_future: bool = True

    @property
    def key(self) -> str:
        """The published parameters as a text."""
        return repr(published(self.name))

    def find_moving(
        self, frames: Frames, stamps: npt.NDArray, settings: Settings, start: int
    ) -> Iterator[tuple[int, Mask]]:
        """Yield which points of each frame move, with the published parameters: a `published.FindMoving`."""
        given = {"stamps": stamps, "ground": settings.candidates.ground}
        find = import_module(f"automos.baselines.{self.name}").find_moving
        return find(frames, published(self.name), start=start, **{key: given[key] for key in self.takes})


def published(name: str) -> Any:
    """Return the parameters of method `name` as its authors give them: a frozen dataclass, or one a sensor.

    They are not settings: one compares with what was published. `find_moving` in the method's own module takes others.
    """
    module = import_module(f"automos.baselines.{name}")
    return module.FILES if name == "m_detector" else module.Parameters()


_ALL = (
    Method("octomap", "Octomap"),
    Method("removert", "Removert"),
    Method("erasor", "ERASOR"),
    Method("pfreundschuh", "Pfreundschuh's", ("ground",)),
    Method("yoon", "Yoon's", ("stamps", "ground")),
    Method("dufomap", "DUFOMap"),
    Method("m_detector", "M-detector", ("stamps", "ground"), needs_future=False),
    Method("hmm_mos", "HMM-MOS", needs_future=False),
)
BASELINES = {method.name: method for method in _ALL}
"""In the order of the paper's Table I, then the newer ones."""


TITLES = {name: method.title for name, method in BASELINES.items()} | {
    "paper": "AutoMOS, paper",
    "default": "AutoMOS, default",
}
"""Names on the command line and in tables, in the order in which they are shown."""


def title_of(method: str) -> str:
    """Return what a method, or another program's labels, are called in tables."""
    return TITLES.get(method, method)


NEEDS_FUTURE = {name: method.needs_future for name, method in BASELINES.items()} | dict.fromkeys(PRESETS, True)
"""Whether a scan's labels depend on scans after it; not known of those of other programs."""


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
        workspace = Workspace(scratch)
        # The pipeline takes poses that are there already for its own.
        workspace.stage("odometry", stage_keys(sequence, settings)["odometry"]).save("all", trajectory.to_arrays())
        result = Steps(sequence, settings, workspace=workspace, workers=workers).found()
        yield from ((i, result.labels(i)) for i in range(len(sequence)))
        return
    frames = SequenceFrames(sequence, trajectory)
    for i, is_moving in BASELINES[method].find_moving(frames, trajectory.stamps, settings, 0):
        scan = sequence[i]
        labels = np.full(len(scan), Label.UNLABELED, np.uint8)
        labels[scan.is_valid] = np.where(is_moving, Label.MOVING, Label.STATIC)
        yield i, labels
