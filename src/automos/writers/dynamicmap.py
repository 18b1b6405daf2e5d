"""Clouds for map cleaning: DynamicMap_Benchmark's and dufomap's pcd/*.pcd, in the world's frame, and gt_cloud.pcd.

VIEWPOINT in a file's header is the sensor's pose, which dufomap takes as the origin of the rays. The world is that of
the first scan. Intensity says what moves: 1, else 0.
"""

import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path
from automos.core.geometry import inverse, transform
from automos.core.labels import Label
from automos.results.run_files import RunFiles
from automos.writers.formats import Export, make_folders
from automos.writers.point_columns import pcd_header, write_pcd


def write(run: RunFiles, out: Path) -> None:
    """Write `out / pcd / 000000.pcd`, ..., and `out / gt_cloud.pcd`, all of them one after the other."""
    make_folders(out, "pcd")
    T_first_sensor = inverse(run.T_world_sensor[0]) @ run.T_world_sensor
    n_points = 0
    with tempfile.TemporaryFile(dir=out) as together:
        for index in run.each("writing .pcd"):
            columns = _columns(run, index, T_first_sensor[index])
            write_pcd(out / "pcd" / f"{index:06d}.pcd", columns, T_first_sensor[index])
            together.write(np.column_stack(list(columns.values())).astype("<f4").tobytes())
            n_points += len(columns["x"])
        together.seek(0)
        with atomic_path(out / "gt_cloud.pcd") as temporary, temporary.open("wb") as file:
            file.write(pcd_header({name: np.dtype("<f4") for name in columns}, n_points))
            while part := together.read(1 << 24):
                file.write(part)


def _columns(run: RunFiles, index: int, T_first_sensor: npt.NDArray[np.float64]) -> dict[str, npt.NDArray]:
    scan = run.scan(index)
    points = transform(T_first_sensor, run.points_at_pose(scan, index)[scan.is_valid]).astype(np.float32)
    is_moving = run.labels(index, len(scan))[scan.is_valid] == Label.MOVING
    return {"x": points[:, 0], "y": points[:, 1], "z": points[:, 2], "intensity": is_moving.astype(np.float32)}


EXPORT = Export(
    writes="pcd/*.pcd in the world's frame with VIEWPOINT, gt_cloud.pcd: DynamicMap_Benchmark, dufomap", write=write
)
