"""III-D: tracks, whether each has moved, and the places of static objects beside movers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.core.parallel import map_in_order
from automos.core.scan import OBJECT, Mask
from automos.objects.detections import Detections
from automos.objects.bodies import joined, links_in_time, parts_of_bodies
from automos.objects.extents import Scans, whole_boxes
from automos.objects.judge import is_scenery, judge_tracks, segment_terms
from automos.objects.object_points import tracks_of_points
from automos.objects.paper.verdict import judge_by_trajectory
from automos.objects.places import Places, count_places, held_places, touched_columns
from automos.objects.tracker import can_follow, track_objects
from automos.objects.tracks import Tracks, observed, of_tracks
from automos.objects.verdict import Verdicts
from automos.settings import Settings

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TrackedObjects:
    """Bodies and all else that was tracked, the verdict on each, and the places of static objects beside them.

    `parts` has a row for every segment of every track; of several in a scan, `tracks` has the main one.
    """

    tracks: Tracks
    verdicts: Verdicts
    places: Places | None = None
    parts: Tracks = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.parts is None:
            object.__setattr__(self, "parts", self.tracks[np.flatnonzero(self.tracks.is_observed)])

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return everything by name, for saving."""
        places = {} if self.places is None else self.places.to_arrays()
        parts = {name: getattr(self.parts, name) for name in _OF_PARTS}
        parts = {f"part_{name}": column for name, column in parts.items()}
        return {**self.tracks.to_arrays(), **self.verdicts.to_arrays(), **places, **parts}

    @staticmethod
    def from_arrays(arrays: Mapping[str, npt.NDArray]) -> TrackedObjects:
        """Return the objects saved by `to_arrays`."""
        places = Places.from_arrays(arrays) if "places" in arrays else None
        tracks, verdicts = Tracks.from_arrays(arrays), Verdicts.from_arrays(arrays)
        parts = Tracks.of_segments(*(arrays[f"part_{name}"] for name in _OF_PARTS))
        return TrackedObjects(tracks, verdicts, places, parts)


_OF_PARTS = ("track", "scan", "segment")


def follow_and_judge(scans: Scans, settings: Settings, workers: int) -> TrackedObjects:
    """Return the bodies of a recording, all else that was tracked, and whether each has moved."""
    tracking, stamps = settings.tracking, scans.frames.stamps
    detections = [Detections.from_arrays(scans.instances.load(name, *Detections.columns())) for name in scans.names]
    if tracking.method == "paper":
        tracks = track_objects(zip(stamps, detections, strict=True), tracking)
        return TrackedObjects(tracks, judge_by_trajectory(tracks, tracking.verdict))
    if not can_follow(stamps):
        detections = [of_scan[np.zeros(0, np.int64)] for of_scan in detections]
    tracks = track_objects(zip(stamps, detections, strict=True), tracking)
    terms = [segment_terms(found) for found in detections]
    tracks, verdicts = judge_tracks(tracks, terms, stamps)
    tracks = with_whole_boxes(scans, tracks, observed(tracks), verdicts.is_moving, detections, 1, workers)
    n_points = _of_rows(tracks, [found.n_points for found in detections])
    owner = parts_of_bodies(tracks, verdicts.is_moving, np.bincount(tracks.track, n_points, len(tracks)))
    ends, beginnings = links_in_time(tracks, verdicts.is_moving, np.bincount(tracks.track, owner == tracks.track, len(tracks)) > 0, stamps)
    tracks, parts = joined(tracks, owner, ends, beginnings, n_points)
    tracks, verdicts = judge_tracks(tracks, terms, stamps)
    kept = ~is_scenery(tracks, verdicts, detections)
    tracks, parts, verdicts = of_tracks(tracks, kept), of_tracks(parts, kept), verdicts[kept]
    tracks = with_whole_boxes(scans, tracks, parts, verdicts.is_moving, detections, 2, workers)
    return TrackedObjects(tracks, verdicts, find_places(scans, tracks, parts, verdicts, settings, workers), parts)


def with_whole_boxes(
    scans: Scans,
    tracks: Tracks,
    parts: Tracks,
    is_moving: Mask,
    detections: Sequence[Detections],
    rounds: int,
    workers: int,
) -> Tracks:
    """Return `tracks` with the whole boxes of moving bodies, and the others as they are, at rest."""
    rows = np.flatnonzero(is_moving[tracks.track])
    yaw = _of_rows(tracks, [found.boxes.yaw for found in detections])
    center = np.stack([_of_rows(tracks, [found.boxes.center[:, a] for found in detections]) for a in range(3)], axis=1)
    moving = replace(tracks[rows], center=center[rows])
    moving = whole_boxes(scans, moving, parts[np.flatnonzero(is_moving[parts.track])], yaw[rows], rounds, workers)
    out = replace(tracks, velocity=np.zeros_like(tracks.velocity))
    for name in ("center", "size", "yaw", "velocity"):
        column = getattr(out, name).copy()
        column[rows] = getattr(moving, name)
        out = replace(out, **{name: column})
    return out


def _of_rows(tracks: Tracks, per_scan: Sequence[Array]) -> Array:
    """Return (R,) what `per_scan` says of the segment of each row, 0 where there is none."""
    begins = np.cumsum([0, *(len(of_scan) for of_scan in per_scan)])
    every = np.append(np.concatenate([np.zeros(0), *per_scan]), 0.0)
    return every[np.where(tracks.is_observed, begins[tracks.scan] + tracks.segment, -1)]


def find_places(
    scans: Scans, tracks: Tracks, parts: Tracks, verdicts: Verdicts, settings: Settings, workers: int
) -> Places:
    """Return the places occupied by movers that static objects occupied in many more scans."""
    moving = tracks[np.flatnonzero(verdicts.is_moving[tracks.track] & tracks.is_observed)]
    columns, n = touched_columns(moving.boxes), len(scans.names)
    rows_of_scan = parts.rows_by_scan(n)
    is_moving = verdicts.is_moving[parts.track]

    def held(i: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
        name = scans.names[i]
        found, about = scans.instances.load(name, "ids", "stayed"), scans.candidates.load(name, "kind", "log_odds")
        stands = np.flatnonzero(about["kind"] == OBJECT)
        track = tracks_of_points(found["ids"][stands], found["stayed"][stands], parts[rows_of_scan[i][is_moving[rows_of_scan[i]]]])
        has_stayed = about["log_odds"][stands] < -settings.instances.components.min_log_odds
        return held_places(scans.frames[i].points_level[stands], track >= 0, (track < 0) & has_stayed, columns)

    asked = range(n) if len(columns) else ()
    return Places(count_places(map_in_order(held, asked, workers, threads=True)), verdicts.is_moving)
