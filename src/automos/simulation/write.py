"""A simulated sequence on disk, in SemanticKITTI's layout, with its truth.

OUT/velodyne/000000.bin     float32 x, y, z, intensity
OUT/labels/000000.label     uint32: 9, 251 or 0 below, instance ids above; moving = moves at some time while observed
OUT/labels_now/000000.label the same, moving = moves during this sweep
OUT/boxes/000000.json       objects with points in this scan, in the level frame, and T_level_sensor
OUT/poses.txt, calib.txt (Tr is the identity: poses are the sensor's), times.txt (mid-sweep)
OUT/simulation.json         what was asked for; marks the folder as ours
"""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from automos.core.atomic import write_raw, write_text
from automos.core.claims import SIMULATION
from automos.core.own_folder import own_folder
from automos.core.parallel import map_in_order
from automos.core.pose_writers import write_kitti
from automos.readers.formats import import_extra
from automos.simulation.bag import write_bag
from automos.simulation.sequence import FORMAT, SimulatedSequence

MARKER = "simulation.json"
_FOLDERS = ("velodyne", "labels", "labels_now", "boxes")
_IDENTITY = "1 0 0 0 0 1 0 0 0 0 1 0"


def write(
    sequence: SimulatedSequence,
    out: str | Path,
    workers: int = 1,
    progress: Callable[[str, int, int], None] | None = None,
    bag: bool = False,
) -> Path:
    """Write `sequence` with its truth to folder `out` and return the folder; an interrupted run goes on.

    With `bag`, `out / bag` is the same as a robot keeps it, with an IMU: see `bag`.

    Every file is whole or not there. `workers` processes share the scans (0: one per core); the bytes do not depend on
    their number. `progress` is called with ("simulate", done, total).

    Raises
    ------
    InputError
        `out` exists and is not a simulated sequence, or another one, or cannot be written.
    """
    if bag:
        import_extra("rosbags", "ros")
    out = Path(out)
    description = _description(sequence)
    with own_folder(out, SIMULATION, MARKER, description):
        for name in _FOLDERS:
            (out / name).mkdir(exist_ok=True)
        _write_all(sequence, out, workers, progress)
        if bag:
            write_bag(sequence, out / "bag")
    return out


def _write_all(
    sequence: SimulatedSequence, out: Path, workers: int, progress: Callable[[str, int, int], None] | None
) -> None:
    write_text(out / "calib.txt", "".join(f"P{k}: {_IDENTITY}\n" for k in range(4)) + f"Tr: {_IDENTITY}\n")
    write_text(out / "times.txt", "".join(f"{stamp:.6f}\n" for stamp in sequence.stamps))
    write_kitti(out / "poses.txt", sequence.reference_poses)
    todo = [k for k, name in enumerate(sequence.names) if not (out / "boxes" / f"{name}.json").exists()]
    done = len(sequence) - len(todo)
    for _ in map_in_order(partial(_write_scan, sequence, out), todo, workers):
        done += 1
        if progress is not None:
            progress("simulate", done, len(sequence))


def _description(sequence: SimulatedSequence) -> dict[str, object]:
    return {
        "format": FORMAT,
        "scenario": sequence.scenario,
        "sensor": sequence.sensor.name,
        "scans": len(sequence),
        "seed": sequence.seed,
        "compensated": sequence.is_compensated,
    }


def _write_scan(sequence: SimulatedSequence, out: Path, index: int) -> None:
    name = sequence.names[index]
    scan = sequence[index]
    assert scan.intensity is not None
    arrays = {
        out / "velodyne" / f"{name}.bin": np.column_stack([scan.points, scan.intensity]).astype(np.float32),
        out / "labels" / f"{name}.label": sequence.truth(index),
        out / "labels_now" / f"{name}.label": sequence.truth_now(index),
    }
    for path, array in arrays.items():
        write_raw(path, array)
    # Last, because a scan whose boxes are there counts as written.
    write_text(out / "boxes" / f"{name}.json", json.dumps(_boxes_as_json(sequence, index)) + "\n")


def _boxes_as_json(sequence: SimulatedSequence, index: int) -> dict[str, object]:
    found = sequence.boxes(index)
    rows = zip(
        found.ids.tolist(),
        found.kinds,
        np.round(found.boxes.center, 4).tolist(),
        np.round(found.boxes.size, 4).tolist(),
        np.round(found.boxes.yaw, 5).tolist(),
        found.is_moving.tolist(),
        found.is_moving_now.tolist(),
        found.n_points.tolist(),
        strict=True,
    )
    keys = ("id", "kind", "center", "size", "yaw", "moving", "moving_now", "points")
    T_level_sensor = sequence.T_level_world @ sequence.reference_poses[index]
    return {
        "stamp": round(float(sequence.stamps[index]), 6),
        "T_level_sensor": np.round(T_level_sensor, 9).tolist(),
        "boxes": [dict(zip(keys, row, strict=True)) for row in rows],
    }
