"""What the stages of a run found, read back: the ground on which a decision is painted."""

from __future__ import annotations

from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.errors import InputError
from automos.odometry import Trajectory
from automos.odometry.frames import SequenceFrames
from automos.scan import Frame, Sequence
from automos.settings import load_settings
from automos.tracking.tracks import Tracks
from automos.tracking.verdict import Verdicts
from automos.workspace import Stage, Workspace

CACHED = 40
"""Frames kept in memory, 2 MB each, so that looking at neighbours of a track reads no scan twice."""


class RunStages:
    """The results of all stages in a results folder, with the recording they were made from."""

    def __init__(self, folder: Path, sequence: Sequence):
        """Take the folder and the recording.

        Raises
        ------
        InputError
            The folder holds no stages of this recording.
        """
        self.folder = folder
        self.names = sequence.names
        self.keys: dict[str, str] = Workspace(folder).read_run().get("stages", {})
        for name in ("odometry", "candidates", "instances", "tracking", "labels"):
            if not (folder / "stages" / f"{name}-{self.keys.get(name)}").is_dir():
                raise InputError(
                    f"{folder} does not hold what stage {name} found, without which nothing can be decided; run "
                    f"automos label again with --out {folder} (decisions made so far are kept)"
                )
        self.settings = load_settings("default", folder / "settings.yaml")
        self.trajectory = Trajectory.from_arrays(self.stage("odometry").load("all"))
        if len(self.trajectory) != len(sequence):
            raise InputError(
                f"{folder} is of {len(self.trajectory)} scans, but {sequence.name} has {len(sequence)}; give the "
                "recording it was made from"
            )
        followed = self.stage("tracking").load("all")
        self.tracks = Tracks.from_arrays(followed)
        self.verdicts = Verdicts.from_arrays(followed)
        self.frames = SequenceFrames(sequence, self.trajectory)
        self.frame = lru_cache(CACHED)(self._frame)

    def stage(self, name: str) -> Stage:
        """Return the results of one stage."""
        return Workspace(self.folder).stage(name, self.keys[name])

    def _frame(self, index: int) -> Frame:
        return self.frames[index]

    @cached_property
    def track_of_segment(self) -> list[npt.NDArray[np.int64]]:
        """Per scan, (K, 2): segments that belong to a track, and the track."""
        tracks, seen = self.tracks, self.tracks.is_observed
        scan = tracks.scan[seen]
        order = np.argsort(scan, kind="stable")
        pairs = np.column_stack([tracks.segment[seen], tracks.track[seen]])[order]
        return np.split(pairs, np.searchsorted(scan[order], np.arange(1, len(self.names))))

    def track_of_points(self, index: int) -> npt.NDArray[np.int64]:
        """Return (M,) for each point of frame `index` the track whose segment it is in, -1 for none."""
        found = self.stage("instances").load(self.names[index], "ids", "stayed")
        segment = np.where(found["ids"] >= 0, found["ids"], found["stayed"])
        track = np.full(int(segment.max(initial=-1)) + 2, -1, np.int64)  # -1 reads the last
        pairs = self.track_of_segment[index]
        pairs = pairs[pairs[:, 0] < len(track) - 1]
        track[pairs[:, 0]] = pairs[:, 1]
        return track[segment]

    def labels(self, index: int) -> dict[str, npt.NDArray]:
        """Return label, track and confidence (N,) of each point of scan `index`, as the pipeline found them."""
        return self.stage("labels").load(self.names[index])
