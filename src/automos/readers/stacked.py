"""Scans that lie in one NumPy file: an array (S, N, 3 or more), or an archive with a numbered array for each."""

from contextlib import suppress
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.readers.codecs import CODEC_OF_SUFFIX
from automos.readers.column_names import is_time
from automos.readers.files import TEXT, natural_key, point_files
from automos.readers.formats import Format
from automos.readers.zipped import ZippedSequence


def _scans_of(path: Path) -> tuple[list[npt.NDArray] | None, npt.NDArray | None]:
    """Return the scans in a file, none where it holds one, None where that is open; and (S,) their times, if any."""
    from automos.readers.npy import WIDEST, load, stack_in

    arrays = load(path)
    clouds = {name: array for name, array in arrays.items() if array.ndim > 1 or array.dtype.names}
    stems = {name.rstrip("0123456789") for name in clouds}
    rows, columns = ({array.shape[k : k + 1] for array in clouds.values()} for k in (0, 1))
    # of few of one size, which NumPy named, one may be of points, others of what is known of them
    are_clouds = len(columns) == 1 and min(columns) >= (3,) and (len(rows) > 1 or stems != {"arr_"})
    if len(stems) == 1 < len(clouds) and (len(clouds) > WIDEST or (are_clouds and min(rows) > (WIDEST,))):
        found: list[npt.NDArray] | None = [clouds[name] for name in sorted(clouds, key=natural_key)]
    else:
        found = stack_in(*clouds.values()) if len(clouds) == 1 else []
    sized = (name for name, array in arrays.items() if found and array.shape == (len(found),))
    return found, next((arrays[name] for name in sized if is_time(name)), None)


def find(path: Path) -> list[Path]:
    """Return the file at `path`, or those in a folder that holds no others, if they hold several scans each.

    Raises
    ------
    InputError
        It is the only one, and its points do not tell how many it holds.
    """
    names = sorted(point_files(path), key=natural_key) if path.is_dir() else []
    files = [file for file in (path, *(path / name for name in names)) if file.is_file() and file.suffix not in TEXT]
    if not files or any(CODEC_OF_SUFFIX.get(file.suffix.lower()) != "npy" for file in files):
        return []
    try:
        first = _scans_of(files[0])[0]
    except InputError:
        if path.is_file():
            raise
        return []  # said when the scan is read
    if first is None and len(files) == 1:
        raise InputError(
            f"{files[0]} holds an array whose rows may be scans or parts of one, as its points do not tell: save one "
            "scan as (N, 3 or more) in a folder, and of several a file each"
        )
    shapes = {_shape_of(file) for file in files} - {None}
    return files if first and len(shapes) <= 1 else []


def _shape_of(path: Path) -> tuple[int, tuple[str, ...] | None] | None:
    """Return the axes and fields of the array in a file, by its header; None of archives and of what is damaged."""
    with suppress(OSError, ValueError, EOFError):  # reported when it is read
        array = np.load(path, mmap_mode="r") if path.suffix.lower() == ".npy" else None
        return None if array is None else (array.ndim, array.dtype.names)
    return None


class StackedSequence(ZippedSequence):
    """The scans of one file, which lie in a temporary folder, a file each, for as long as this does."""

    def _unpack(self, path: Path, place: Path) -> None:
        place.mkdir()
        scans, times = _scans_of(path)
        if not scans:
            raise InputError(f"{path} holds one scan, and others beside it hold several; keep one kind in a folder")
        for i, scan in enumerate(scans):
            np.save(place / f"{i:06d}.npy", scan)
        if times is not None:
            (place / "times.txt").write_text("\n".join(map(str, times.tolist())))


FORMAT = Format(
    layout="scans in one file: .npy of shape (S, N, 3 or more), .npz of numbered arrays",
    find=find,
    open=StackedSequence,
    has_codecs=True,
)
