"""Clouds and boxes in the upright frame of each scan, so that boxes turn about z only, for tools that correct them.

SUSTechPOINTS: the folder is put into its data folder. Supervisely: a project of point cloud episodes. CVAT: a task is
made of the files in point_clouds/default; its annotations, in the 3D format of Datumaro, are uploaded from
annotations.zip as "Datumaro 3D 1.0". The tracklets of KITTI, which CVAT takes as well, are not written: CVAT reads
their width, height and length as x, y and z, so that a file right for KITTI is wrong there.
Segments.ai: the sample and its cuboid and segmentation labels, as its Python SDK uploads them; points are in the sensor
frame, its motion during a sweep taken out, and `ego_pose` places each scan in a world with z up, as the cuboids.
"""

import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path, write_json, write_text
from automos.core.geometry import quaternion_of
from automos.core.labels import Label
from automos.core.scan import Mask
from automos.results.run_files import RunFiles
from automos.results.run_objects import Box
from automos.results.tracks_file import VERDICTS
from automos.writers.formats import Export, make_folders, seen_columns, token_of, write_pcd


def _each_cloud(run: RunFiles, folder: Path, what: str) -> Iterator[tuple[int, str]]:
    """Write the points of each scan, upright, as <name>.pcd into `folder`; yield the scans' numbers and names."""
    for index in run.each(what):
        name, scan = run.names[index], run.scan(index)
        write_pcd(folder / f"{name}.pcd", seen_columns(scan, run.points_upright(scan, index))[0])
        yield index, name


def _write_sustech(run: RunFiles, out: Path) -> None:
    """Write the scene folder `out`; `obj_type` is Moving, Static or Unknown, `obj_id` the track's number."""
    make_folders(out, "lidar", "label")
    for index, name in _each_cloud(run, out / "lidar", "writing scene"):
        boxes = [
            {
                "psr": _placed(box, position="center", scale="size", rotation="turn"),
                "obj_type": box.verdict.capitalize(),
                "obj_id": str(box.id),
            }
            for box in run.boxes_upright(index)
        ]
        write_json(out / "label" / f"{name}.json", boxes)


def _placed(box: Box, **called: str) -> dict[str, dict[str, float]]:
    """Return x, y, z of the box's `center`, `size` and `turn` about each axis, as a tool has them `called`."""
    values: dict[str, npt.ArrayLike] = {"center": box.center, "size": box.size, "turn": (0.0, 0.0, box.yaw)}
    return {theirs: _xyz(values[ours]) for theirs, ours in called.items()}


def _xyz(values: npt.ArrayLike) -> dict[str, float]:
    return {axis: round(float(value), 6) for axis, value in zip("xyz", np.asarray(values), strict=True)}


_COLORS = {"moving": "#E5484D", "static": "#8B8D98", "unknown": "#F5D90A"}


def _write_supervisely(run: RunFiles, out: Path) -> None:
    """Write the project folder `out` with one episode, named after the recording."""
    episode = out / run.sequence.name
    make_folders(episode, "pointcloud")
    clouds = _each_cloud(run, episode / "pointcloud", "writing episode")
    frames = [{"index": index, "figures": _figures(run, index)} for index, _ in clouds]
    annotation = {
        "description": "",
        "key": token_of(run, "episode"),
        "tags": [],
        "objects": [
            {"key": token_of(run, track), "classTitle": verdict, "tags": []}
            for track, (verdict, _) in run.tracks.items()
        ],
        "framesCount": len(run),
        "frames": frames,
    }
    classes = [
        {"title": title, "shape": "cuboid_3d", "color": color, "geometry_config": {}, "hotkey": ""}
        for title, color in _COLORS.items()
    ]
    write_json(out / "meta.json", {"classes": classes, "tags": [], "projectType": "point_cloud_episodes"})
    write_json(out / "key_id_map.json", {"tags": {}, "objects": {}, "figures": {}, "videos": {}})
    write_json(episode / "annotation.json", annotation)
    cloud_of = {str(index): f"{name}.pcd" for index, name in enumerate(run.names)}
    write_json(episode / "frame_pointcloud_map.json", cloud_of)


def _figures(run: RunFiles, index: int) -> list[dict[str, Any]]:
    return [
        {
            "key": token_of(run, box.id, index),
            "objectKey": token_of(run, box.id),
            "geometryType": "cuboid_3d",
            "geometry": _placed(box, position="center", rotation="turn", dimensions="size"),
        }
        for box in run.boxes_upright(index)
    ]


ANNOTATIONS = "annotations/default.json"
CLOUDS = "point_clouds/default"
_POINT_CLOUD = 6
"""Datumaro's number for what the items are of; CVAT itself does not ask."""


def _write_cvat(run: RunFiles, out: Path) -> None:
    """Write point_clouds/default/*.pcd, annotations/default.json and the same as annotations.zip into `out`."""
    make_folders(out, CLOUDS, "annotations")
    items = [
        {
            "id": name,
            "annotations": [_cuboid(number, box) for number, box in enumerate(run.boxes_upright(index))],
            "attr": {"frame": index},
            "point_cloud": {"path": f"{name}.pcd"},
        }
        for index, name in _each_cloud(run, out / CLOUDS, "writing task")
    ]
    labels = [{"name": verdict, "parent": "", "attributes": []} for verdict in VERDICTS]
    categories = {"label": {"labels": labels, "attributes": ["occluded"]}, "points": {"items": []}}
    text = json.dumps({"info": {}, "media_type": _POINT_CLOUD, "categories": categories, "items": items})
    write_text(out / ANNOTATIONS, text)
    with atomic_path(out / "annotations.zip") as temporary, zipfile.ZipFile(temporary, "w") as archive:
        archive.writestr(zipfile.ZipInfo(ANNOTATIONS), text, zipfile.ZIP_DEFLATED)


def _cuboid(number: int, box: Box) -> dict[str, Any]:
    attributes = {"occluded": not box.is_observed, "track_id": box.id, "keyframe": True, "outside": False}
    return {
        "id": number,
        "type": "cuboid_3d",
        "attributes": attributes,
        "group": 0,
        "label_id": VERDICTS.index(box.verdict),
        "position": box.center.round(6).tolist(),
        "rotation": [0.0, 0.0, round(box.yaw, 6)],
        "scale": box.size.round(6).tolist(),
    }


_CATEGORIES = {verdict: number for number, verdict in enumerate(VERDICTS, start=1)}
"""Ids of the categories to be made in the dataset."""


def _write_segments(run: RunFiles, out: Path) -> None:
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
            timestamp, T = round(1e9 * run.stamps[index]), run.T_level_sensor(index)
            heading = {f"q{part}": round(float(value), 9) for part, value in zip("xyzw", quaternion_of(T), strict=True)}
            ego_pose = {"position": _xyz(T[:3, 3]), "heading": heading}
            cloud = {"url": f"pointclouds/{name}.pcd", "type": "pcd"}
            samples.append({"name": name, "timestamp": timestamp, "pcd": cloud, "ego_pose": ego_pose})
            cuboids.append({"format_version": "0.2", "timestamp": timestamp, "annotations": _cuboids(run, index)})
            segmentation.write((", " if index else "") + json.dumps(_segmentation(run, index, is_finite, loose)))
        segmentation.write("]}")
    write_json(out / "sample.json", {"frames": samples})
    write_json(out / "cuboids.json", {"format_version": "0.2", "frames": cuboids})
    categories = [{"id": number, "name": verdict, "has_instances": True} for verdict, number in _CATEGORIES.items()]
    write_json(out / "categories.json", {"format_version": "0.1", "categories": categories}, indent=1)


def _cuboids(run: RunFiles, index: int) -> list[dict[str, Any]]:
    return [
        {
            "id": box.id,
            "category_id": _CATEGORIES[box.verdict],
            "type": "cuboid",
            **_placed(box, position="center", dimensions="size"),
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
    annotations = [
        {"id": number, "category_id": _CATEGORIES["static" if number == 1 else "moving"], "track_id": number}
        for number in np.unique(objects[objects > 0]).tolist()
    ]
    return {"format_version": "0.2", "annotations": annotations, "point_annotations": objects.tolist()}


EXPORTS = {
    "cvat": Export(
        "CVAT task: point_clouds/, annotations.zip (Datumaro 3D)", _write_cvat, per_scan=(f"{CLOUDS}/*.pcd",)
    ),
    "segments": Export(
        "Segments.ai sample, cuboids and segmentation", _write_segments, per_scan=("pointclouds/*.pcd",)
    ),
    "supervisely": Export("Supervisely project of point cloud episodes", _write_supervisely),
    "sustech": Export(
        "SUSTechPOINTS scene: lidar/*.pcd, label/*.json", _write_sustech, per_scan=("lidar/*.pcd", "label/*.json")
    ),
}
