"""A data set in nuScenes' tables: v1.0-automos/*.json, the sweeps, and a class for every point (lidarseg).

The world is the level frame: z up, the ground under the first scan at 0. The sensor is the vehicle. Every scan is a
sample. Boxes are of what moves, and kinds go by size.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.atomic import atomic_path, write_raw, write_text
from automos.core.labels import Label
from automos.core.scan import Pose
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.kinds import Kinds, kinds_of_tracks
from automos.writers.movers import only_moving

VERSION, CHANNEL = "v1.0-automos", "LIDAR_TOP"
CATEGORIES = ("noise", "static.other", "vehicle.car", "human.pedestrian.adult", "vehicle.bicycle", "animal")
"""By their index, in names that the devkit has colours for: no label, static, what `KINDS` names, moves on no track."""
_ATTRIBUTES = ("vehicle.moving", "pedestrian.moving", "cycle.with_rider")
Table = list[dict[str, Any]]


def write(run: RunFiles, out: Path) -> None:
    """Write the root of a data set to `out`, with one scene, named after the recording."""
    for folder in (VERSION, f"samples/{CHANNEL}", f"lidarseg/{VERSION}", "maps"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    name = _Tokens(run.sequence.name)
    tables = _fixed_tables(run, name)
    kinds = kinds_of_tracks(run)
    micro = np.round(1e6 * (run.stamps - min(0.0, float(run.stamps[0])))).astype(np.int64).tolist()
    for index in run.each("writing tables"):
        file = f"samples/{CHANNEL}/{index:06d}.pcd.bin"
        points, classes = _points(run, index, kinds)
        write_raw(out / file, points)
        labels = f"lidarseg/{VERSION}/{name('data', index)}_lidarseg.bin"
        write_raw(out / labels, classes)
        for table, row in _rows_of_scan(run, index, name, micro[index], file).items():
            tables.setdefault(table, []).append(row)
        tables.setdefault("lidarseg", []).append(
            {"token": name("data", index), "sample_data_token": name("data", index), "filename": labels}
        )
    tables |= _objects(run, name, kinds)
    with atomic_path(out / "maps" / "empty.png") as temporary:
        _draw_nothing(temporary)
    for table, rows in tables.items():
        write_text(out / VERSION / f"{table}.json", json.dumps(rows, indent=0))


class _Tokens:
    """Tokens of 32 hexadecimal digits, the same whenever the same thing is named."""

    def __init__(self, recording: str):
        self._recording = recording

    def __call__(self, *parts: object) -> str:
        return hashlib.sha256(repr((self._recording, *parts)).encode()).hexdigest()[:32]


def _fixed_tables(run: RunFiles, name: _Tokens) -> dict[str, Table]:
    """Return the tables that have a row or some, however long the recording is."""
    last = len(run) - 1
    scene = {"token": name("scene"), "log_token": name("log"), "name": run.sequence.name, "nbr_samples": len(run)}
    scene |= {"first_sample_token": name("sample", 0), "last_sample_token": name("sample", last)}
    levels = {"1": "v0-40", "4": "v80-100"}
    return {
        "category": [
            {"token": name("category", k), "name": category, "description": "", "index": k}
            for k, category in enumerate(CATEGORIES)
        ],
        "attribute": [{"token": name("attribute", k), "name": a, "description": ""} for k, a in enumerate(_ATTRIBUTES)],
        "visibility": [{"token": token, "level": level, "description": ""} for token, level in levels.items()],
        "sensor": [{"token": name("sensor"), "channel": CHANNEL, "modality": "lidar"}],
        "calibrated_sensor": [
            {"token": name("mount"), "sensor_token": name("sensor"), **_pose(np.eye(4)), "camera_intrinsic": []}
        ],
        "log": [
            {"token": name("log"), "logfile": run.sequence.name, "vehicle": "", "date_captured": "", "location": ""}
        ],
        "scene": [{**scene, "description": "moving objects labelled by automos"}],
        "map": [
            {
                "token": name("map"),
                "log_tokens": [name("log")],
                "category": "semantic_prior",
                "filename": "maps/empty.png",
            }
        ],
    }


def _rows_of_scan(run: RunFiles, index: int, name: _Tokens, micro: int, file: str) -> dict[str, dict[str, Any]]:
    chain = {kind: _chain(name, kind, index, len(run)) for kind in ("sample", "data")}
    return {
        "ego_pose": {"token": name("pose", index), "timestamp": micro, **_pose(run.T_level_sensor(index))},
        "sample": {"token": name("sample", index), "timestamp": micro, "scene_token": name("scene"), **chain["sample"]},
        "sample_data": {
            "token": name("data", index),
            "sample_token": name("sample", index),
            "ego_pose_token": name("pose", index),
            "calibrated_sensor_token": name("mount"),
            "timestamp": micro,
            "fileformat": "pcd",
            "is_key_frame": True,
            "height": 0,
            "width": 0,
            "filename": file,
            **chain["data"],
        },
    }


def _chain(name: _Tokens, kind: str, index: int, count: int) -> dict[str, str]:
    before = name(kind, index - 1) if index else ""
    return {"prev": before, "next": name(kind, index + 1) if index + 1 < count else ""}


def _pose(T: Pose) -> dict[str, list[float]]:
    from scipy.spatial.transform import Rotation

    quaternion = Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True)
    return {"translation": T[:3, 3].round(6).tolist(), "rotation": np.roll(quaternion, 1).round(9).tolist()}


def _points(run: RunFiles, index: int, kinds: Kinds) -> tuple[Any, Any]:
    """Return (M, 5) float32 x, y, z, intensity, ring of the points of use, and (M,) uint8 their categories."""
    scan = run.scan(index)
    nothing = np.zeros(len(scan), np.float32)
    intensity = nothing if scan.intensity is None else np.nan_to_num(scan.intensity)
    ring = nothing if scan.ring is None else scan.ring
    rows = np.column_stack([run.points_at_pose(scan, index), intensity, ring]).astype(np.float32)
    labels, tracks = run.labels(index, len(scan)), run.instances(index, len(scan))
    moving = np.where(tracks > 0, kinds(tracks) + 2, len(CATEGORIES) - 1)
    classes = np.select([labels == Label.MOVING, labels == Label.STATIC], [moving, 1], 0)
    return rows[scan.is_valid], classes[scan.is_valid].astype(np.uint8)


def _objects(run: RunFiles, name: _Tokens, kinds: Kinds) -> dict[str, Table]:
    """Return the tables of what moves: a row for each object, and one for each of its boxes."""
    seen: dict[int, Table] = {}
    kind_of: dict[int, int] = {}
    for index in range(len(run)):
        found = only_moving(run.boxes_level(index))
        if not len(found):
            continue
        counts = np.bincount(run.instances(index, len(run.scan(index))), minlength=int(found.ids.max()) + 1)
        kind = kinds(found.ids)
        for k, track in enumerate(found.ids.tolist()):
            kind_of[track] = int(kind[k])
            yaw = found.boxes.yaw[k]
            turned = [float(np.cos(0.5 * yaw)), 0.0, 0.0, float(np.sin(0.5 * yaw))]
            row = {
                "token": name("box", track, index),
                "sample_token": name("sample", index),
                "instance_token": name("object", track),
                "visibility_token": "4" if found.observed[k] else "1",
                "attribute_tokens": [name("attribute", kind_of[track])],
                "translation": found.boxes.center[k].round(4).tolist(),
                "size": found.boxes.size[k, [1, 0, 2]].round(4).tolist(),
                "rotation": turned,
                "num_lidar_pts": int(counts[track]),
                "num_radar_pts": 0,
                "prev": seen[track][-1]["token"] if track in seen else "",
                "next": "",
            }
            if track in seen:
                seen[track][-1]["next"] = row["token"]
            seen.setdefault(track, []).append(row)
    instances = [
        {
            "token": name("object", track),
            "category_token": name("category", kind_of[track] + 2),
            "nbr_annotations": len(rows),
            "first_annotation_token": rows[0]["token"],
            "last_annotation_token": rows[-1]["token"],
        }
        for track, rows in seen.items()
    ]
    return {"instance": instances, "sample_annotation": [row for rows in seen.values() for row in rows]}


def _draw_nothing(path: Path) -> None:
    """Write the picture of a map on which nothing is: the devkit asks for one."""
    from PIL import Image

    Image.new("L", (1, 1)).save(path, "PNG")


EXPORT = Export(writes="nuScenes data set: v1.0-automos/*.json, samples, lidarseg", write=write)
