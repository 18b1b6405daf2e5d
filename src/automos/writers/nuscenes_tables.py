"""A data set in nuScenes' tables: v1.0-automos/*.json, the sweeps, and a class for every point (lidarseg).

The world is the level frame: z up, the ground under the first scan at 0. The sensor is the vehicle. Every scan is a
sample. Boxes are of what moves. Tables have what TIER IV's T4 asks for beside, which the devkit leaves alone.
"""

from collections import defaultdict
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from automos.core.atomic import atomic_path, write_json, write_raw
from automos.core.labels import Label
from automos.core.scan import Pose
from automos.results.run_files import RunFiles
from automos.writers.formats import Export, intensity_of, make_folders, microseconds, scalar_first, token_of

_CATEGORIES = (
    "noise", "static.other",
    "vehicle.car", "vehicle.truck", "vehicle.bicycle", "human.pedestrian.adult", "animal",
)  # fmt: skip
"""By their index, in names that the devkit has colours for: no label, static, what moves by its `Kind`."""
_FIRST_KIND = 2
_ATTRIBUTES = ("vehicle.moving", "pedestrian.moving", "cycle.with_rider")
_ATTRIBUTES_OF_KIND = ((0,), (0,), (2,), (1,), ())
_LEVELS = {"full": "v80-100", "none": "v0-40"}
Name = Callable[..., str]
"""Returns the token of what its arguments name."""
Tables = dict[str, list[dict[str, Any]]]


class Layout(NamedTuple):
    """Where the parts lie below the root, and what the sensor and a log's day are called."""

    tables: str
    clouds: str
    channel: str
    day: str


_NUSCENES = Layout("v1.0-automos", "samples/LIDAR_TOP", "LIDAR_TOP", "date_captured")
_T4 = Layout("annotation", "data/LIDAR_CONCAT", "LIDAR_CONCAT", "data_captured")


def _write(layout: Layout, run: RunFiles, out: Path) -> None:
    """Write the root of a data set to `out`, with one scene, named after the recording."""
    from PIL import Image

    lidarseg = f"lidarseg/{layout.tables}"
    make_folders(out, layout.tables, layout.clouds, lidarseg, "maps")
    name = partial(token_of, run)
    tables: Tables = defaultdict(list, _fixed_tables(run, name, layout))
    micro = microseconds(run).tolist()
    for index in run.each("writing tables"):
        cloud, classes = f"{layout.clouds}/{index:06d}.pcd.bin", f"{lidarseg}/{name('data', index)}_lidarseg.bin"
        for file, values in zip((cloud, classes), _points(run, index), strict=True):
            write_raw(out / file, values)
        for table, row in _rows_of_scan(run, index, name, micro[index], cloud, classes).items():
            tables[table].append(row)
        tables["sample_annotation"] += _boxes(run, index, name)
    tables["instance"] = _chained(tables["sample_annotation"], run.sequence.name)
    with atomic_path(out / "maps" / "empty.png") as temporary:  # a map on which nothing is: the devkit asks for one
        Image.new("L", (1, 1)).save(temporary, "PNG")
    for table, rows in tables.items():
        write_json(out / layout.tables / f"{table}.json", rows, indent=0)


def _fixed_tables(run: RunFiles, name: Name, layout: Layout) -> Tables:
    """Return the tables that have a row or some, however long the recording is."""
    recording, last = run.sequence.name, len(run) - 1
    scene = {"token": name("scene"), "log_token": name("log"), "name": recording, "nbr_samples": len(run)}
    scene |= {"first_sample_token": name("sample", 0), "last_sample_token": name("sample", last)}
    mount = {"token": name("mount"), "sensor_token": name("sensor"), **_pose(np.eye(4)), "camera_intrinsic": []}
    log = {"token": name("log"), "logfile": recording, "vehicle": "", "location": ""}
    chart = {"token": name("map"), "log_tokens": [name("log")], "category": "semantic_prior"}
    return {
        "category": [
            {"token": name("category", k), "name": category, "description": "", "index": k}
            for k, category in enumerate(_CATEGORIES)
        ],
        "attribute": [{"token": name("attribute", k), "name": a, "description": ""} for k, a in enumerate(_ATTRIBUTES)],
        "visibility": [{"token": token, "level": level, "description": ""} for token, level in _LEVELS.items()],
        "sensor": [{"token": name("sensor"), "channel": layout.channel, "modality": "lidar"}],
        "calibrated_sensor": [{**mount, "camera_distortion": []}],
        "log": [{**log, layout.day: ""}],
        "scene": [{**scene, "description": "moving objects labelled by automos"}],
        "map": [{**chart, "filename": "maps/empty.png"}],
        "sample_annotation": [],
    }


def _rows_of_scan(
    run: RunFiles, index: int, name: Name, micro: int, cloud: str, classes: str
) -> dict[str, dict[str, Any]]:
    """Return the row of scan `index` in each table that has one of every scan; `cloud` and `classes` are its files."""
    chain = {
        kind: {
            "prev": name(kind, index - 1) if index else "",
            "next": name(kind, index + 1) if index + 1 < len(run) else "",
        }
        for kind in ("sample", "data")
    }
    return {
        "ego_pose": {"token": name("pose", index), "timestamp": micro, **_pose(run.T_level_sensor(index))},
        "sample": {"token": name("sample", index), "timestamp": micro, "scene_token": name("scene"), **chain["sample"]},
        "sample_data": {
            "token": name("data", index),
            "sample_token": name("sample", index),
            "ego_pose_token": name("pose", index),
            "calibrated_sensor_token": name("mount"),
            "timestamp": micro,
            "fileformat": "pcd.bin",
            "is_key_frame": True,
            "height": 0,
            "width": 0,
            "filename": cloud,
            **chain["data"],
        },
        "lidarseg": {"token": name("data", index), "sample_data_token": name("data", index), "filename": classes},
    }


def _pose(T: Pose) -> dict[str, list[float]]:
    return {"translation": T[:3, 3].round(6).tolist(), "rotation": scalar_first(T)}


def _points(run: RunFiles, index: int) -> tuple[Any, Any]:
    """Return (M, 5) float32 x, y, z, intensity, ring of the points of use, and (M,) uint8 their categories."""
    scan = run.scan(index)
    ring = np.zeros(len(scan)) if scan.ring is None else scan.ring
    rows = np.column_stack([run.points_at_pose(scan, index), intensity_of(scan), ring]).astype(np.float32)
    labels, kinds = run.labels(index, len(scan)), run.kinds(run.instances(index, len(scan)))
    classes = np.select([labels == Label.MOVING, labels == Label.STATIC], [kinds + _FIRST_KIND, 1], 0)
    return rows[scan.is_valid], classes[scan.is_valid].astype(np.uint8)


def _boxes(run: RunFiles, index: int, name: Name) -> list[dict[str, Any]]:
    """Return the boxes of scan `index`, as far as it alone says."""
    instances = run.instances(index, len(run.scan(index)))
    return [
        {
            "token": name("box", box.id, index),
            "sample_token": name("sample", index),
            "instance_token": name("object", box.id),
            "category_token": name("category", box.kind + _FIRST_KIND),
            "visibility_token": "full" if box.is_observed else "none",
            "attribute_tokens": [name("attribute", k) for k in _ATTRIBUTES_OF_KIND[box.kind]],
            **_pose(box.pose),
            "size": box.size[[1, 0, 2]].round(4).tolist(),
            "velocity": box.velocity.round(4).tolist(),
            "num_lidar_pts": int((instances == box.id).sum()),
            "num_radar_pts": 0,
            "prev": "",
            "next": "",
            "automatic_annotation": True,
            "autolabel_metadata": [{"name": "automos", "score": box.score, "uncertainty": None}],
        }
        for box in run.boxes_level(index).moving
    ]


def _chained(boxes: list[dict[str, Any]], recording: str) -> list[dict[str, Any]]:
    """Return the objects of `boxes`, which are in the order of time; link the boxes of each."""
    objects: dict[str, list[dict[str, Any]]] = defaultdict(list)
    categories = {box["instance_token"]: box.pop("category_token") for box in boxes}
    for box in boxes:
        earlier = objects[box["instance_token"]]
        if earlier:
            earlier[-1]["next"], box["prev"] = box["token"], earlier[-1]["token"]
        earlier.append(box)
    return [
        {
            "token": token,
            "category_token": categories[token],
            "instance_name": f"{recording}::{token}",
            "nbr_annotations": len(rows),
            "first_annotation_token": rows[0]["token"],
            "last_annotation_token": rows[-1]["token"],
        }
        for token, rows in objects.items()
    ]


EXPORTS = {
    "nuscenes-tables": Export("nuScenes data set: v1.0-automos/*.json, samples, lidarseg", partial(_write, _NUSCENES)),
    "t4": Export("TIER IV T4 data set: annotation/*.json, data/LIDAR_CONCAT, lidarseg", partial(_write, _T4)),
}
