"""A recording that arrives scan by scan and is labelled at its end, as `automos.label` does."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from automos.core.array_sequence import ArraySequence
from automos.core.geometry import turn_and_shift
from automos.core.scan import Pose, Scan
from automos.online.labelled_scan import LabelledScan, objects_of
from automos.online.segmenting import Segmented
from automos.settings import Settings


class WholeRecording:
    """Scans of one sensor that are labelled together; the interface is that of `Stream`.

    Attributes
    ----------
    next_track : int
        Number of the next new object.
    T_world_sensor : (4, 4) float64
        Pose of the latest labelled scan.
    """

    def __init__(
        self,
        settings: Settings,
        is_compensated: bool | None = None,
        threads: int = 0,
        T_world_first: Pose | None = None,
        first_track: int = 0,
    ):
        """Take the arguments of `Labeler`, and the last state of the recording that this one continues."""
        self.next_track = first_track
        self.T_world_sensor: Pose = np.eye(4) if T_world_first is None else T_world_first
        self._is_continuation = T_world_first is not None
        self._settings, self._is_compensated, self._threads = settings, is_compensated, threads
        self._numbers: list[int] = []
        self._scans: list[Scan] = []

    def segment(self, number: int, scan: Scan) -> Segmented:
        """Keep `scan`, number `number`, until the end; it has points, and its stamp is later than the last one's."""
        self._numbers.append(number)
        self._scans.append(scan)
        return Segmented([], [], [], [])

    def follow(self, segmented: Segmented) -> Iterator[LabelledScan]:
        """Return nothing: no scan is labelled before the end."""
        return iter(())

    def finish(self) -> list[LabelledScan]:
        """Return all scans."""
        from automos.pipeline import Steps

        recording = ArraySequence(self._scans, is_compensated=self._is_compensated)
        result = Steps(recording, self._settings, workers=self._threads).found()
        given = []
        for i, (pose, stamp) in enumerate(zip(result.trajectory.T_level_sensor, result.trajectory.stamps, strict=True)):
            track = result.track_ids(i)
            here = np.flatnonzero((result.tracks.scan == i) & np.isin(result.tracks.track, np.unique(track)))
            of_points = result.labels(i), track, result.confidence(i)
            given.append(LabelledScan(i, float(stamp), pose, *of_points, objects_of(result.tracks[here])))
        if self._is_continuation:
            T = turn_and_shift(given[0].pose, self.T_world_sensor)
            given = [_moved(scan, T, self.next_track) for scan in given]
        self.next_track += len(result.verdicts.verdict)
        self.T_world_sensor = given[-1].pose
        return [replace(scan, index=number) for number, scan in zip(self._numbers, given, strict=True)]


def _moved(scan: LabelledScan, T: Pose, first_track: int) -> LabelledScan:
    """Return `scan` in the world that `T` (4, 4) takes it to, with objects that count from `first_track`."""
    objects = scan.objects.copy()
    objects["track"] += first_track
    objects["center"] = objects["center"] @ T[:3, :3].T + T[:3, 3]
    objects["velocity"] = objects["velocity"] @ T[:3, :3].T
    objects["yaw"] += np.arctan2(T[1, 0], T[0, 0])
    track_ids = np.where(scan.track_ids < 0, scan.track_ids, scan.track_ids + np.int32(first_track))
    return replace(scan, pose=T @ scan.pose, track_ids=track_ids, objects=objects)
