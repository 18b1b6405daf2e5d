"""KITTI's point files: float32 x, y, z, intensity and nothing else, one per scan, and the scans' times."""

from pathlib import Path

import numpy as np

from automos.core.atomic import write_raw, write_text
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.point_columns import point_columns


def write(run: RunFiles, out: Path) -> None:
    """Write every scan as `out / velodyne / <name>.bin`, in its own unit of intensity, and times.txt in seconds."""
    (out / "velodyne").mkdir(parents=True, exist_ok=True)
    for index in run.each("writing .bin"):
        columns = point_columns(run, index)
        nothing = np.zeros(len(columns["x"]), np.float32)
        rows = np.column_stack([columns.get(name, nothing) for name in ("x", "y", "z", "intensity")])
        write_raw(out / "velodyne" / f"{run.names[index]}.bin", rows.astype(np.float32))
    write_text(out / "times.txt", "".join(f"{stamp:.9f}\n" for stamp in run.stamps))


EXPORT = Export(
    writes="velodyne/*.bin: x y z intensity, without labels; times.txt",
    write=write,
    is_of_points=True,
)
