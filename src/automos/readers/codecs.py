"""Point files by kind: which suffix is read by which module, one call for all of them."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path

from automos.core.reading import damage_reported, require_regular
from automos.readers.columns import Columns

CODECS: dict[str, str] = {
    "bin": "float32 x y z intensity (KITTI)",
    "bin3": "float32 x y z",
    "bin5": "float32 x y z intensity ring (nuScenes)",
    "bin6": "float32 x y z intensity and two columns that are not used",
    "pcd": "Point Cloud Library, ascii, binary or binary_compressed",
    "ply": "Polygon file, ascii or binary",
    "npy": "NumPy, (N, 3 or more) or structured",
    "las": "LAS or LAZ (extra las)",
    "xyz": "text (.xyz, .txt, .csv), x y z intensity or columns named in the first line",
}
"""Kinds of point files, name and description."""

CODEC_OF_SUFFIX = {
    ".bin": "bin",
    ".pcd": "pcd",
    ".ply": "ply",
    ".npy": "npy",
    ".las": "las",
    ".laz": "las",
    ".xyz": "xyz",
    ".txt": "xyz",
    ".csv": "xyz",
}


def suffix_codec(codec: str) -> str:
    """Return the codec that stands for the suffix: all bin* files end in .bin."""
    return "bin" if codec.startswith("bin") else codec


def read_columns(path: Path, codec: str) -> Columns:
    """Return the named columns of one point file, each (N,), in the file's order.

    Raises
    ------
    InputError
        A file that is absent, cut short, or not of this kind.
    """
    module = importlib.import_module(f"automos.readers.{suffix_codec(codec)}")
    read: Callable[..., Columns] = module.read
    with damage_reported(path):
        require_regular(path)
        return read(path, module.WIDTHS[codec]) if suffix_codec(codec) == "bin" else read(path)
