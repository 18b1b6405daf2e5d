"""One Parquet table of all points, a row group per scan."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from automos.atomic import atomic_path
from automos.datasets.formats import import_extra
from automos.export.formats import Export
from automos.export.point_columns import point_columns
from automos.results.run_files import RunFiles


def write(run: RunFiles, out: Path) -> None:
    """Write all scans as one file `out`: scan (int32) and the columns of `point_columns`, in the scans' order."""
    arrow, parquet = import_extra("pyarrow", "arrow"), import_extra("pyarrow.parquet", "arrow")
    out.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(out) as temporary:
        writer = None
        try:
            for index in run.each("writing .parquet"):
                columns = point_columns(run, index)
                columns = {"scan": np.full(len(columns["x"]), index, np.int32), **columns}
                table = arrow.table({name: np.ascontiguousarray(column) for name, column in columns.items()})
                if writer is None:
                    writer = parquet.ParquetWriter(temporary, table.schema, compression="zstd")
                writer.write_table(table, row_group_size=max(len(table), 1))
        finally:
            if writer is not None:
                writer.close()


EXPORT = Export(
    writes="one .parquet of all points, a row group per scan",
    write=write,
    is_of_points=True,
    needs="arrow",
    suffix=".parquet",
)
