"""One Parquet table of all points, a row group per scan. What a scan has not, and others may have, is null."""

from pathlib import Path

import numpy as np

from automos.core.atomic import atomic_path
from automos.core.claims import SIGN
from automos.readers.formats import import_extra
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.point_columns import point_columns

_COLUMNS = {
    "scan": "int32", "x": "float32", "y": "float32", "z": "float32", "intensity": "float32", "time": "float32",
    "ring": "uint16", "label": "uint16", "instance": "uint32",
}  # fmt: skip


def write(run: RunFiles, out: Path) -> None:
    """Write all scans as one file `out`: scan (int32) and the columns of `point_columns`, in the scans' order."""
    arrow, parquet = import_extra("pyarrow", "arrow"), import_extra("pyarrow.parquet", "arrow")
    out.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(out) as temporary:
        schema = arrow.schema([(name, getattr(arrow, kind)()) for name, kind in _COLUMNS.items()], {"comment": SIGN})
        with parquet.ParquetWriter(temporary, schema, compression="zstd") as writer:
            for index in run.each("writing .parquet"):
                columns = point_columns(run, index)
                n_points = len(columns["x"])
                columns["scan"] = np.full(n_points, index, np.int32)
                filled = [
                    np.ascontiguousarray(columns[field.name])
                    if field.name in columns
                    else arrow.nulls(n_points, field.type)
                    for field in schema
                ]
                writer.write_table(arrow.table(filled, schema), row_group_size=max(n_points, 1))


EXPORT = Export(
    writes="one .parquet of all points, a row group per scan",
    write=write,
    is_of_points=True,
    needs="arrow",
    modules=("pyarrow",),
    suffix=".parquet",
)
