"""A recorded sequence on disk, in KITTI's layout: what a user of that recorder would have, and the truth beside it.

OUT/velodyne/000000.bin   float32 x, y, z, intensity; or .npy with named columns where points have times
OUT/labels/000000.label   where the sweeps have labels, each its point's
OUT/times.txt             where the recorder keeps a clock; OUT/poses.txt: true poses, the sensor's, where known
OUT/convention.json       what the recorder did
"""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import write_npy, write_raw, write_text
from automos.core.claims import RECORDED, claim, remove
from automos.core.pose_writers import write_kitti
from automos.core.scan import Scan
from automos.readers.point_cloud2 import packed_rows
from automos.simulation.recorders.recorded import Recorded

EPOCH = 1_700_000_000.0
"""Seconds since 1970 at which recordings with absolute times begin."""
MARKER = "convention.json"


def write_recorded(recorded: Recorded, out: str | Path) -> Path:
    """Write `recorded` with its truth to folder `out` and return the folder.

    Raises
    ------
    InputError
        `out` holds something else.
    """
    out = Path(out)
    claim(out, RECORDED)
    for name in ("velodyne", "labels"):
        (out / name).mkdir(exist_ok=True)
    earlier = (path for kind in ("velodyne/*.bin", "velodyne/*.npy", "labels/*.label") for path in out.glob(kind))
    for path in [out / "times.txt", out / "poses.txt", *earlier]:
        remove(path)
    write_text(out / MARKER, recorded.convention.model_dump_json(indent=2) + "\n")
    for index, name in enumerate(recorded.names):
        scan, truth = recorded[index], recorded.truth(index)
        if recorded.convention.times == "none":
            write_raw(out / "velodyne" / f"{name}.bin", np.column_stack([scan.points, _intensity(scan)]))
        else:
            write_npy(out / "velodyne" / f"{name}.npy", _named(recorded, index, scan))
        if truth is not None:
            write_raw(out / "labels" / f"{name}.label", truth.astype(np.uint32))
    if recorded.convention.stamps:
        write_text(out / "times.txt", "".join(f"{stamp:.6f}\n" for stamp in recorded.true_stamps))
    poses = recorded.reference_poses
    if poses is not None:
        write_kitti(out / "poses.txt", poses)
    return out


def _named(recorded: Recorded, index: int, scan: Scan) -> npt.NDArray:
    """Return the scan's points as rows of named columns, times in the unit and type of the convention."""
    times: npt.NDArray = np.zeros(0) if scan.time is None else scan.time
    if recorded.convention.times == "absolute":
        times = EPOCH + recorded.when(index)
    elif recorded.convention.times == "milliseconds":
        times = 1e3 * times
    given = {**dict(zip("xyz", scan.points.T, strict=True)), "intensity": _intensity(scan), "ring": scan.ring}
    return packed_rows({name: column for name, column in given.items() if column is not None} | {"timestamp": times})


def _intensity(scan: Scan) -> npt.NDArray[np.float32]:
    return np.zeros(len(scan), np.float32) if scan.intensity is None else scan.intensity
