"""A Supervisely project of point cloud episodes: meta.json, and per episode pointcloud/*.pcd and annotation.json.

Points and boxes are in each scan's upright frame.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

from automos.core.atomic import write_text
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.pcd import write_pcd
from automos.writers.point_columns import seen_columns
from automos.writers.sustech import xyz

_COLORS = {"moving": "#E5484D", "static": "#8B8D98", "unknown": "#F5D90A"}


def write(run: RunFiles, out: Path) -> None:
    """Write the project folder `out` with one episode, named after the recording."""
    episode = out / run.sequence.name
    (episode / "pointcloud").mkdir(parents=True, exist_ok=True)
    frames = []
    for index in run.each("writing episode"):
        name, scan = run.names[index], run.scan(index)
        write_pcd(episode / "pointcloud" / f"{name}.pcd", seen_columns(scan, run.points_upright(scan, index))[0])
        frames.append({"index": index, "figures": _figures(run, index)})
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
    clouds = {str(index): f"{name}.pcd" for index, name in enumerate(run.names)}
    write_text(episode / "frame_pointcloud_map.json", json.dumps(clouds))


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


EXPORT = Export(writes="Supervisely project of point cloud episodes", write=write)
