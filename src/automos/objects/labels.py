"""III-D: from objects to points. Only here does a point become moving.

A point is MOVING if its segment is associated with a moving track (decided by `objects/judge.py`, or by
`objects/paper/verdict.py` in the preset `paper`), or if it stands in the box of one, unless static objects occupied its
place in many more scans (`objects/places.py`). At 2.5 scans a second or fewer nothing can be tracked, so the evidence
on a segment decides (`objects/object_points.py`). Points of the ego body, and points of less confidence than required,
are UNLABELED. All others are STATIC.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label
from automos.core.parallel import map_in_order
from automos.core.scan import EGO_BODY, Frame
from automos.core.stages import Arrays, PerScan
from automos.objects.detections import Detections
from automos.objects.object_points import find_moved, paint_objects, point_confidence, tracks_of_points
from automos.objects.paper.painting import paint_points
from automos.objects.tracker import can_follow
from automos.objects.tracking import Scans, TrackedObjects
from automos.objects.tracks import Tracks
from automos.settings import Settings


class InScan(NamedTuple):
    """The objects in one scan: a row for every track, one for every segment of a track, and one for every scrap."""

    tracks: Tracks
    parts: Tracks
    scraps: Tracks


def label_scans(scans: Scans, objects: TrackedObjects, settings: Settings, workers: int, missing: list[int]) -> PerScan:
    """Yield for each missing scan every point's label, moving track and confidence."""
    is_followed = settings.tracking.method == "paper" or can_follow(scans.frames.stamps)
    tables = (objects.tracks, objects.parts, objects.scraps)

    def label_scan(i: int) -> Arrays:
        found, about = scans.instances.load(scans.names[i]), scans.candidates.load(scans.names[i], "kind", "log_odds")
        here = InScan(*(table[table.rows_in_scan(i)] for table in tables))
        return label_points(scans.frames[i], about, found, here, objects, settings, is_followed)

    return zip(missing, map_in_order(label_scan, missing, workers, threads=True), strict=True)


def label_points(
    frame: Frame,
    about: Mapping[str, npt.NDArray],
    found: Mapping[str, npt.NDArray],
    here: InScan,
    objects: TrackedObjects,
    settings: Settings,
    is_followed: bool,
) -> dict[str, npt.NDArray]:
    """Return every point's label, moving track and confidence.

    about, found : the frame's candidates and instances.   here : the objects in it.
    is_followed : whether the scan rate is high enough for tracking.
    """
    track = _moving_tracks(frame, about, found, here, objects, settings)
    label = np.where(track >= 0, Label.MOVING, Label.STATIC).astype(np.uint8)
    owner = np.where(track >= 0, track, tracks_of_points(found["ids"], found["stayed"], here.parts))
    confidence = point_confidence(track >= 0, owner, objects.verdicts.confidence, about["log_odds"], about["kind"])
    _label_scraps(label, confidence, track, found, here.scraps, settings.labels.moving)
    if not is_followed:
        moves = find_moved(found["ids"], Detections.from_arrays(found))
        label[moves] = Label.MOVING
        confidence[moves] = np.round(255.0 / (1.0 + np.exp(-about["log_odds"][moves].astype(np.float32))))
    is_body = about["kind"] == EGO_BODY
    if settings.tracking.method != "paper":
        label[is_body] = Label.UNLABELED
    label[confidence < np.float32(255.0 * settings.labels.unsure)] = Label.UNLABELED
    per_point = {"label": frame.scatter(label), "track": frame.scatter(track, fill=-1)}
    return {**per_point, "confidence": frame.scatter(confidence), "n_body": np.array(np.count_nonzero(is_body))}


def _moving_tracks(
    frame: Frame,
    about: Mapping[str, npt.NDArray],
    found: Mapping[str, npt.NDArray],
    here: InScan,
    objects: TrackedObjects,
    settings: Settings,
) -> npt.NDArray[np.int32]:
    """Return (M,) the moving track that each point of a frame belongs to, -1 for none."""
    is_moving = objects.verdicts.is_moving[here.tracks.track]
    if settings.labels.moving == "now":
        is_moving &= here.tracks.p_moving >= 0.5
    moving, points = here.tracks[np.flatnonzero(is_moving)], frame.points_level
    if settings.tracking.method == "paper":
        return paint_points(points, found["ids"], moving)
    parts = here.parts[np.flatnonzero(np.isin(here.parts.track, moving.track))]
    places, completion = objects.places, settings.tracking.completion
    track = paint_objects(points, about, found, moving, parts, completion, is_told_apart=places is not None)
    if places is not None:
        track[places.static_points(points, track)] = -1
    return track


def _label_scraps(
    label: npt.NDArray[np.uint8],
    confidence: npt.NDArray[np.uint8],
    track: npt.NDArray[np.int32],
    found: Mapping[str, npt.NDArray],
    scraps: Tracks,
    moving: str | None,
) -> None:
    """Label the points (M,) of moving scraps that no body has, in place."""
    if moving == "now":
        scraps = scraps[np.flatnonzero(scraps.p_moving >= 0.5)]
    numbered = replace(scraps, track=np.arange(len(scraps.track)))
    scrap = tracks_of_points(found["ids"], found["stayed"], numbered)
    rows = np.flatnonzero((scrap >= 0) & (track < 0))
    label[rows] = Label.MOVING
    confidence[rows] = np.round(255.0 * scraps.p_moving[scrap[rows]])
