"""The result of labelling a recording: a results folder, as Python sees it."""

from __future__ import annotations

import base64
import html
import shutil
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path, held, remove_parts
from automos.core.claims import MARK, RESULTS, claim, remove
from automos.core.errors import InputError
from automos.core.labels import Label
from automos.core.own_sequence import as_sequence
from automos.core.reading import given_path
from automos.core.scan import Sequence
from automos.core.workspace import RUN_FILE, Workspace
from automos.odometry.trajectory import Trajectory
from automos.results.claiming import per_scan_files
from automos.results.open_run import Elsewhere, recording_of
from automos.results.run_files import RunFiles
from automos.results.run_objects import Object, table_of
from automos.results.run_warnings import sentences_of
from automos.views.topdown import View, draw_views
from automos.writers.flow import scan_flow

if TYPE_CHECKING:
    import pandas as pd

PICTURED = 45.0
"""Metres around the sensor that a notebook shows."""


class Result(RunFiles):
    """The result of labelling a recording of N scans; `automos.label` and `automos.load` return it.

    It is a results folder as `automos label` writes it, read as it is asked for: decisions of a review are in all that
    it says. `automos.label` without a workspace makes it in a temporary folder, which goes with the result.

    Attributes
    ----------
    folder : Path
        The results folder.
    sequence : Sequence
        The recording.
    names : list of str
        Name of each scan.
    """

    def __init__(self, folder: Path, sequence: Sequence, kept: TemporaryDirectory[str] | None = None):
        super().__init__(folder, sequence)
        self._kept = kept

    def __repr__(self) -> str:
        n_moving, n = sum(found.verdict == "moving" for found in self.objects), len(self.warnings)
        warned = f"; {n} warning{'s' * (n > 1)}: .warnings" if n else ""
        return f"<Result: {len(self)} scans, {n_moving} of {len(self.objects)} objects move{warned}>"

    def _repr_html_(self) -> str:
        """Return the middle scan from above, movers and their paths in it, for a notebook."""
        said = f"<div>{html.escape(repr(self))}</div>"
        try:
            picture = base64.b64encode(self._drawn()).decode()
        except InputError:  # the recording is elsewhere
            return said
        return f'{said}<img width="480" src="data:image/png;base64,{picture}">'

    def _drawn(self) -> bytes:
        i = len(self) // 2
        frame = self.frames[i]
        view = View(f"scan {self.names[i]}", frame.points_level, self.labels(i, frame.n_points)[frame.kept])
        paths = [found.boxes.center for found in self.objects if found.verdict == "moving"]
        with TemporaryDirectory(prefix="automos-") as place:
            path = Path(place) / "view.png"
            draw_views([view], path, self.trajectory.T_level_sensor[i, :2, 3], PICTURED, paths)
            return path.read_bytes()

    @property
    def about(self) -> dict[str, Any]:
        """What run.json says: versions, fingerprints, counts, seconds of each stage, warnings."""
        return Workspace(self.folder).read_run()

    @property
    def warnings(self) -> list[str]:
        """What to know before trusting the labels, in sentences."""
        return sentences_of(self.about)

    @cached_property
    def trajectory(self) -> Trajectory:
        """Where the sensor was: `stamps` (N,) in seconds, `T_world_sensor` (N, 4, 4) in metres, at mid-sweep."""
        return self.frames.trajectory

    @cached_property
    def objects(self) -> tuple[Object, ...]:
        """All objects with their boxes, verdicts, probabilities and kinds."""
        return tuple(map(Object.of_track, self.tracks_file["tracks"]))

    def points(self, index: int) -> LabelledPoints:
        """Return what is known of each point of a scan.

        Parameters
        ----------
        index : int
            Number of the scan, from 0; IndexError if there is none such.

        Returns
        -------
        LabelledPoints
            Labels, confidences, objects and flow, in the order of the scan's points.
        """
        return LabelledPoints(self, range(len(self))[index])

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table of all boxes of all objects, in the level frame.

        Returns
        -------
        pandas.DataFrame
            A row for each box: scan, stamp (s), object, verdict, kind, p_moved, p_moving, observed, x, y, z, length,
            width, height (m), yaw (rad), vx, vy, vz (m/s).

        Raises
        ------
        MissingExtraError
            pandas is not installed.
        """
        return table_of(self.objects)

    def save(self, path: str | Path) -> None:
        """Write everything into a results folder, as `automos label --out` would; `automos.load` reads it.

        Parameters
        ----------
        path : str or Path
            Folder to write: a new one, an empty one, or one with this result. run.json comes last.

        Raises
        ------
        InputError
            The folder holds something else, or cannot be written.
        """
        target = given_path(path, "a results folder")
        claim(target, RESULTS)
        with held(target):
            run = Workspace(target).read_run()
            if run not in ({}, self.about):
                raise InputError(f"{target} holds results of another run: choose another folder")
            if run:
                return
            remove_parts(target)
            for stale in per_scan_files(target):
                remove(stale)
            files = [file.relative_to(self.folder) for file in sorted(self.folder.rglob("*")) if file.is_file()]
            for file in sorted(files, key=Path(RUN_FILE).__eq__):
                if not (file.name == MARK or file.name.endswith(".part")):
                    (target / file).parent.mkdir(parents=True, exist_ok=True)
                    with atomic_path(target / file) as temporary:
                        shutil.copyfile(self.folder / file, temporary)


class LabelledPoints:
    """What a result says of the M points of one scan, in the scan's order.

    Attributes
    ----------
    labels : (M,) uint8
        `Label`: 251 moving, 9 static, 0 unlabeled.
    """

    def __init__(self, result: Result, index: int):
        self._result, self._index = result, index
        self.labels = result.labels(index)

    def __len__(self) -> int:
        return len(self.labels)

    def __repr__(self) -> str:
        n_moving = int((self.labels == Label.MOVING).sum())
        return f"<LabelledPoints of scan {self._result.names[self._index]}: {len(self)} points, {n_moving} moving>"

    @cached_property
    def confidence(self) -> npt.NDArray[np.float32]:
        """(M,) probability in [0, 1] that each label is right; 0 where nothing was evaluated."""
        return self._result.confidence(self._index)

    @cached_property
    def object(self) -> npt.NDArray[np.int64]:
        """(M,) `id` of the moving object that each point belongs to, 0 for none."""
        return self._result.instances(self._index)

    @cached_property
    def flow(self) -> npt.NDArray[np.float32]:
        """(M, 3) metres from each point to its place in the next scan, each in its own sensor frame.

        The motion of the sensor is part of it. NaN where it is not known: without a label, and in the last scan.
        """
        if self._index + 1 == len(self._result):
            return np.full((len(self), 3), np.nan, np.float32)
        found = scan_flow(self._result, self._index)
        return np.where(found.is_known[:, None], found.flow, np.float32(np.nan))


def load(path: str | Path, recording: str | Path | Sequence | Iterable[Any] | None = None) -> Result:
    """Open a results folder of `automos label`, `Result.save` and the like.

    Parameters
    ----------
    path : str or Path
        The results folder.
    recording : str, Path, Sequence or list of arrays, optional
        The recording, if it is not where it was when it was labelled. Without it everything can be had but what needs
        its points: flow and pictures.

    Returns
    -------
    Result
        The same as `automos.label` returned.

    Raises
    ------
    InputError
        The folder holds no results, or those of other scans.

    Examples
    --------
    >>> import automos
    >>> result = automos.load("automos_runs/my_log")
    >>> result.labels(0).shape == (len(result.scan(0)),)
    True
    >>> points = result.points(0)
    >>> points.confidence.shape == points.object.shape == points.labels.shape
    True
    """
    folder = given_path(path, "a results folder")
    if recording is not None and not isinstance(recording, str | Path):
        return Result(folder, as_sequence(recording))
    try:
        return Result(folder, recording_of(folder, recording))
    except InputError as error:
        if recording is not None or not Workspace(folder).read_run():
            raise
        return Result(folder, Elsewhere(folder, str(error)))
