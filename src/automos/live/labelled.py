"""What the live loop needs of a labeler and of the scans it gives back, in the order in which they were pushed."""

from __future__ import annotations

from typing import Protocol

import numpy.typing as npt

from automos.scan import Pose, Scan


class Labelled(Protocol):
    """A scan that was labelled: see `automos.labeler.LabelledScan`."""

    @property
    def index(self) -> int:
        """How many scans were pushed before it."""

    @property
    def stamp(self) -> float:
        """Return seconds."""

    @property
    def pose(self) -> Pose:
        """(4, 4) T_world_sensor."""

    @property
    def labels(self) -> npt.NDArray:
        """(N,) uint8 of `Label`."""

    @property
    def track_ids(self) -> npt.NDArray:
        """(N,) the moving object of each point, -1 for none."""

    @property
    def confidence(self) -> npt.NDArray:
        """(N,) in [0, 1]."""

    @property
    def objects(self) -> npt.NDArray:
        """(K,) structured, what moves: `track`, `center`, `size`, `yaw`, `velocity`."""


class LabelsScans(Protocol):
    """A labeler of scans as they come: see `automos.labeler.Labeler`."""

    def push(self, scan: Scan) -> list:
        """Take a scan; return those that are labelled now."""

    def finish(self) -> list:
        """Return the rest."""
