"""One file for each scan, named after it: a table of formats, each with what it holds and how a scan is packed."""

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.atomic import write_bytes
from automos.core.labels import pack
from automos.readers.columns import Columns
from automos.readers.point_cloud2 import packed_rows
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.laz import laz_packer
from automos.writers.pcd import pcd_bytes, ply_header
from automos.writers.point_columns import point_columns

Packer = Callable[[RunFiles], Callable[[int], bytes]]
"""Takes a run and returns what packs its scans, by their numbers."""


def _export(suffix: str, holds: str, packer: Packer, is_of_points: bool = False, **needs: Any) -> Export:
    def write(run: RunFiles, out: Path) -> None:
        packed = packer(run)
        out.mkdir(parents=True, exist_ok=True)
        for index in run.each(f"writing {suffix}"):
            write_bytes(out / f"{run.names[index]}{suffix}", packed(index))

    return Export(f"folder of {suffix}: {holds}", write, is_of_points=is_of_points, per_scan=(f"*{suffix}",), **needs)


def _of_columns(content: Callable[[Columns], bytes]) -> Packer:
    """Return what packs scans whose `content` is their columns."""
    return lambda run: lambda index: content(point_columns(run, index))


def _ply_bytes(columns: Columns) -> bytes:
    rows = packed_rows(columns)
    return ply_header({name: rows.dtype[name] for name in columns}, len(rows)) + rows.tobytes()


def _panoptic(run: RunFiles) -> Callable[[int], bytes]:
    def packed(index: int) -> bytes:
        n_points = len(run.scan(index))
        return pack(run.labels(index, n_points), run.instances(index, n_points)).tobytes()

    return packed


def _instances(run: RunFiles) -> Callable[[int], bytes]:
    def packed(index: int) -> bytes:
        content = io.BytesIO()
        np.save(content, run.instances(index, len(run.scan(index))).astype(np.uint32))
        return content.getvalue()

    return packed


_LAS = {"needs": "las", "modules": ("laspy", "lazrs")}
_COLUMNS = "x y z intensity time ring label instance"
SCAN_FILES = {
    "panoptic": _export(".label", "class below, track id in the upper 16 bits", _panoptic),
    "instances": _export(".npy", "track id of every point, 0 for none", _instances),
    "pcd": _export(".pcd", _COLUMNS, _of_columns(pcd_bytes), is_of_points=True),
    "ply": _export(".ply", _COLUMNS, _of_columns(_ply_bytes), is_of_points=True),
    "laz": _export(".laz", "classification, gps_time, extra dimensions", laz_packer, is_of_points=True, **_LAS),
}
