"""The stages as the pipeline runs them: per-scan results in, per-scan results out, each by the method that is set.

Every method of a stage leaves the same arrays, so that methods can be combined freely:

    candidates   log_odds (M,) float16: has moved, against has stayed;  kind (M,) uint8;  height (M,) metres;
                 solidity (M,) uint8, 255 where all rays beside a point have met the same thing
    instances    ids (M,) int32, -1 for none;  boxes and counts of every segment (`Detections`)
    tracking     tracks and verdicts
    labels       label (N,), track (N,) and confidence (N,) uint8, one per point of the user's scan;  n_body, how many
                 of them ride along with the sensor
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import islice

import numpy as np
import numpy.typing as npt

from automos.baselines.methods import BASELINES
from automos.candidates.cue import add_cue, read_cue
from automos.candidates.erasor import PUBLISHED
from automos.candidates.free_space import FreeSpace
from automos.candidates.free_space_pattern import learn_pattern
from automos.candidates.ground import fit_ground, is_on_ground
from automos.detections import Detections
from automos.instances.detect import detect_objects
from automos.instances.find import find_instances
from automos.labels import Label
from automos.parallel import available_cores, map_in_order
from automos.scan import EGO_BODY, GROUND, OBJECT, Frame, Frames
from automos.settings import InstancesSettings, SelfTrainingSettings, Settings
from automos.tracking.completion import paint_objects, tracks_of_points
from automos.tracking.confidence import point_confidence
from automos.tracking.judge import judge_by_evidence, without_scenery
from automos.tracking.painting import paint_points
from automos.tracking.places import Places, count_places, held_places, touched_columns
from automos.tracking.smoothing import smooth_tracks
from automos.tracking.tracker import track_objects
from automos.tracking.tracks import Tracks
from automos.tracking.unfollowed import can_follow, find_moved
from automos.tracking.verdict import Verdicts, judge_by_trajectory
from automos.workspace import Arrays, Stage

PerScan = Iterable[tuple[int, Arrays]]
_CERTAIN = 4.0
"""Log-odds of a point that a method only calls moving, or not."""


# ---------------------------------------------------------------------------------------------------- candidates
def find_candidates(
    frames: Frames, stamps: npt.NDArray, settings: Settings, workers: int, missing: list[int]
) -> PerScan:
    """Yield for each missing scan how each of its points may have moved, and what kind of point it is."""
    find = _free_space if settings.candidates.method == "free_space" else _moving_points
    return find(frames, stamps, settings, workers, range(missing[0], missing[-1] + 1))


def add_network_cue(
    find: Callable[[list[int]], PerScan],
    frames: Frames,
    names: list[str],
    settings: SelfTrainingSettings,
    missing: list[int],
) -> PerScan:
    """Yield what `find` finds; where a network's word on each point is at hand, it is added (self-training)."""
    for i, arrays in find(missing):
        if not settings.folder:
            yield i, arrays
            continue
        frame = frames[i]
        probability = read_cue(settings, names[i], frame.n_points)[frame.kept]
        yield i, {**arrays, "log_odds": add_cue(arrays["log_odds"], probability, settings)}


def _moving_points(frames: Frames, stamps: npt.NDArray, settings: Settings, workers: int, scans: range) -> PerScan:
    pattern = learn_pattern([frames[i] for i in np.unique(np.linspace(0, len(frames) - 1, 5).astype(int))])
    ray_steps = np.array([pattern.row_height, pattern.column_width])
    find_moving = BASELINES[settings.candidates.method].find_moving
    for i, is_moving in islice(find_moving(frames, stamps, settings, scans.start), len(scans)):
        frame = frames[i]
        points, ground = frame.points_level, settings.candidates.ground
        surface = fit_ground(points, frame.origin_level, ground)
        kind = np.where(is_on_ground(points, frame.origin_level, surface, ground), GROUND, OBJECT).astype(np.uint8)
        kind[np.hypot(frame.points[:, 0], frame.points[:, 1]) < PUBLISHED.ego_radius] = EGO_BODY
        height = points[:, 2] - surface.height_at(points)
        solidity = np.full(len(kind), 255, np.uint8)
        yield i, candidates_of(np.where(is_moving, _CERTAIN, -_CERTAIN), kind, height, solidity, ray_steps)


def _free_space(frames: Frames, stamps: npt.NDArray, settings: Settings, workers: int, scans: range) -> PerScan:
    about = settings.candidates
    space = FreeSpace(frames, stamps, about.free_space, about.ground, about.ego_body, workers or available_cores())
    ray_steps = space.ray_steps
    for i, evidence in space.collect(scans.start, scans.stop):
        yield i, candidates_of(evidence.net, evidence.kind, evidence.height, evidence.solidity, ray_steps)


def candidates_of(
    log_odds: npt.NDArray, kind: npt.NDArray, height: npt.NDArray, solidity: npt.NDArray, ray_steps: npt.NDArray
) -> Arrays:
    """Return what is known of a scan's points (M,), as it is kept."""
    half = np.float16
    per_point = {"log_odds": log_odds.astype(half), "kind": kind, "height": height.astype(half), "solidity": solidity}
    return {**per_point, "ray_steps": ray_steps}


# ----------------------------------------------------------------------------------------------------- instances
def find_segments(
    frames: Frames, candidates: Stage, names: list[str], settings: InstancesSettings, workers: int, missing: list[int]
) -> PerScan:
    """Yield for each missing scan its segments, their boxes, and how many of their points have moved or stayed."""
    todo = ((frames[i], candidates.load(names[i])) for i in missing)
    threads = settings.method != "hdbscan"  # which holds the interpreter's lock
    found = map_in_order(partial(segment_frame, settings), todo, workers, threads)
    return zip(missing, found, strict=True)


def segment_frame(settings: InstancesSettings, task: tuple[Frame, Arrays]) -> Arrays:
    """Return the segments of a frame, their boxes and counts; `task` is the frame and what was found of its points."""
    return (_hdbscan if settings.method == "hdbscan" else _components)(settings, task)


def _hdbscan(settings: InstancesSettings, task: tuple[Frame, Arrays]) -> Arrays:
    frame, about = task
    horizontal = np.hypot(frame.points[:, 0], frame.points[:, 1])
    is_eligible = (about["kind"] == OBJECT) & (horizontal < settings.max_range)
    is_candidate = (about["log_odds"] > 0.0).astype(np.float64)
    instances = find_instances(frame.points_level, is_candidate, is_eligible, settings.hdbscan)
    ids, n = instances.ids, len(instances.boxes)
    inside = ids >= 0
    points = np.bincount(ids[inside], minlength=n).astype(np.float64)
    moved = np.bincount(ids[inside], is_candidate[inside], n).astype(np.float64)
    found = Detections.of_objects(instances.boxes, points, moved, points - moved)
    return {"ids": ids, "stayed": np.full_like(ids, -1), **found.to_arrays()}


def _components(settings: InstancesSettings, task: tuple[Frame, Arrays]) -> Arrays:
    frame, about = task
    ids, stayed = np.full((2, len(frame.points)), -1, np.int32)
    objects = np.flatnonzero(about["kind"] == OBJECT)
    ids[objects], stayed[objects], found = detect_objects(
        np.take(frame.points_level, objects, axis=0),
        frame.origin_level,
        about["log_odds"][objects].astype(np.float32),
        about["height"][objects].astype(np.float32),
        about["solidity"][objects],
        tuple(about["ray_steps"]),
        settings.components,
    )
    return {"ids": ids, "stayed": stayed, **found.to_arrays()}


# ------------------------------------------------------------------------------------------------------ tracking
def follow_and_judge(
    frames: Frames, candidates: Stage, instances: Stage, names: list[str], settings: Settings, workers: int
) -> Arrays:
    """Return the tracks of all objects, the verdict on each, and the places that what stays beside movers has held."""
    tracking, stamps = settings.tracking, frames.stamps
    detections = [Detections.from_arrays(instances.load(name, *Detections.columns())) for name in names]
    if tracking.method != "paper" and not can_follow(stamps):
        detections = [of_scan[np.zeros(0, np.int64)] for of_scan in detections]
    tracks = track_objects(zip(stamps, detections, strict=True), tracking)
    if tracking.method == "paper":
        return {**tracks.to_arrays(), **judge_by_trajectory(tracks, tracking.verdict).to_arrays()}
    verdicts = judge_by_evidence(tracks, detections, tracking.judge)
    tracks, verdicts = without_scenery(tracks, verdicts, detections)
    tracks = smooth_tracks(tracks, verdicts.is_moving, detections, stamps)
    places = find_places(frames, candidates, instances, names, tracks, verdicts, settings, workers)
    return {**tracks.to_arrays(), **verdicts.to_arrays(), **places.to_arrays()}


def find_places(
    frames: Frames,
    candidates: Stage,
    instances: Stage,
    names: list[str],
    tracks: Tracks,
    verdicts: Verdicts,
    settings: Settings,
    workers: int,
) -> Places:
    """Return the places of those that movers have held which what stays has held in more scans."""
    moving = tracks[np.flatnonzero(verdicts.is_moving[tracks.track] & tracks.is_observed)]
    columns = touched_columns(moving.boxes)
    by_scan = np.argsort(moving.scan, kind="stable")
    first = np.searchsorted(moving.scan[by_scan], np.arange(len(names) + 1))

    def held(i: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        found, about = instances.load(names[i], "ids", "stayed"), candidates.load(names[i], "kind", "log_odds")
        stands, here = np.flatnonzero(about["kind"] == OBJECT), moving[by_scan[first[i] : first[i + 1]]]
        track = tracks_of_points(found["ids"][stands], found["stayed"][stands], here)
        has_stayed = about["log_odds"][stands] < -settings.instances.components.min_log_odds
        return held_places(frames[i].points_level[stands], track >= 0, (track < 0) & has_stayed, columns)

    scans = range(len(names)) if len(columns) else ()
    return Places(count_places(map_in_order(held, scans, workers, threads=True)), verdicts.is_moving)


# -------------------------------------------------------------------------------------------------------- labels
def paint(
    frames: Frames,
    candidates: Stage,
    instances: Stage,
    names: list[str],
    tracks: Tracks,
    verdicts: Verdicts,
    places: Places | None,
    settings: Settings,
    workers: int,
    missing: list[int],
) -> PerScan:
    """Yield for each missing scan every point's label, the moving track it belongs to, and how sure that is."""
    is_followed = settings.tracking.method == "paper" or can_follow(frames.stamps)
    by_scan = np.argsort(tracks.scan, kind="stable")
    first = np.searchsorted(tracks.scan[by_scan], np.arange(len(names) + 1))

    def paint_scan(i: int) -> Arrays:
        rows = by_scan[first[i] : first[i + 1]]
        found, about = instances.load(names[i]), candidates.load(names[i], "kind", "log_odds")
        return paint_frame(frames[i], about, found, tracks[rows], verdicts, places, settings, is_followed)

    return zip(missing, map_in_order(paint_scan, missing, workers, threads=True), strict=True)


def paint_frame(
    frame: Frame,
    about: Mapping[str, npt.NDArray],
    found: Mapping[str, npt.NDArray],
    here: Tracks,
    verdicts: Verdicts,
    places: Places | None,
    settings: Settings,
    is_followed: bool,
) -> dict[str, npt.NDArray]:
    """Return every point's label, the moving track it belongs to, and how sure that is.

    about, found : the frame's candidates and instances.   here : the rows of all tracks in it.
    places : of what stays beside movers, where that is known.
    is_followed : whether scans follow each other fast enough for tracks to be trusted.
    """
    is_moving = verdicts.is_moving[here.track]
    if settings.labels.moving == "now":
        is_moving &= np.linalg.norm(here.velocity, axis=1) >= settings.labels.now_speed
    moving = here[np.flatnonzero(is_moving)]
    if settings.tracking.method == "paper":
        label, track = paint_points(frame.points_level, found["ids"], moving)
    else:
        may_move = (about["kind"] != EGO_BODY) & (about["log_odds"] >= 0.0)
        label, track = paint_objects(
            frame.points_level, found["ids"], found["stayed"], about["kind"] == GROUND, may_move, moving,
            settings.tracking.completion,
        )  # fmt: skip
        if places is not None:
            stands = places.static_points(frame.points_level, track)
            label[stands], track[stands] = Label.STATIC, -1
        label[about["kind"] == EGO_BODY] = Label.UNLABELED
    owner = np.where(track >= 0, track, tracks_of_points(found["ids"], found["stayed"], here))
    confidence = point_confidence(track >= 0, owner, verdicts.confidence, about["log_odds"], about["kind"])
    if not is_followed:
        moves = find_moved(found["ids"], Detections.from_arrays(found))
        label[moves] = Label.MOVING
        confidence[moves] = np.round(255.0 / (1.0 + np.exp(-about["log_odds"][moves].astype(np.float32))))
    label[confidence < np.float32(255.0 * settings.labels.unsure)] = Label.UNLABELED
    per_point = {"label": frame.scatter(label), "track": frame.scatter(track, fill=-1)}
    n_body = np.array(np.count_nonzero(about["kind"] == EGO_BODY))
    return {**per_point, "confidence": frame.scatter(confidence), "n_body": n_body}
