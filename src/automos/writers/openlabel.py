"""ASAM OpenLABEL 1.0: objects with a cuboid per frame in a world frame with z up, and the sensor's pose in it."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.atomic import write_text
from automos.core.claims import SIGN
from automos.results.run_files import RunFiles
from automos.writers.formats import Export

_WORLD, _SENSOR = "world", "lidar"


def write(run: RunFiles, out: Path) -> None:
    """Write the JSON file `out`; an object's type is moving, static or unknown."""
    frames: dict[str, Any] = {}
    tracks = run.tracks
    seen: dict[int, list[int]] = {track: [] for track in tracks}
    for index in run.each("writing objects"):
        objects = {}
        for box in run.boxes_level(index):
            values = [*box.center, 0.0, 0.0, np.sin(0.5 * box.yaw), np.cos(0.5 * box.yaw), *box.size]
            cuboid = {
                "name": "box",
                "coordinate_system": _WORLD,
                "val": [round(float(value), 6) for value in values],
                "attributes": {"boolean": [{"name": "observed", "val": box.is_observed}]},
            }
            objects[str(box.id)] = {"object_data": {"cuboid": [cuboid]}}
            seen[box.id].append(index)
        T = run.T_level_sensor(index)
        transforms = {
            f"{_SENSOR}_to_{_WORLD}": {
                "src": _SENSOR,
                "dst": _WORLD,
                "transform_src_to_dst": {"matrix4x4": T.round(9).ravel().tolist()},
            }
        }
        frames[str(index)] = {
            "frame_properties": {"timestamp": f"{run.stamps[index]:.6f}", "transforms": transforms},
            "objects": objects,
        }
    content = {
        "metadata": {
            "schema_version": "1.0.0",
            "name": run.sequence.name,
            "annotator": "automos",
            "comment": SIGN.decode(),
        },
        "coordinate_systems": {
            _WORLD: {"type": "scene_cs", "parent": "", "children": [_SENSOR]},
            _SENSOR: {"type": "sensor_cs", "parent": _WORLD, "children": []},
        },
        "frame_intervals": [{"frame_start": 0, "frame_end": len(run) - 1}],
        "frames": frames,
        "objects": {str(track): _object(track, scans, *tracks[track]) for track, scans in seen.items()},
    }
    out.parent.mkdir(parents=True, exist_ok=True)
    write_text(out, json.dumps({"openlabel": content}))


def _object(track: int, scans: list[int], verdict: str, confidence: float) -> dict[str, Any]:
    runs = np.split(scans, np.flatnonzero(np.diff(scans) > 1) + 1) if scans else []
    return {
        "name": f"object {track}",
        "type": verdict,
        "frame_intervals": [{"frame_start": int(part[0]), "frame_end": int(part[-1])} for part in runs],
        "object_data": {"num": [{"name": "confidence", "val": confidence}]},
    }


EXPORT = Export(writes="ASAM OpenLABEL 1.0, one JSON file", write=write, suffix=".json")
