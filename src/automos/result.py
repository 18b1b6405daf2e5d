"""The result of labelling a recording: labels per point, and what the stages found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from automos.core.workspace import Stage
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts
from automos.odometry.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Result:
    """The result of labelling a recording of N scans.

    Attributes
    ----------
    trajectory : Trajectory
        Pose of the sensor at each scan.
    tracks : Tracks
        Boxes of all tracked objects over time.
    verdicts : Verdicts
        For each track, whether it moved.
    names : list of str
        Name of each scan.
    seconds : dict of str to float
        Wall time of each stage in seconds; 0 if its results were already in the workspace.
    keys : dict of str to str
        Fingerprint of each stage.
    stage : Stage
        Where the labels are stored.
    warnings : list of str
        What to know before trusting the labels: first about the recording, then about the poses.
    """

    trajectory: Trajectory
    tracks: Tracks
    verdicts: Verdicts
    names: list[str]
    seconds: Mapping[str, float]
    keys: Mapping[str, str]
    stage: Stage = field(repr=False)
    warnings: list[str] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        n_moving = int((self.verdicts.verdict == Verdict.MOVING).sum())
        n = len(self.warnings)
        warned = f"; {n} warning{'s' * (n > 1)}: .warnings" if n else ""
        return f"<Result: {len(self)} scans, {n_moving} of {len(self.verdicts.verdict)} objects move{warned}>"

    def labels(self, index: int) -> npt.NDArray[np.uint8]:
        """Return the labels of scan `index`.

        Parameters
        ----------
        index : int
            Number of the scan, from 0.

        Returns
        -------
        (M,) uint8
            A `Label` for each of the scan's M points, in the scan's order.
        """
        return self.stage.load(self.names[index])["label"]

    def track_ids(self, index: int) -> npt.NDArray[np.int32]:
        """Return the moving track of each point of scan `index`.

        Parameters
        ----------
        index : int
            Number of the scan, from 0.

        Returns
        -------
        (M,) int32
            Row of the track in `verdicts`; -1 for points of no moving track.
        """
        return self.stage.load(self.names[index])["track"]

    def n_body(self, index: int) -> int:
        """Return how many points of scan `index` are on the ego body (vehicle, operator); they have label 0."""
        return int(self.stage.load(self.names[index], "n_body")["n_body"])

    def confidence(self, index: int) -> npt.NDArray[np.float32]:
        """Return the confidence of each label of scan `index`.

        Parameters
        ----------
        index : int
            Number of the scan, from 0.

        Returns
        -------
        (M,) float32
            Probability in [0, 1] that the label is right; 0 for points that were not evaluated.
        """
        return self.stage.load(self.names[index])["confidence"].astype(np.float32) / np.float32(255.0)
