"""The stages of the method on a stream of scans: the same functions as for a recording, on a sliding window."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.labels import Label
from automos.core.scan import Pose, Scan
from automos.objects.labels import InScan, label_points
from automos.objects.tracking import TrackedObjects
from automos.online.following import Followed, Following, Found
from automos.online.labelled_scan import LabelledScan, is_unknown, objects_of
from automos.online.segmenting import Segmented, SegmentedScan, Segmenting
from automos.online.sighting import Sightings
from automos.settings import Settings


class Stream:
    """Scans of one sensor without long interruptions."""

    def __init__(
        self,
        settings: Settings,
        lag: float,
        pool: ThreadPoolExecutor,
        is_compensated: bool | None = None,
        has_stamps: bool = True,
        T_world_first: Pose | None = None,
        first_track: int = 0,
    ):
        """Take the arguments of `Labeler`, a thread pool, and the last state of the stream that this one continues.

        has_stamps : whether scans come with their times; otherwise missing ones are counted.
        """
        moving = settings.labels.moving or "now"  # what moves at any time, is not known before the end
        self._settings = settings.model_copy(update={"labels": settings.labels.model_copy(update={"moving": moving})})
        self._sightings = Sightings(settings, pool, is_compensated, has_stamps, T_world_first)
        self._segmenting = Segmenting(settings, lag, pool, self._sightings)
        self._following = Following(settings.tracking, lag, first_track)

    @property
    def next_track(self) -> int:
        """Number of the next new object."""
        return self._following.next_track

    @property
    def T_world_sensor(self) -> Pose:
        """(4, 4) pose of the latest scan."""
        return self._sightings.T_level_sensor

    def segment(self, number: int, scan: Scan) -> Segmented:
        """Return the results that `scan`, number `number`, completes; it has points and a stamp.

        May be called ahead in another thread, in the order of the scans.
        """
        return self._segmenting.step(number, scan)

    def follow(self, segmented: Segmented) -> Iterator[LabelledScan]:
        """Yield the scans whose lag has passed; call with `segmented` in order."""
        self._following.move(segmented.moved)
        for done in segmented.renewed:
            self._following.renew(done.result())
        for found in segmented.settled:
            self._following.add(found)
        for scan in segmented.due:
            yield self._paint(scan, segmented.ahead)

    def finish(self) -> Iterator[LabelledScan]:
        """Yield the remaining scans."""
        yield from self.follow(self._segmenting.finish())

    def _paint(self, scan: SegmentedScan, ahead: list[Found]) -> LabelledScan:
        frame = scan.frame
        if scan.segments is None or scan.about is None:
            return LabelledScan.of_nothing(scan.number, scan.stamp, frame.T_level_sensor, frame.n_points)
        followed = self._following.at(scan.stamp, ahead)
        judged = TrackedObjects(followed.here, followed.verdicts)
        painted = label_points(
            frame,
            scan.about,
            scan.segments,
            InScan(judged.tracks, judged.parts, judged.scraps),
            judged,
            self._settings,
            followed.is_followed,
        )
        labels, track = painted["label"], painted["track"]
        unknown = is_unknown(scan.about, scan.segments)
        labels[frame.kept[unknown & (labels[frame.kept] == Label.STATIC)]] = Label.UNLABELED
        track_ids = np.append(followed.numbers, -1).astype(np.int32)[track]
        confidence = painted["confidence"].astype(np.float32) / np.float32(255.0)
        objects = _objects(followed, np.unique(track[track >= 0]))
        return LabelledScan(scan.number, scan.stamp, frame.T_level_sensor, labels, track_ids, confidence, objects)


def _objects(followed: Followed, moving: npt.NDArray[np.int64]) -> npt.NDArray:
    """Return the boxes and velocities of the tracks `moving` in this scan."""
    here = followed.here[np.flatnonzero(np.isin(followed.here.track, moving))]
    return objects_of(replace(here, track=followed.numbers[here.track]))


def require_online_methods(settings: Settings) -> None:
    """Raise InputError if `settings` select a method that needs the whole recording."""
    chosen = {"candidates": settings.candidates.method, "tracking": settings.tracking.method}
    able = {"candidates": "free_space", "tracking": "evidence"}
    for stage, method in chosen.items():
        if method != able[stage]:
            raise InputError(
                f"{stage}.method {method} needs the whole recording: set it to {able[stage]}, or lag to math.inf"
            )
