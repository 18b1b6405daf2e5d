"""What the live loop needs of a labeler and of the scans it gives back, in the order in which they were pushed."""

from __future__ import annotations

from typing import Protocol

import numpy.typing as npt

from automos.scan import Pose, Scan


class Labelled(Protocol):
    """A scan that was labelled: see `automos.labeler.LabelledScan`."""

    @property
    def index(self) -> int: ...
    @property
    def stamp(self) -> float: ...
    @property
    def pose(self) -> Pose: ...
    @property
    def labels(self) -> npt.NDArray: ...
    @property
    def track_ids(self) -> npt.NDArray: ...
    @property
    def confidence(self) -> npt.NDArray: ...
    @property
    def objects(self) -> npt.NDArray: ...


class LabelsScans(Protocol):
    """A labeler of scans as they come: see `automos.labeler.Labeler`."""

    def push(self, scan: Scan) -> list: ...
    def finish(self) -> list: ...
