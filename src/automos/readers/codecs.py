"""Point files by kind: which suffix is read by which module, one call for all of them."""

import importlib
from collections.abc import Callable
from pathlib import Path

from automos.core.errors import InputError
from automos.core.reading import damage_reported, require_regular
from automos.readers.columns import Columns
from automos.readers.layouts import LAYOUTS, is_columns

CODECS: dict[str, str] = {
    "bin": "records without a header, of KITTI's float32 x y z intensity or what their content shows; see --columns",
    "pcd": "Point Cloud Library, ascii, binary or binary_compressed",
    "ply": "Polygon file, ascii or binary",
    "npy": "NumPy (.npy, .npz), (N, 3 or more) or structured",
    "las": "LAS or LAZ (extra las)",
    "e57": "E57, a scan a file (extra e57)",
    "xyz": "text (.xyz, .txt, .csv, .tsv, .asc, .pts), x y z intensity or columns named in the first line",
    "zipped": "an archive (.zip) of one cloud of these kinds",
}
"""Kinds of point files, name and description."""

CODEC_OF_SUFFIX = {
    ".bin": "bin",
    ".pcd": "pcd",
    ".ply": "ply",
    ".npy": "npy",
    ".npz": "npy",
    ".las": "las",
    ".laz": "las",
    ".xyz": "xyz",
    ".txt": "xyz",
    ".csv": "xyz",
    ".tsv": "xyz",
    ".asc": "xyz",
    ".pts": "xyz",
    ".e57": "e57",
    ".zip": "zipped",
}


_UNNAMED = ("npy", "xyz")
"""Kinds whose files may have columns without names; those of `LAYOUTS` never have any."""


def suffix_codec(codec: str) -> str | None:
    """Return the codec that stands for the suffix, None where any may: all bin* files end in .bin."""
    return None if is_columns(codec) else "bin" if codec in LAYOUTS else codec


def read_columns(path: Path, codec: str, columns: str = "") -> Columns:
    """Return the named columns of one point file, each (N,), in the file's order.

    Parameters
    ----------
    columns : what the file's columns are, where it does not name them; "" for what the codec says.

    Raises
    ------
    InputError
        A file that is absent, cut short, or not of this kind, or that has other columns.
    """
    columns = columns or LAYOUTS.get(codec, "")
    module = importlib.import_module(f"automos.readers.{suffix_codec(codec)}")
    read: Callable[..., Columns] = module.read
    with damage_reported(path):
        require_regular(path)
        if not columns:
            return read(path)
        if codec not in LAYOUTS and codec not in _UNNAMED:
            raise InputError(f"{path} names its columns itself; leave --columns out")
        return read(path, columns)
