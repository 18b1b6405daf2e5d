"""MMDetection3D's data set: points/*.bin and infos_train.pkl, infos_val.pkl; boxes of what moves, upright frame.

A box is the centre of its bottom, length, width, height and yaw, as MMDetection3D has LiDAR boxes unless another origin
is named. `track_id` says which are one object.
"""

import pickle
from pathlib import Path
from typing import Any

from automos.core.atomic import atomic_path, write_raw
from automos.results.run_files import RunFiles
from automos.writers.detector_sets import CLASS_OF_KIND, CLASSES, split_of
from automos.writers.formats import Export
from automos.writers.point_columns import upright_points


def write(run: RunFiles, out: Path) -> None:
    """Write the folder `out`."""
    (out / "points").mkdir(parents=True, exist_ok=True)
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


EXPORT = Export(writes="MMDetection3D data set: points/*.bin, infos_*.pkl", write=write)
