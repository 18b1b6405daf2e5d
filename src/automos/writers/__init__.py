"""Export of results to the files that other tools read: one module per format, imported when used."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from automos.core.arguments import require_kind
from automos.core.atomic import faults_reported, held, remove_parts
from automos.core.claims import EXPORT, claim, claim_file
from automos.core.errors import InputError
from automos.core.own_sequence import as_sequence
from automos.core.reading import given_path
from automos.core.run import silent

if TYPE_CHECKING:
    from automos.core.run import Progress
    from automos.core.scan import Sequence as ScanSequence
    from automos.results.run_files import RunFiles
    from automos.writers.formats import Export

_MODULES = (
    ("semantickitti", ("semantickitti",)),
    ("scan_files", ("panoptic", "instances", "pcd", "ply")),
    ("las", ("laz",)),
    ("scan_files", ("parquet", "mcap")),
    ("box_files", ("kitti_tracking", "nuscenes")),
    ("nuscenes_tables", ("nuscenes-tables", "t4")),
    ("box_files", ("openpcdet", "mmdet3d", "openlabel")),
    ("annotation_tools", ("cvat", "segments", "supervisely", "sustech")),
    ("flow", ("flow-av2", "opensceneflow")),
    ("scan_files", ("dynamicmap",)),
    ("reconstruction", ("ncore", "drivestudio")),
)
"""The formats of each module, which declares them as `EXPORTS`, in the order in which they are listed."""
EXPORTS: tuple[str, ...] = tuple(name for _, formats in _MODULES for name in formats)
"""Formats that results are written in."""


def load_export(name: str) -> Export:
    """Return what the writer `name`, one of `EXPORTS`, declares of itself.

    Raises
    ------
    InputError
        There is no such format.
    """
    require_kind(name, str, "format", f"one of {', '.join(EXPORTS)}")
    if name not in EXPORTS:
        near = difflib.get_close_matches(name.lower(), EXPORTS, n=1, cutoff=0.0)
        raise InputError(f"unknown format {name!r}; did you mean {near[0]!r}? Known are: {', '.join(EXPORTS)}")
    module = next(module for module, formats in _MODULES if name in formats)
    declared: Export = importlib.import_module(f"automos.writers.{module}").EXPORTS[name]
    return declared


def export_run(
    folder: str | Path,
    sequences: Sequence[ScanSequence],
    format: str,
    out: str | Path | None = None,
    progress: Progress = silent,
    deskewed: bool = False,
) -> list[Path]:
    """Write the results in `folder` in another format.

    Parameters
    ----------
    folder : str or Path
        Results folder. For several recordings, a folder with a results folder for each, named after it.
    sequences : list of Sequence
        The recordings that were labelled.
    format : str
        One of `automos.writers.EXPORTS`.
    out : str or Path, optional
        File or folder to write; `folder / "export" / format` if not given. For several recordings, the folder that
        gets one entry for each, or a zip file for all of them.
    progress : callable, optional
        Called as `progress(what, done, total)` after each scan.
    deskewed : bool, default False
        Write motion-compensated points: as seen from the pose of their scan.

    Returns
    -------
    list of Path
        The files or folders that were written.

    Raises
    ------
    InputError
        The results do not belong to the recordings, the format is unknown, or `out` cannot be written.

    Examples
    --------
    >>> import automos
    >>> recordings = automos.open_recordings("my_log")
    >>> written = automos.export_run("automos_runs/my_log", recordings, "pcd", out="clouds")
    >>> len(list(written[0].glob("*.pcd")))
    12
    """
    from automos.results.run_files import RunFiles

    export, folder = load_export(format), given_path(folder, "a results folder")
    if deskewed:
        _require_points(export, format)
    target = folder / "export" / format if out is None else given_path(out, "where to export to")
    require_kind(sequences, Sequence, "sequences", "a list of the recordings that were labelled")
    written: dict[Path, None] = {}
    for sequence in _distinct(sequences, export):
        run = RunFiles(folder if len(sequences) == 1 else folder / sequence.name, sequence, progress, deskewed)
        place = _place(target, export, sequence.name, len(sequences))
        _claim(place, export, sequence)
        _write(export, run, place)
        written[place] = None  # each once, in order
    return list(written)


def _require_points(export: Export, format: str) -> None:
    if not export.is_of_points:
        point_formats = ", ".join(name for name in EXPORTS if load_export(name).is_of_points)
        raise InputError(f"{format} cannot be written deskewed; these can: {point_formats}")


def _claim(place: Path, export: Export, sequence: ScanSequence) -> None:
    from automos.results.claiming import refuse_folder_of

    export.require()
    refuse_folder_of(sequence, place.parent if export.suffix else place)
    if export.suffix:
        claim_file(place, export.sign)
    else:
        claim(place, EXPORT)


def _distinct(sequences: Sequence[ScanSequence], export: Export) -> list[ScanSequence]:
    """Return the recordings; InputError where the results of two of them would replace each other."""
    first: dict[str, ScanSequence] = {}
    for sequence in map(as_sequence, sequences):
        called = export.name_of(sequence.name)
        if called in first:
            raise InputError(
                f"two recordings ({first[called].name}, {sequence.name}) would both be written as {called}: export "
                "them one by one, each to an --out of its own"
            )
        first[called] = sequence
    return list(first.values())


def _write(export: Export, run: RunFiles, place: Path) -> None:
    """Write one recording's results to `place`; InputError where that cannot be, or holds others."""
    _require_unmixed(place, export, run)
    with faults_reported(place), nullcontext() if export.suffix else held(place):
        if export.suffix:
            place.parent.mkdir(parents=True, exist_ok=True)
        else:
            remove_parts(place)
        export.write(run, place)


def _require_unmixed(place: Path, export: Export, run: RunFiles) -> None:
    """Raise InputError where an earlier export left files of other scans in folder `place`: readers take them, too."""
    names = set(run.names)
    found = (path for pattern in export.per_scan for path in place.glob(pattern) if not path.name.startswith("."))
    others = sorted(path for path in found if path.stem not in names)
    if others:
        raise InputError(
            f"{place} holds {len(others)} files of scans that {run.sequence.name} has not (first: {others[0].name}), "
            "which would be mixed with its own: remove them, or choose another --out"
        )


def _place(out: Path, export: Export, name: str, n_recordings: int) -> Path:
    """Return the file or folder that one recording's results are written to."""
    if export.suffix == ".zip":  # one for all recordings
        return out if out.suffix == ".zip" else out / "predictions.zip"
    if export.suffix:
        return out if out.suffix == export.suffix and n_recordings == 1 else out / f"{name}{export.suffix}"
    return out if n_recordings == 1 else out / name
