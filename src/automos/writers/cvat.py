"""Cuboids for CVAT, in Datumaro's 3D format.

A task is made of the files in point_clouds/default; its annotations are uploaded from annotations.zip as "Datumaro 3D
1.0". Points and boxes are in each scan's upright frame. KITTI's tracklets, which CVAT takes as well, are not written:
CVAT reads their width, height and length as x, y and z, so that a file right for KITTI is wrong there.
"""

import json
import zipfile
from pathlib import Path
from typing import Any

from automos.core.atomic import atomic_path, write_text
from automos.results.run_files import RunFiles
from automos.results.tracks_file import VERDICTS
from automos.writers.formats import Export
from automos.writers.pcd import write_pcd
from automos.writers.point_columns import seen_columns

ANNOTATIONS = "annotations/default.json"
CLOUDS = "point_clouds/default"
_POINT_CLOUD = 6
"""Datumaro's number for what the items are of; CVAT itself does not ask."""


def write(run: RunFiles, out: Path) -> None:
    """Write point_clouds/default/*.pcd, annotations/default.json and the same as annotations.zip into `out`."""
    for folder in (CLOUDS, "annotations"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    items = []
    for index in run.each("writing task"):
        name, scan = run.names[index], run.scan(index)
        write_pcd(out / CLOUDS / f"{name}.pcd", seen_columns(scan, run.points_upright(scan, index))[0])
        items.append(_item(run, index))
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


def _item(run: RunFiles, index: int) -> dict[str, Any]:
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
    name = run.names[index]
    return {
        "id": name,
        "annotations": annotations,
        "attr": {"frame": index},
        "point_cloud": {"path": f"{name}.pcd"},
    }


EXPORT = Export(
    writes="CVAT task: point_clouds/, annotations.zip (Datumaro 3D)",
    write=write,
    per_scan=("point_clouds/default/*.pcd",),
)
