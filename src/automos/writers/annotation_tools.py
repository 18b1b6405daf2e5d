"""Clouds and boxes in the upright frame of each scan, so that boxes turn about z only, for tools that correct them.

SUSTechPOINTS: the folder is put into its data folder. Supervisely: a project of point cloud episodes. CVAT: a task is
made of the files in point_clouds/default; its annotations, in the 3D format of Datumaro, are uploaded from
annotations.zip as "Datumaro 3D 1.0". The tracklets of KITTI, which CVAT takes as well, are not written: CVAT reads
their width, height and length as x, y and z, so that a file right for KITTI is wrong there.
"""

import hashlib
import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path, write_text
from automos.results.run_files import RunFiles
from automos.results.tracks_file import VERDICTS
from automos.writers.formats import Export, make_folders
from automos.writers.point_columns import seen_columns, write_pcd


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
                "psr": {
                    "position": xyz(box.center),
                    "scale": xyz(box.size),
                    "rotation": xyz((0.0, 0.0, box.yaw)),
                },
                "obj_type": box.verdict.capitalize(),
                "obj_id": str(box.id),
            }
            for box in run.boxes_upright(index)
        ]
        write_text(out / "label" / f"{name}.json", json.dumps(boxes))


def xyz(values: npt.ArrayLike) -> dict[str, float]:
    """Return three numbers by their axes' names."""
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
        "key": _key(run, "episode"),
        "tags": [],
        "objects": [
            {"key": _key(run, track), "classTitle": verdict, "tags": []} for track, (verdict, _) in run.tracks.items()
        ],
        "framesCount": len(run),
        "frames": frames,
    }
    classes = [
        {"title": title, "shape": "cuboid_3d", "color": color, "geometry_config": {}, "hotkey": ""}
        for title, color in _COLORS.items()
    ]
    write_text(out / "meta.json", json.dumps({"classes": classes, "tags": [], "projectType": "point_cloud_episodes"}))
    write_text(out / "key_id_map.json", json.dumps({"tags": {}, "objects": {}, "figures": {}, "videos": {}}))
    write_text(episode / "annotation.json", json.dumps(annotation))
    cloud_of = {str(index): f"{name}.pcd" for index, name in enumerate(run.names)}
    write_text(episode / "frame_pointcloud_map.json", json.dumps(cloud_of))


def _figures(run: RunFiles, index: int) -> list[dict[str, Any]]:
    return [
        {
            "key": _key(run, box.id, index),
            "objectKey": _key(run, box.id),
            "geometryType": "cuboid_3d",
            "geometry": {
                "position": xyz(box.center),
                "rotation": xyz((0.0, 0.0, box.yaw)),
                "dimensions": xyz(box.size),
            },
        }
        for box in run.boxes_upright(index)
    ]


def _key(run: RunFiles, *parts: object) -> str:
    """Return 32 hexadecimal digits, the same whenever the same thing is written."""
    return hashlib.sha256(repr((run.sequence.name, *parts)).encode()).hexdigest()[:32]


ANNOTATIONS = "annotations/default.json"
CLOUDS = "point_clouds/default"
_POINT_CLOUD = 6
"""Datumaro's number for what the items are of; CVAT itself does not ask."""


def _write_cvat(run: RunFiles, out: Path) -> None:
    """Write point_clouds/default/*.pcd, annotations/default.json and the same as annotations.zip into `out`."""
    make_folders(out, CLOUDS, "annotations")
    items = [_item(run, index, name) for index, name in _each_cloud(run, out / CLOUDS, "writing task")]
    labels = [{"name": verdict, "parent": "", "attributes": []} for verdict in VERDICTS]
    document = {
        "info": {},
        "media_type": _POINT_CLOUD,
        "categories": {"label": {"labels": labels, "attributes": ["occluded"]}, "points": {"items": []}},
        "items": items,
    }
    text = json.dumps(document)
    write_text(out / ANNOTATIONS, text)
    with atomic_path(out / "annotations.zip") as temporary, zipfile.ZipFile(temporary, "w") as archive:
        archive.writestr(zipfile.ZipInfo(ANNOTATIONS), text, zipfile.ZIP_DEFLATED)


def _item(run: RunFiles, index: int, name: str) -> dict[str, Any]:
    annotations = [
        {
            "id": k,
            "type": "cuboid_3d",
            "attributes": {
                "occluded": not box.is_observed,
                "track_id": box.id,
                "keyframe": True,
                "outside": False,
            },
            "group": 0,
            "label_id": VERDICTS.index(box.verdict),
            "position": box.center.round(6).tolist(),
            "rotation": [0.0, 0.0, round(box.yaw, 6)],
            "scale": box.size.round(6).tolist(),
        }
        for k, box in enumerate(run.boxes_upright(index))
    ]
    return {
        "id": name,
        "annotations": annotations,
        "attr": {"frame": index},
        "point_cloud": {"path": f"{name}.pcd"},
    }


EXPORTS = {
    "cvat": Export(
        writes="CVAT task: point_clouds/, annotations.zip (Datumaro 3D)",
        write=_write_cvat,
        per_scan=("point_clouds/default/*.pcd",),
    ),
    "supervisely": Export(writes="Supervisely project of point cloud episodes", write=_write_supervisely),
    "sustech": Export(
        writes="SUSTechPOINTS scene: lidar/*.pcd, label/*.json",
        write=_write_sustech,
        per_scan=("lidar/*.pcd", "label/*.json"),
    ),
}
