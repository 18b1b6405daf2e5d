"""Point files by kind: which suffix is read by which module, one call for all of them; and columns without names.

`--columns` says these: `x,y,z,intensity,ring,time`. A type may follow a name, as NumPy writes it: `x:f8`, `ring:u2`,
`t:>u4`. Columns without one have that of x, which is f4 itself unless it is said. What is called `_` is left out:
`_:u1` is one byte, `_:V12` are twelve.
"""

import importlib
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from automos.core.errors import InputError
from automos.core.reading import damage_reported, require_regular
from automos.readers.columns import MAX_COLUMNS, Columns

LAYOUTS = {
    "bin": "x,y,z,intensity",
    "bin3": "x,y,z",
    "bin5": "x,y,z,intensity,ring",
    "bin6": "x,y,z,intensity,ring,_",
}
"""Columns that have names of their own, as `--format` takes them."""

_TYPE = re.compile(r"[<>]?(f[248]|[iu][1248]|V[1-9]\d{0,2})")


def is_columns(text: str) -> bool:
    """Return whether `text` names columns, and not a format."""
    return "," in text


def parse_columns(text: str) -> np.dtype:
    """Return one point of the columns that `text` names; those called `_` have names that begin so.

    Raises
    ------
    InputError
        Not a list of columns, or without x, y and z.
    """
    parts = [part.partition(":") for part in LAYOUTS.get(text, text).split(",")]
    names, types = [name.strip() for name, _, _ in parts], [kind.strip() for _, _, kind in parts]
    counted = [f"_{i}" if name == "_" else name for i, name in enumerate(names)]
    default = dict(zip(names, types, strict=True)).get("x") or "f4"
    kinds = [kind or default for kind in types]
    stray = next((kind for kind in kinds if not _TYPE.fullmatch(kind)), None)
    if stray is not None:
        raise InputError(f"--columns {text}: {stray!r} is no type of numbers; write f4, f8, u1, u2, u4, i4, or >f4")
    if not {"x", "y", "z"} <= set(names) or len(set(counted)) < len(counted) or "" in names or len(names) > MAX_COLUMNS:
        raise InputError(f"--columns {text}: name x, y and z, and each column once, as in x,y,z,intensity,ring,time")
    ordered = [kind if kind[0] in "<>" else f"<{kind}" for kind in kinds]
    return np.dtype([*zip(counted, ordered, strict=True)])


def spell_columns(dtype: np.dtype) -> str:
    """Return the text from which `parse_columns` makes `dtype`."""
    assert dtype.names is not None
    kinds = {name: dtype[name].str.lstrip("<|") for name in dtype.names}
    defaults = dict.fromkeys(kinds, kinds["x"]) | {"x": "f4"}
    types = ["" if kind == defaults[name] else f":{kind}" for name, kind in kinds.items()]
    names = ["_" if name.startswith("_") else name for name in kinds]
    return ",".join(map("".join, zip(names, types, strict=True)))


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

_SUFFIXES = {"npy": ".npy .npz", "las": ".las .laz", "xyz": ".xyz .txt .csv .tsv .asc .pts", "zipped": ".zip"}
"""Those of kinds that have several, or another than their name."""
CODEC_OF_SUFFIX = {suffix: codec for codec in CODECS for suffix in _SUFFIXES.get(codec, f".{codec}").split()}

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
