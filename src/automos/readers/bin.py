"""Records without a header: KITTI's x, y, z, intensity in float32, its wider and narrower relatives, and structs."""

from pathlib import Path

from automos.readers.codecs import LAYOUTS, parse_columns
from automos.readers.columns import Columns
from automos.readers.records import read_records


def read(path: Path, columns: str = LAYOUTS["bin"]) -> Columns:
    """Return the columns of one file, as `columns` names them."""
    return read_records(path, parse_columns(columns))
