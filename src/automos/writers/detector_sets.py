"""Data sets for detectors, boxes of what moves in the upright frame: OpenPCDet's custom one, and MMDetection3D's.

OpenPCDet's reader fails at an empty file of labels: scans in which nothing moves are not listed. MMDetection3D has the
centre of a box's bottom, as it does for LiDAR boxes unless another origin is named; `track_id` says which are one
object.
"""

import pickle
from pathlib import Path
from typing import Any

from automos.core.atomic import atomic_path, write_npy, write_raw, write_text
from automos.results.run_files import RunFiles
from automos.writers.formats import Export, make_folders, upright_points

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
        numbers = [" ".join(f"{value:.4f}" for value in (*box.center, *box.size, box.yaw)) for box in moving]
        lines = [f"{row} {CLASSES[CLASS_OF_KIND[box.kind]]}\n" for row, box in zip(numbers, moving, strict=True)]
        write_npy(out / "points" / f"{name}.npy", upright_points(run, index))
        write_text(out / "labels" / f"{name}.txt", "".join(lines))
        listed.append(name)
    for split, names in split_of(listed).items():
        write_text(out / "ImageSets" / f"{split}.txt", "".join(f"{name}\n" for name in names))


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
        with atomic_path(out / f"infos_{split}.pkl") as temporary, temporary.open("wb") as file:
            pickle.dump(infos, file)


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
    "openpcdet": Export(
        writes="OpenPCDet custom data set: points/*.npy, labels/*.txt, ImageSets", write=_write_openpcdet
    ),
    "mmdet3d": Export(writes="MMDetection3D data set: points/*.bin, infos_*.pkl", write=_write_mmdet3d),
}
