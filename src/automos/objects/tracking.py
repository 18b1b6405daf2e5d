"""III-D: tracks, whether each has moved, and the places of static objects beside movers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.parallel import map_in_order
from automos.core.scan import OBJECT, Frames
from automos.core.workspace import Stage
from automos.objects.detections import Detections
from automos.objects.judge import judge_tracks, segment_terms, without_scenery
from automos.objects.object_points import tracks_of_points
from automos.objects.paper.verdict import judge_by_trajectory
from automos.objects.places import Places, count_places, held_places, touched_columns
from automos.objects.smoothing import smooth_tracks
from automos.objects.tracker import can_follow, track_objects
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdicts
from automos.settings import Settings


@dataclass(frozen=True, eq=False)
class Scans:
    """The scans of a recording, their names, and the results of the earlier stages."""

    frames: Frames
    names: list[str]
    candidates: Stage
    instances: Stage


@dataclass(frozen=True, eq=False)
class TrackedObjects:
    """Tracks, the verdict on each, and the places of static objects beside them, if known."""

    tracks: Tracks
    verdicts: Verdicts
    places: Places | None = None

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return everything by name, for saving."""
        places = {} if self.places is None else self.places.to_arrays()
        return {**self.tracks.to_arrays(), **self.verdicts.to_arrays(), **places}

    @staticmethod
    def from_arrays(arrays: Mapping[str, npt.NDArray]) -> TrackedObjects:
        """Return the objects saved by `to_arrays`."""
        places = Places.from_arrays(arrays) if "places" in arrays else None
        return TrackedObjects(Tracks.from_arrays(arrays), Verdicts.from_arrays(arrays), places)


def follow_and_judge(scans: Scans, settings: Settings, workers: int) -> TrackedObjects:
    """Return the tracks of all objects of a recording and their verdicts."""
    tracking, stamps = settings.tracking, scans.frames.stamps
    detections = [Detections.from_arrays(scans.instances.load(name, *Detections.columns())) for name in scans.names]
    if tracking.method == "paper":
        tracks = track_objects(zip(stamps, detections, strict=True), tracking)
        return TrackedObjects(tracks, judge_by_trajectory(tracks, tracking.verdict))
    if not can_follow(stamps):
        detections = [of_scan[np.zeros(0, np.int64)] for of_scan in detections]
    tracks = track_objects(zip(stamps, detections, strict=True), tracking)
    verdicts = judge_tracks(tracks, [segment_terms(found) for found in detections], tracking.judge)
    tracks, verdicts = without_scenery(tracks, verdicts, detections)
    tracks = smooth_tracks(tracks, verdicts.is_moving, detections, stamps)
    return TrackedObjects(tracks, verdicts, find_places(scans, tracks, verdicts, settings, workers))


def find_places(scans: Scans, tracks: Tracks, verdicts: Verdicts, settings: Settings, workers: int) -> Places:
    """Return the places occupied by movers that static objects occupied in many more scans."""
    moving = tracks[np.flatnonzero(verdicts.is_moving[tracks.track] & tracks.is_observed)]
    columns, n = touched_columns(moving.boxes), len(scans.names)
    rows_of_scan = moving.rows_by_scan(n)

    def held(i: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
        name = scans.names[i]
        found, about = scans.instances.load(name, "ids", "stayed"), scans.candidates.load(name, "kind", "log_odds")
        stands = np.flatnonzero(about["kind"] == OBJECT)
        track = tracks_of_points(found["ids"][stands], found["stayed"][stands], moving[rows_of_scan[i]])
        has_stayed = about["log_odds"][stands] < -settings.instances.components.min_log_odds
        return held_places(scans.frames[i].points_level[stands], track >= 0, (track < 0) & has_stayed, columns)

    asked = range(n) if len(columns) else ()
    return Places(count_places(map_in_order(held, asked, workers, threads=True)), verdicts.is_moving)
