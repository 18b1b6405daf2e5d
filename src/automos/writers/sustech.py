"""A scene for SUSTechPOINTS: lidar/*.pcd and label/*.json; put the folder into the tool's data folder.

Points and boxes are in each scan's upright frame, so that boxes turn about z only.
"""

import json
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import write_text
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.pcd import write_pcd
from automos.writers.point_columns import seen_columns


def write(run: RunFiles, out: Path) -> None:
    """Write the scene folder `out`; `obj_type` is Moving, Static or Unknown, `obj_id` the track's number."""
    for folder in ("lidar", "label"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    for index in run.each("writing scene"):
        name, scan = run.names[index], run.scan(index)
        write_pcd(out / "lidar" / f"{name}.pcd", seen_columns(scan, run.points_upright(scan, index))[0])
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


EXPORT = Export(
    writes="SUSTechPOINTS scene: lidar/*.pcd, label/*.json", write=write, per_scan=("lidar/*.pcd", "label/*.json")
)
