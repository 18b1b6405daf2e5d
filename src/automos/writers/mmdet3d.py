"""MMDetection3D's data set: points/*.bin and infos_train.pkl, infos_val.pkl; boxes of what moves, upright frame.

A box is the centre of its bottom, length, width, height and yaw, as MMDetection3D has LiDAR boxes unless another origin
is named. `track_id` says which are one object.
"""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

from automos.core.atomic import atomic_path, write_raw
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.kinds import KINDS, Kinds, kinds_of_tracks
from automos.writers.movers import only_moving, split_of, upright_points


def write(run: RunFiles, out: Path) -> None:
    """Write the folder `out`."""
    (out / "points").mkdir(parents=True, exist_ok=True)
    kinds, frames = kinds_of_tracks(run), {}
    for index in run.each("writing boxes"):
        name = f"{index:06d}"
        write_raw(out / "points" / f"{name}.bin", upright_points(run, index))
        frames[name] = {
            "sample_idx": index,
            "timestamp": float(run.stamps[index]),
            "lidar_points": {"lidar_path": f"{name}.bin", "num_pts_feats": 4},
            "instances": _instances(run, index, kinds),
        }
    about = {"dataset": "automos", "categories": {kind: k for k, kind in enumerate(KINDS)}, "version": "1.1"}
    for split, names in split_of(list(frames)).items():
        infos = {"metainfo": about, "data_list": [frames[name] for name in names]}
        with atomic_path(out / f"infos_{split}.pkl") as temporary, temporary.open("wb") as file:
            pickle.dump(infos, file)


def _instances(run: RunFiles, index: int, kinds: Kinds) -> list[dict[str, Any]]:
    found = only_moving(run.boxes_upright(index))
    bottom = found.boxes.center - 0.5 * found.boxes.size * [0.0, 0.0, 1.0]
    kind = kinds(found.ids)
    return [
        {
            "bbox_3d": [*bottom[k].tolist(), *found.boxes.size[k].tolist(), float(found.boxes.yaw[k])],
            "bbox_label_3d": int(kind[k]),
            "track_id": int(found.ids[k]),
        }
        for k in range(len(found))
    ]


EXPORT = Export(writes="MMDetection3D data set: points/*.bin, infos_*.pkl", write=write)
