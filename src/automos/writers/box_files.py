"""Tracks of boxes as files: nuScenes' results, ASAM OpenLABEL 1.0, KITTI's tracking benchmark, sets for detectors.

nuScenes: in the frame of poses.txt; the sample token is the scan's name, sizes are width, length, height and
quaternions scalar first. OpenLABEL: a cuboid per frame in a world frame with z up, and the sensor's pose in it. KITTI:
boxes are in a camera's frame, x right, y down, z forward, upright about y. Here that is a camera at the sensor that
looks along its heading, level at the first scan; its pose is in calib/SSSS.txt. There is no picture, so boxes in the
image are -1 and alpha is -10, as for results in 3D only.

OpenPCDet's custom data set and MMDetection3D's have boxes of what moves in the upright frame. OpenPCDet's reader fails
at an empty file of labels: scans in which nothing moves are not listed. MMDetection3D has the centre of a box's bottom,
as it does for LiDAR boxes unless another origin is named; `track_id` says which are one object.
"""

import pickle
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.atomic import write_bytes, write_json, write_npy, write_raw, write_text
from automos.core.claims import SIGN
from automos.core.geometry import inverse, make_transform, transform
from automos.results.run_files import RunFiles
from automos.results.run_objects import Box
from automos.writers.formats import Export, make_folders, scalar_first, upright_points


def _write_nuscenes(run: RunFiles, out: Path) -> None:
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
                "rotation": scalar_first(T_world_level @ box.pose),
                "velocity": velocity[k, :2].tolist(),
                "tracking_id": str(box.id),
                "tracking_name": box.verdict,
                "tracking_score": round(box.score, 4),
            }
            for k, box in enumerate(found)
        ]
    uses = {f"use_{sensor}": sensor == "lidar" for sensor in ("camera", "lidar", "radar", "map", "external")}
    write_json(out, {"meta": {**uses, "comment": SIGN.decode()}, "results": results})


_WORLD, _SENSOR = "world", "lidar"


def _write_openlabel(run: RunFiles, out: Path) -> None:
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
        placed = {"src": _SENSOR, "dst": _WORLD, "transform_src_to_dst": {"matrix4x4": T.round(9).ravel().tolist()}}
        properties = {"timestamp": f"{run.stamps[index]:.6f}", "transforms": {f"{_SENSOR}_to_{_WORLD}": placed}}
        frames[str(index)] = {"frame_properties": properties, "objects": objects}
    about = {"schema_version": "1.0.0", "name": run.sequence.name, "annotator": "automos", "comment": SIGN.decode()}
    content = {
        "metadata": about,
        "coordinate_systems": {
            _WORLD: {"type": "scene_cs", "parent": "", "children": [_SENSOR]},
            _SENSOR: {"type": "sensor_cs", "parent": _WORLD, "children": []},
        },
        "frame_intervals": [{"frame_start": 0, "frame_end": len(run) - 1}],
        "frames": frames,
        "objects": {str(track): _object(track, scans, *tracks[track]) for track, scans in seen.items()},
    }
    write_json(out, {"openlabel": content})


def _object(track: int, scans: list[int], verdict: str, confidence: float) -> dict[str, Any]:
    runs = np.split(scans, np.flatnonzero(np.diff(scans) > 1) + 1) if scans else []
    return {
        "name": f"object {track}",
        "type": verdict,
        "frame_intervals": [{"frame_start": int(part[0]), "frame_end": int(part[-1])} for part in runs],
        "object_data": {"num": [{"name": "confidence", "val": confidence}]},
    }


R_CAMERA_UPRIGHT = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""From x forward, y left, z up to x right, y down, z forward."""


def _write_kitti(run: RunFiles, out: Path) -> None:
    """Write `out / label_02 / <recording>.txt` and `out / calib / <recording>.txt`.

    A line is: frame, track, type (Moving, Static, Unknown), truncated, occluded, alpha, image box, height, width,
    length, bottom centre x, y, z in the camera's frame, rotation about its y-axis, confidence of the type.
    """
    T_camera_sensor = make_transform(R_CAMERA_UPRIGHT) @ run.T_upright_sensor(0)
    lines = []
    for index in run.each("writing tracks"):
        found = run.boxes_level(index)
        T_camera_level = T_camera_sensor @ inverse(run.T_level_sensor(index))
        bottom = found.boxes.center - 0.5 * found.boxes.size * [0.0, 0.0, 1.0]
        location = transform(T_camera_level, bottom)
        heading = np.column_stack([np.cos(found.boxes.yaw), np.sin(found.boxes.yaw), np.zeros(len(found))])
        heading = heading @ T_camera_level[:3, :3].T
        rotation_y = np.arctan2(-heading[:, 2], heading[:, 0])
        for box, (x, y, z), turn in zip(found, location, rotation_y, strict=True):
            length, width, height = box.size
            occluded = 0 if box.is_observed else 3  # 3: unknown
            lines.append(
                f"{index} {box.id} {box.verdict.capitalize()} 0 {occluded} -10 -1 -1 -1 -1 {height:.4f} {width:.4f} "
                f"{length:.4f} {x:.4f} {y:.4f} {z:.4f} {turn:.5f} {box.score:.4f}\n"
            )
    make_folders(out, "label_02", "calib")
    name = run.sequence.name
    write_text(out / "label_02" / f"{name}.txt", "".join(lines))
    numbers = " ".join(f"{value:.12e}" for value in T_camera_sensor[:3].ravel())
    write_text(out / "calib" / f"{name}.txt", f"R_rect 1 0 0 0 1 0 0 0 1\nTr_velo_cam {numbers}\n")


CLASSES = ("Vehicle", "Pedestrian", "Cyclist")
CLASS_OF_KIND = (0, 0, 2, 1, 0)
"""Index into `CLASSES` of each `Kind`: what is of no kind is no person."""


def split_of(frames: list[str]) -> dict[str, list[str]]:
    """Return names of `frames` for training and, the last fifth in time, for validation."""
    edge = len(frames) - len(frames) // 5
    return {"train": frames[:edge], "val": frames[edge:]}


def _write_openpcdet(run: RunFiles, out: Path) -> None:
    """Write the folder `out`; a line of labels is: centre x y z, length, width, height, heading, kind."""
    make_folders(out, "points", "labels", "ImageSets")
    listed = []
    for index in run.each("writing boxes"):
        moving, name = run.boxes_upright(index).moving, f"{index:06d}"
        if not moving:
            continue
        lines = [f"{_numbers_of(box)} {CLASSES[CLASS_OF_KIND[box.kind]]}\n" for box in moving]
        write_npy(out / "points" / f"{name}.npy", upright_points(run, index))
        write_text(out / "labels" / f"{name}.txt", "".join(lines))
        listed.append(name)
    for split, names in split_of(listed).items():
        write_text(out / "ImageSets" / f"{split}.txt", "".join(f"{name}\n" for name in names))


def _numbers_of(box: Box) -> str:
    return " ".join(f"{value:.4f}" for value in (*box.center, *box.size, box.yaw))


def _write_mmdet3d(run: RunFiles, out: Path) -> None:
    """Write the folder `out`."""
    make_folders(out, "points")
    frames = {}
    for index in run.each("writing boxes"):
        name = f"{index:06d}"
        write_raw(out / "points" / f"{name}.bin", upright_points(run, index))
        frames[name] = {
            "sample_idx": index,
            "timestamp": float(run.stamps[index]),
            "lidar_points": {"lidar_path": f"{name}.bin", "num_pts_feats": 4},
            "instances": _instances(run, index),
        }
    about = {"dataset": "automos", "categories": {kind: k for k, kind in enumerate(CLASSES)}, "version": "1.1"}
    for split, names in split_of(list(frames)).items():
        infos = {"metainfo": about, "data_list": [frames[name] for name in names]}
        write_bytes(out / f"infos_{split}.pkl", pickle.dumps(infos))


def _instances(run: RunFiles, index: int) -> list[dict[str, Any]]:
    return [
        {
            "bbox_3d": [*(box.center - 0.5 * box.size * [0.0, 0.0, 1.0]).tolist(), *box.size.tolist(), box.yaw],
            "bbox_label_3d": CLASS_OF_KIND[box.kind],
            "track_id": box.id,
        }
        for box in run.boxes_upright(index).moving
    ]


EXPORTS = {
    "kitti_tracking": Export("KITTI tracking text: label_02/*.txt, calib/*.txt", _write_kitti),
    "nuscenes": Export("nuScenes tracking results, one JSON file", _write_nuscenes, suffix=".json"),
    "openlabel": Export("ASAM OpenLABEL 1.0, one JSON file", _write_openlabel, suffix=".json"),
    "openpcdet": Export("OpenPCDet custom data set: points/*.npy, labels/*.txt, ImageSets", _write_openpcdet),
    "mmdet3d": Export("MMDetection3D data set: points/*.bin, infos_*.pkl", _write_mmdet3d),
}
