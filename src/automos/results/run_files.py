"""A results folder together with its recording: labels, boxes and poses, scan by scan.

Boxes of annotation tools are upright, but a sensor may be mounted at a tilt. Boxes are therefore given in the scan's
*upright* frame: the sensor frame without roll and pitch. Its origin and heading are the sensor's, and z points up.
"""

import logging
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import inverse, transform, upright_pose
from automos.core.pose_files import read_poses
from automos.core.run import Progress, silent
from automos.core.scan import GROUND, Array, Frame, Ints, Mask, Points, Pose, Scan, Sequence
from automos.core.workspace import require_same
from automos.evaluation.predictions import find_predictions
from automos.objects.kinds import Kind, likeliest
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.trajectory import SequenceFrames, Trajectory, make_frame
from automos.results.point_files import PointFiles
from automos.results.run_objects import Object, ScanBoxes, boxes_by_scan
from automos.results.tracks_file import each_track

logger = logging.getLogger(__name__)


class RunFiles(PointFiles):
    """The labels, tracks and poses in a results folder, scan by scan, with the recording's points.

    Parameters
    ----------
    folder : Path
        Results folder.
    sequence : Sequence
        The recording that was labelled.
    progress : callable, optional
        Called as `progress(what, done, total)` while scans are read.
    deskewed : bool, default False
        Whether exported points are motion-compensated.

    Attributes
    ----------
    rows_of : callable, optional
        Takes a scan and its number and returns which of its points are exported. All if None.

    Raises
    ------
    InputError
        The folder holds no labels, or those of other scans, or it does not say how to deskew.
    """

    def __init__(
        self,
        folder: Path,
        sequence: Sequence,
        progress: Progress = silent,
        deskewed: bool = False,
    ):
        super().__init__(folder, sequence.names, find_predictions(folder, sequence.name, is_only=True))
        self.sequence = sequence
        self.deskewed = deskewed
        self.rows_of: Callable[[Scan, int], Mask] | None = None
        self._beside_tracks: dict[str, Any] = {}
        self._progress = progress
        missing = [name for name in self.names if not (self._predictions / f"{name}.label").exists()]
        if missing:
            raise InputError(
                f"{self._predictions} has no {missing[0]}.label: {folder} was made from another recording than "
                f"{sequence.name}, or not to its end; give the recording it was made from, or label again"
            )
        if deskewed and self._trajectory is None:
            raise InputError(f"{folder} does not say how the sensor moved during its sweeps; label again to deskew")

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        return f"<RunFiles {self.folder}: {len(self)} scans of {self.sequence.name!r}>"

    def each(self, what: str) -> Iterator[int]:
        """Yield the index of every scan, and report the progress."""
        for index in range(len(self)):
            yield index
            self._progress(what, index + 1, len(self))

    # -------------------------------------------------------------------------------------------------------- points
    def scan(self, index: int) -> Scan:
        """Return scan `index` as the recording has it."""
        return self.sequence[index]

    def points_at_pose(self, scan: Scan, index: int) -> Points:
        """Return the (N, 3) points of `scan` as seen from its pose, motion-compensated.

        Boxes were fitted to these. Unusable points stay as they are, NaN included, and so do all points if the run no
        longer says how the sensor moved.
        """
        frame = self.frame(scan, index)
        if frame is None:
            return scan.points
        points = scan.points.copy()
        points[frame.kept] = frame.points
        return points

    def frame(self, scan: Scan, index: int) -> Frame | None:
        """Return the points of use of `scan`, motion-compensated; None if the run no longer says how."""
        return None if self._trajectory is None else make_frame(scan, self._trajectory, index)

    def is_ground(self, scan: Scan, index: int) -> Mask:
        """Return (N,) which points of `scan` lie on the ground; none if the run no longer says so."""
        is_ground = np.zeros(len(scan), bool)
        if found := self.stored.load("candidates", self.names[index], "kind"):
            require_same(self.names[index], int(scan.is_valid.sum()), found["kind"])
            is_ground[scan.is_valid] = found["kind"] == GROUND
        return is_ground

    def points_upright(self, scan: Scan, index: int) -> Points:
        """Return `points_at_pose` in the scan's upright frame."""
        return transform(self.T_upright_sensor(index), self.points_at_pose(scan, index))

    @property
    def frames(self) -> SequenceFrames:
        """The scans at the run's poses; as measured where it no longer says how the sensor moved."""
        still = np.zeros((len(self), 6))
        measured = Trajectory(self.T_world_sensor, self.stamps, still, SweepTiming(), self.T_level_world)
        return SequenceFrames(self.sequence, self._trajectory or measured)

    @cached_property
    def _trajectory(self) -> Trajectory | None:
        found = self.stored.load("odometry", "all")
        if found is None:
            logger.warning("%s holds no stages: points are written as measured, not as seen from one pose", self.folder)
            return None
        return Trajectory.from_arrays(found)

    # --------------------------------------------------------------------------------------------------------- poses
    @cached_property
    def T_world_sensor(self) -> Pose:
        """(len, 4, 4) the run's poses."""
        return read_poses(self.folder / "poses.txt", len(self))

    @cached_property
    def T_level_world(self) -> Pose:
        """(4, 4) from the poses' world to the frame of the boxes, z up."""
        if not self._beside_tracks:
            for _ in self.each_track():
                pass  # one at a time: together they are the largest thing that is said of a long drive
        return inverse(np.array(self._beside_tracks["T_world_level"], np.float64))

    def T_level_sensor(self, index: int) -> Pose:
        """Return (4, 4): where the sensor was at scan `index`, in the level frame."""
        return self.T_level_world @ self.T_world_sensor[index]

    def T_level_upright(self, index: int) -> Pose:
        """Return (4, 4): the sensor's place and heading, without its roll and pitch."""
        T = self.T_level_sensor(index)
        # A sensor on its side may look up along its x-axis, which then has no heading.
        forward = T[:3, 0] if abs(T[2, 0]) < 0.9 else T[:3, 2]
        return upright_pose(forward[:2] / np.linalg.norm(forward[:2]), T[:3, 3])

    def T_upright_sensor(self, index: int) -> Pose:
        """Return (4, 4): the rotation that makes the sensor's z-axis point up."""
        return inverse(self.T_level_upright(index)) @ self.T_level_sensor(index)

    @property
    def stamps(self) -> Array:
        """(len,) seconds; ten scans a second where the recording has no clock."""
        stamps = self.sequence.stamps
        return 0.1 * np.arange(len(self), dtype=np.float64) if stamps is None else stamps

    # -------------------------------------------------------------------------------------------------------- tracks
    def boxes_level(self, index: int) -> ScanBoxes:
        """Return the objects of scan `index` in the level frame."""
        index, (edges, boxes) = range(len(self))[index], self._boxes
        return boxes[edges[index] : edges[index + 1]]

    def boxes_upright(self, index: int) -> ScanBoxes:
        """Return the objects of scan `index` in its upright frame."""
        level = self.boxes_level(index)
        T = inverse(self.T_level_upright(index))
        return replace(level, boxes=level.boxes.transformed(T), velocity=level.velocity @ T[:3, :3].T)

    def kinds(self, ids: Ints) -> npt.NDArray[np.int8]:
        """Return (K,) of `Kind`, the likeliest of each of some tracks, `ids` (K,); OTHER where there is no such."""
        unique, row = np.unique(ids, return_inverse=True)
        return np.array([self._kind_of_track.get(track, Kind.OTHER) for track in unique.tolist()], np.int8)[row]

    @property
    def tracks(self) -> dict[int, tuple[str, float]]:
        """Verdict and confidence of every track, by id."""
        return {track["id"]: (track["verdict"], track["confidence"]) for track in self.tracks_file["tracks"]}

    @cached_property
    def tracks_file(self) -> dict[str, Any]:
        """What tracks.json holds."""
        tracks = list(self.each_track())
        return {**self._beside_tracks, "tracks": tracks}

    def each_track(self) -> Iterator[dict[str, Any]]:
        """Yield the tracks of `tracks_file` as they are read."""
        beside: dict[str, Any] = {}
        yield from each_track(self.folder / "tracks.json", len(self), beside)
        self._beside_tracks = beside  # all of it has been checked

    @cached_property
    def _kind_of_track(self) -> dict[int, Kind]:
        return {track["id"]: likeliest(track.get("kind", {})) for track in self.tracks_file["tracks"]}

    @cached_property
    def _boxes(self) -> tuple[list[int], ScanBoxes]:
        """The boxes of all scans, and the row with which each scan's begin."""
        scans, boxes = boxes_by_scan([Object.of_track(track) for track in self.tracks_file["tracks"]])
        return np.searchsorted(scans, np.arange(len(self) + 1)).tolist(), boxes
