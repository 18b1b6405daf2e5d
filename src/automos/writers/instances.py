"""Track ids alone, for users who have classes already: one NumPy file per scan."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from automos.core.atomic import write_npy
from automos.results.run_files import RunFiles
from automos.writers.formats import Export


def write(run: RunFiles, out: Path) -> None:
    """Write `out / <name>.npy` for every scan: (N,) uint32, the moving object each point is on, 0 for none."""
    out.mkdir(parents=True, exist_ok=True)
    for index in run.each("writing instances"):
        ids = run.instances(index, len(run.scan(index)))
        write_npy(out / f"{run.names[index]}.npy", ids.astype(np.uint32))


EXPORT = Export(writes="folder of .npy: track id of every point, 0 for none", write=write, per_scan=("*.npy",))
