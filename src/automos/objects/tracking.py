"""III-D: tracks, whether each has moved, and the places of static objects beside movers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from automos.core.geometry import Array
from automos.core.parallel import map_in_order, return_memory
from automos.core.scan import OBJECT, Frames, Mask
from automos.core.stages import Stage
from automos.objects.bodies import cut_where_two, joined, links_in_time
from automos.objects.detections import Detections
from automos.objects.extents import make_whole
from automos.objects.judge import is_scenery, judge_tracks, moving_now
from automos.objects.kinds import EXTENT, Kind
from automos.objects.object_points import paint_objects, tracks_of_points
from automos.objects.paper.verdict import judge_by_trajectory, with_speed_as_state
from automos.objects.parts import parts_of_bodies
from automos.objects.places import Places, count_places, held_places, touched_columns
from automos.objects.terms import Segments, SegmentTerms, each_for_itself, segment_terms
from automos.objects.tracker import can_follow, track_objects
from automos.objects.tracks import AT_ONCE, Tracks, observed, of_rows, of_tracks
from automos.objects.verdict import Verdict, Verdicts
from automos.settings import Settings

ENOUGH = 300.0
"""Points times seconds, or lengths of a car, of a sight without a break from which on it shows a body: of what is less,
neither extent nor path is known, and what is lost and found again in pieces is another thing each time."""
SURE = 0.9
"""Probability from which on such a scrap moves, as where poses slip for a moment everything seems to; and from which on
a mover is sure enough for what stands at its place to be it."""
ROUNDS = 30  # in which bodies are joined: ten are usual, and two that give each other a piece would never end
_OF_PARTS = ("track", "scan", "segment", "p_moving")


@dataclass(frozen=True, eq=False)
class Scans:
    """The scans of a recording, their names, and the results of the earlier stages."""

    frames: Frames
    names: list[str]
    candidates: Stage
    instances: Stage


@dataclass(frozen=True, eq=False)
class TrackedObjects:
    """Bodies and all else that was tracked, the verdict on each, and the places of static objects beside them.

    `parts` has a row for every segment of every track; of several in a scan, `tracks` has the main one. `scraps` are
    segments that moved and are too small to be bodies; their `p_moving` is the probability that they did. `counts`
    (T, 2) are the points of each track over its life, and those of them that have moved; None where nobody counted.
    """

    tracks: Tracks
    verdicts: Verdicts
    places: Places | None = None
    parts: Tracks = None  # type: ignore[assignment]
    scraps: Tracks = None  # type: ignore[assignment]
    counts: Array | None = None

    def __post_init__(self) -> None:
        if self.parts is None:
            object.__setattr__(self, "parts", observed(self.tracks))
        if self.scraps is None:
            object.__setattr__(self, "scraps", self.tracks[np.zeros(0, np.int64)])

    def to_arrays(self) -> dict[str, npt.NDArray]:
        """Return everything by name, for saving."""
        places = {} if self.places is None else self.places.to_arrays()
        more = {f"{name}_{c}": getattr(getattr(self, name), c) for name in ("parts", "scraps") for c in _OF_PARTS}
        counts = {} if self.counts is None else {"counts": self.counts}
        return {**self.tracks.to_arrays(), **self.verdicts.to_arrays(), **places, **more, **counts}

    @staticmethod
    def from_arrays(arrays: Mapping[str, npt.NDArray]) -> TrackedObjects:
        """Return the objects saved by `to_arrays`."""
        places = Places.from_arrays(arrays) if "places" in arrays else None
        parts, scraps = (
            Tracks.of_segments(*(arrays[f"{name}_{c}"] for c in _OF_PARTS)) for name in ("parts", "scraps")
        )
        tracks, verdicts = Tracks.from_arrays(arrays), Verdicts.from_arrays(arrays)
        return TrackedObjects(tracks, verdicts, places, parts, scraps, arrays.get("counts"))


def follow_and_judge(scans: Scans, settings: Settings, workers: int) -> TrackedObjects:
    """Return the bodies of a recording, all else that was tracked, and whether each has moved."""
    tracking, stamps = settings.tracking, scans.frames.stamps
    detections = (Detections.from_arrays(scans.instances.load(name, *Detections.columns())) for name in scans.names)
    if tracking.method == "paper":
        tracks = track_objects(zip(stamps, detections, strict=True), tracking)
        return TrackedObjects(with_speed_as_state(tracks), judge_by_trajectory(tracks, tracking.verdict))
    if not can_follow(stamps):
        detections = (of_scan[np.zeros(0, np.int64)] for of_scan in detections)
    seen: list[SegmentTerms] = []  # little is kept of each scan once it is tracked, as recordings are long

    def noted(found: Detections) -> Detections:
        seen.append(segment_terms(found))
        if len(seen) % AT_ONCE == 0:
            return_memory()
        return found

    followed = zip(stamps, map(noted, detections), strict=True)
    tracks, parts, verdicts, segments = _bodies(track_objects(followed, tracking), seen, stamps)
    enough = ENOUGH * min(1.0, 0.5 * np.ptp(stamps)) if len(stamps) else 0.0  # less in a short recording
    is_scrap = verdicts.is_moving & is_small(parts, len(tracks), segments, stamps, enough)
    is_sure = is_scrap & (verdicts.confidence >= SURE)
    scraps = of_tracks(parts, is_sure)
    scraps = replace(scraps, p_moving=verdicts[is_sure].confidence[scraps.track])
    tracks, parts, verdicts = of_tracks(tracks, ~is_scrap), of_tracks(parts, ~is_scrap), verdicts[~is_scrap]
    counts = segments.counts_of(tracks)
    del segments  # what is looked for now is large, too
    places = find_places(scans, tracks, parts, verdicts, settings, workers)
    verdicts = without_standing(scans, parts, places, verdicts, workers)
    tracks.velocity[~verdicts.is_moving[tracks.track]] = 0.0
    return TrackedObjects(moving_now(tracks, verdicts, stamps), verdicts, places, parts, scraps, counts)


def _judged(tracks: Tracks, segments: Segments, stamps: Array) -> Verdicts:
    """Return the verdicts on all tracks; on some at a time, as what is smoothed for it is larger than the tracks."""
    first, at_once = np.append(tracks.first_rows(), len(tracks.track)), math.isqrt(len(tracks))
    found = [judge_tracks(tracks[:0], segments, stamps)]
    for k in range(0, len(tracks), at_once or 1):
        some = tracks[first[k] : first[min(k + at_once, len(tracks))]]
        found.append(judge_tracks(replace(some, track=some.track - k), segments, stamps))
    return Verdicts.concatenate(found)


def is_small(parts: Tracks, n: int, segments: Segments, stamps: Array, enough: float) -> Mask:
    """Return (T,) which of `n` tracks have less than `enough` points times seconds in every sight without a break.

    A car's length of way says as much as a second: what comes towards the sensor is seen for a moment, and what has
    gone so far is no slip of the poses.

    parts : all segments of the tracks, sorted by track, then scan.
    """
    of_parts = segments.terms.counts[segments.of(parts), 0]
    first = parts.first_of_sights()
    last = np.append(first[1:], len(parts.track))[: len(first)] - 1
    sight = np.repeat(np.arange(len(first)), last + 1 - first)
    time = stamps[parts.scan[last]] - stamps[parts.scan[first]]
    way = np.linalg.norm((parts.center[last] - parts.center[first])[:, :2], axis=1)
    is_enough = np.bincount(sight, of_parts, len(first)) * np.maximum(time, way / EXTENT[Kind.CAR, 0]) >= enough
    return ~np.isin(np.arange(n), parts.track[first[is_enough]])


def _bodies(tracks: Tracks, seen: list[SegmentTerms], stamps: Array) -> tuple[Tracks, Tracks, Verdicts, Segments]:
    """Return the rows of bodies, of the tracklets `tracks` that are one thing, all their parts, verdicts, and `seen`.

    Whose extent and path are known of more sights has more parts and goes on farther, until nothing more is one.
    Scenery that has to do with no body is left out.
    """
    segments = each_for_itself(Segments.of_scans(seen), tracks)
    terms = segments.terms
    return_memory()
    is_moving, evidence = _judged(tracks, segments, stamps).is_moving, of_rows(segments.of(tracks), terms.evidence)
    tracks = parts = cut_where_two(tracks, is_moving, evidence, stamps)
    for is_last in (k == ROUNDS for k in range(ROUNDS + 1)):
        verdicts = _judged(tracks, segments, stamps)
        is_moving = verdicts.is_moving
        make_whole(tracks, parts, is_moving, segments, stamps)
        n_points = np.nan_to_num(of_rows(segments.of(parts), terms.counts[:, 0]))
        is_sure = is_moving & (verdicts.confidence >= SURE)
        owner = parts_of_bodies(tracks, is_moving, is_sure, np.bincount(parts.track, n_points, len(tracks)), stamps)
        is_whole = np.bincount(tracks.track, owner == tracks.track, len(tracks)) > 0
        evidence = of_rows(segments.of(tracks), terms.evidence)
        ends, beginnings = links_in_time(tracks, is_moving, is_whole, evidence, stamps)
        kept = ~is_scenery(tracks, is_moving, segments)
        if is_last or (not len(ends) and np.array_equal(owner, tracks.track)):
            break
        first = tracks.first_rows()[parts.track]
        owner = owner[first + parts.scan - tracks.scan[first]]
        tracks, parts = joined(parts, owner, ends, beginnings, n_points)
    return of_tracks(tracks, kept), observed(of_tracks(parts, kept)), verdicts[kept], segments


def find_places(
    scans: Scans, tracks: Tracks, parts: Tracks, verdicts: Verdicts, settings: Settings, workers: int
) -> Places:
    """Return the places occupied by movers that static objects occupied in many more scans."""
    bodies, parts = (rows[np.flatnonzero(verdicts.is_moving[rows.track])] for rows in (tracks, parts))
    columns, n = touched_columns(observed(bodies).boxes), len(scans.names)
    bodies_of_scan, parts_of_scan = bodies.rows_by_scan(n), parts.rows_by_scan(n)

    def held(i: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
        name, points = scans.names[i], scans.frames[i].points_level
        found, about = scans.instances.load(name, "ids", "stayed"), scans.candidates.load(name, "kind", "log_odds")
        here = bodies[bodies_of_scan[i]], parts[parts_of_scan[i]]
        track = paint_objects(points, about, found, *here, settings.tracking.completion, is_told_apart=True)
        stands = np.flatnonzero(about["kind"] == OBJECT)
        is_body, log_odds = track[stands] >= 0, about["log_odds"][stands]
        has_stayed = log_odds < -settings.instances.components.min_log_odds
        return held_places(points[stands], is_body, ~is_body & has_stayed, columns)

    asked = range(n) if len(columns) else ()
    return Places(count_places(map_in_order(held, asked, workers, threads=True)), verdicts.is_moving)


def without_standing(scans: Scans, parts: Tracks, places: Places, verdicts: Verdicts, workers: int) -> Verdicts:
    """Return `verdicts` by which a body has not moved if most of its points are at static `places`."""
    n, parts = len(verdicts.verdict), parts[np.flatnonzero(verdicts.is_moving[parts.track])]
    parts_of_scan = parts.rows_by_scan(len(scans.names))

    def count(i: int) -> Array:
        found = scans.instances.load(scans.names[i], "ids", "stayed")
        owner = tracks_of_points(found["ids"], found["stayed"], parts[parts_of_scan[i]])
        own = np.flatnonzero(owner >= 0)
        stands = places.static_points(scans.frames[i].points_level[own], owner[own])
        return np.stack([np.bincount(owner[own], minlength=n), np.bincount(owner[own], stands, n)])

    asked = [i for i, rows in enumerate(parts_of_scan) if len(rows)] if len(places.keys) else []
    total, standing = sum(map_in_order(count, asked, workers, threads=True), np.zeros((2, n)))
    stands = standing > 0.5 * total
    share = np.divide(standing, total, out=np.zeros(n), where=stands)
    verdict = np.where(stands, Verdict.STATIC, verdicts.verdict).astype(np.int8)
    return replace(verdicts, verdict=verdict, confidence=np.where(stands, share, verdicts.confidence))
