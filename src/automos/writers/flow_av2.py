"""Argoverse 2's scene-flow layout: LOG/TIMESTAMP.feather, a row per point of the sweep, as its evaluation reads it.

Flow leads from a point to its place in the next sweep's frame, the sensor's own motion included. Of an Argoverse log it
is in the vehicle's frame, as there; else in the sensor's. The last sweep has no next one and no file.
"""

from pathlib import Path

import numpy as np

from automos.core.atomic import atomic_path
from automos.readers.formats import import_extra
from automos.results.run_files import RunFiles
from automos.writers.flow import scan_flow, timestamps
from automos.writers.formats import Export


def write(run: RunFiles, out: Path) -> None:
    """Write `out / recording / <nanoseconds>.feather`: flow_tx_m, flow_ty_m, flow_tz_m (float16), is_dynamic."""
    arrow, feather = import_extra("pyarrow", "arrow"), import_extra("pyarrow.feather", "arrow")
    folder = out / run.sequence.name
    folder.mkdir(parents=True, exist_ok=True)
    T_vehicle_sensor, stamps = run.sequence.T_vehicle_sensor, timestamps(run)
    for index in run.each("writing flow"):
        if index + 1 == len(run):
            break
        found = scan_flow(run, index)
        flow = found.flow if T_vehicle_sensor is None else found.flow @ T_vehicle_sensor[:3, :3].T
        columns = {f"flow_t{axis}_m": arrow.array(flow[:, k].astype(np.float16)) for k, axis in enumerate("xyz")}
        table = arrow.table({**columns, "is_dynamic": arrow.array(found.is_dynamic)})
        with atomic_path(folder / f"{stamps[index]}.feather") as temporary:
            feather.write_feather(table, temporary)


EXPORT = Export(
    writes="scene flow: LOG/TIMESTAMP.feather, as Argoverse 2 scores it",
    write=write,
    needs="arrow",
    modules=("pyarrow",),
)
