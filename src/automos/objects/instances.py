"""III-C: the segments of a scan, their boxes, and the numbers of their points that have moved."""

from functools import partial

import numpy as np

from automos.core.parallel import map_in_order
from automos.core.scan import OBJECT, Frame, Frames
from automos.core.stages import Arrays, PerScan, Stage
from automos.objects.detect import detect_objects
from automos.objects.detections import Detections
from automos.objects.paper.instances import find_instances
from automos.settings import InstancesSettings


def find_segments(
    frames: Frames, candidates: Stage, names: list[str], settings: InstancesSettings, workers: int, missing: list[int]
) -> PerScan:
    """Yield for each missing scan its segments, their boxes, and the numbers of points that have moved or stayed."""
    todo = ((frames[i], candidates.load(names[i])) for i in missing)
    threads = settings.method != "hdbscan"  # hdbscan holds the interpreter's lock
    found = map_in_order(partial(segment_frame, settings), todo, workers, threads)
    return zip(missing, found, strict=True)


def segment_frame(settings: InstancesSettings, task: tuple[Frame, Arrays]) -> Arrays:
    """Return the segments of a frame, their boxes and counts; `task` is the frame and its candidates."""
    return (_hdbscan if settings.method == "hdbscan" else _components)(settings, task)


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
