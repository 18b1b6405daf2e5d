"""Tracks as nuScenes' tracking results, in the frame of poses.txt.

The sample token is the scan's name; sizes are width, length, height and quaternions scalar first, as nuScenes has them.
"""

import json
from pathlib import Path

import numpy as np

from automos.core.atomic import write_text
from automos.core.claims import SIGN
from automos.core.geometry import inverse, quaternion_of, transform
from automos.results.run_files import RunFiles
from automos.writers.formats import Export


def write(run: RunFiles, out: Path) -> None:
    """Write the JSON file `out`; `tracking_name` is moving, static or unknown, the score its confidence."""
    T_world_level = inverse(run.T_level_world)
    results: dict[str, list[dict[str, object]]] = {}
    for index in run.each("writing tracks"):
        found = run.boxes_level(index)
        translation = transform(T_world_level, found.boxes.center).round(4)
        velocity = (found.velocity @ T_world_level[:3, :3].T).round(4)
        results[run.names[index]] = [
            {
                "sample_token": run.names[index],
                "translation": translation[k].tolist(),
                "size": box.size[[1, 0, 2]].round(4).tolist(),
                "rotation": np.roll(quaternion_of(T_world_level @ box.pose), 1).round(9).tolist(),
                "velocity": velocity[k, :2].tolist(),
                "tracking_id": str(box.id),
                "tracking_name": box.verdict,
                "tracking_score": round(box.score, 4),
            }
            for k, box in enumerate(found)
        ]
    uses = {f"use_{sensor}": sensor == "lidar" for sensor in ("camera", "lidar", "radar", "map", "external")}
    out.parent.mkdir(parents=True, exist_ok=True)
    write_text(out, json.dumps({"meta": {**uses, "comment": SIGN.decode()}, "results": results}))


EXPORT = Export(writes="nuScenes tracking results, one JSON file", write=write, suffix=".json")
