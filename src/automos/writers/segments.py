"""Sequences for Segments.ai: the sample and its cuboid and segmentation labels, as its Python SDK uploads them.

Points are in the sensor frame, the sensor's motion during a sweep taken out; `ego_pose` places each scan in a world
with z up, in which the cuboids are.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.atomic import atomic_path, write_text
from automos.core.geometry import quaternion_of
from automos.core.labels import Label
from automos.core.scan import Mask, Pose
from automos.results.run_files import RunFiles
from automos.results.tracks_file import VERDICTS
from automos.writers.annotation_tools import xyz
from automos.writers.formats import Export, make_folders
from automos.writers.point_columns import seen_columns, write_pcd

CATEGORIES = {verdict: number for number, verdict in enumerate(VERDICTS, start=1)}
"""Ids of the categories to be made in the dataset."""


def write(run: RunFiles, out: Path) -> None:
    """Write pointclouds/*.pcd, sample.json, cuboids.json, segmentation.json and categories.json into `out`.

    The `url` of each cloud in sample.json is its path below `out`; upload the clouds and put their addresses there. In
    segmentation.json static points are object 1, unlabeled ones 0, and each moving object has an id of its own.
    """
    make_folders(out, "pointclouds")
    samples, cuboids, loose = [], [], max(run.tracks, default=0) + 2
    # Scan by scan: a number for every point of an hour is more than memory holds.
    with atomic_path(out / "segmentation.json") as temporary, temporary.open("w", encoding="utf-8") as segmentation:
        segmentation.write('{"format_version": "0.2", "frames": [')
        for index in run.each("writing sample"):
            name, scan = run.names[index], run.scan(index)
            columns, is_finite = seen_columns(scan, run.points_at_pose(scan, index))
            write_pcd(out / "pointclouds" / f"{name}.pcd", columns)
            timestamp = round(1e9 * run.stamps[index])
            samples.append(
                {
                    "name": name,
                    "timestamp": timestamp,
                    "pcd": {"url": f"pointclouds/{name}.pcd", "type": "pcd"},
                    "ego_pose": _ego_pose(run.T_level_sensor(index)),
                }
            )
            cuboids.append({"format_version": "0.2", "timestamp": timestamp, "annotations": _cuboids(run, index)})
            segmentation.write((", " if index else "") + json.dumps(_segmentation(run, index, is_finite, loose)))
        segmentation.write("]}")
    write_text(out / "sample.json", json.dumps({"frames": samples}))
    write_text(out / "cuboids.json", json.dumps({"format_version": "0.2", "frames": cuboids}))
    categories = [{"id": number, "name": verdict, "has_instances": True} for verdict, number in CATEGORIES.items()]
    write_text(out / "categories.json", json.dumps({"format_version": "0.1", "categories": categories}, indent=1))


def _ego_pose(T: Pose) -> dict[str, Any]:
    heading = {f"q{part}": round(float(value), 9) for part, value in zip("xyzw", quaternion_of(T), strict=True)}
    return {"position": xyz(T[:3, 3]), "heading": heading}


def _cuboids(run: RunFiles, index: int) -> list[dict[str, Any]]:
    return [
        {
            "id": box.id,
            "category_id": CATEGORIES[box.verdict],
            "type": "cuboid",
            "position": xyz(box.center),
            "dimensions": xyz(box.size),
            "yaw": round(box.yaw, 6),
            "is_keyframe": True,
            "track_id": box.id,
            "index": index,
        }
        for box in run.boxes_level(index)
    ]


def _segmentation(run: RunFiles, index: int, is_finite: Mask, loose: int) -> dict[str, Any]:
    """Return one frame of the points that are written, `is_finite` (N,).

    Object 1 is all that is static, the moving track k is k + 1, and what moves on no track is `loose`.
    """
    label, instance = (of(index, len(is_finite))[is_finite] for of in (run.labels, run.instances))
    objects = np.select([label == Label.MOVING, label == Label.STATIC], [instance + 1, 1], 0)
    objects[(label == Label.MOVING) & (instance == 0)] = loose
    found = [int(number) for number in np.unique(objects) if number > 0]
    annotations = [
        {"id": number, "category_id": CATEGORIES["static" if number == 1 else "moving"], "track_id": number}
        for number in found
    ]
    return {"format_version": "0.2", "annotations": annotations, "point_annotations": objects.tolist()}


EXPORT = Export(writes="Segments.ai sample, cuboids and segmentation", write=write, per_scan=("pointclouds/*.pcd",))
