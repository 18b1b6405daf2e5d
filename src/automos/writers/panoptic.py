"""SemanticKITTI labels with instances: class in the lower 16 bits, track id in the upper ones."""

from __future__ import annotations

from pathlib import Path

from automos.core.atomic import write_raw
from automos.core.labels import pack
from automos.results.run_files import RunFiles
from automos.writers.formats import Export


def write(run: RunFiles, out: Path) -> None:
    """Write `out / <name>.label` for every scan; an object keeps its id through the recording."""
    out.mkdir(parents=True, exist_ok=True)
    for index in run.each("writing labels"):
        n_points = len(run.scan(index))
        packed = pack(run.labels(index, n_points), run.instances(index, n_points))
        write_raw(out / f"{run.names[index]}.label", packed)


EXPORT = Export(
    writes="folder of .label: class below, track id in the upper 16 bits", write=write, per_scan=("*.label",)
)
