"""What a map is written as: point clouds that append (PLY, PCD, LAZ), and a picture from above, coloured by height.

Points are x, y, z in metres, float32 (LAZ: 0.1 mm). In the picture higher points cover lower ones, so moving objects
show as trails.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from automos.core.atomic import atomic_path
from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.writers.formats import pcd_header, ply_header
from automos.writers.las import REACH, las_header

_HEIGHTS = (-1.0, 4.0)
"""Metres above the ground under the first scan between which colours differ."""


class HeightPicture:
    """Pixels over the whole drive; each keeps the highest point that fell into it."""

    def __init__(self, low: np.ndarray, high: np.ndarray, max_pixels: int):
        """Take the corners (2,) of the area, metres, and how many pixels its longer side may have."""
        self._low = np.asarray(low, np.float64)
        extent = np.asarray(high, np.float64) - self._low
        self._pixel = float(max(extent.max() / max_pixels, 0.02))
        self.heights = np.full(tuple(np.ceil(extent[::-1] / self._pixel).astype(int) + 1), -np.inf, np.float32)

    def add(self, points: np.ndarray) -> None:
        """Draw `points` (N, 3), metres, level frame."""
        columns, rows = np.floor((points[:, :2] - self._low) / self._pixel).astype(np.int64).T
        inside = (rows >= 0) & (columns >= 0) & (rows < self.heights.shape[0]) & (columns < self.heights.shape[1])
        np.maximum.at(self.heights, (rows[inside], columns[inside]), points[inside, 2].astype(np.float32))

    def write(self, path: Path) -> None:
        """Write the picture as PNG, north up."""
        from matplotlib import colormaps
        from matplotlib.image import imsave

        share = np.clip((self.heights - _HEIGHTS[0]) / (_HEIGHTS[1] - _HEIGHTS[0]), 0.0, 1.0)
        colors = colormaps["turbo"](share, bytes=True)
        colors[~np.isfinite(self.heights)] = (255, 255, 255, 255)
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            imsave(file, np.ascontiguousarray(colors[::-1]), format="png")


Write = Callable[[np.ndarray], None]
"""Takes points (N, 3), metres."""

_KINDS = dict.fromkeys("xyz", np.dtype("<f4"))


@contextmanager
def open_cloud(path: Path) -> Iterator[Write]:
    """Give a function that appends points (N, 3) to the file `path`, of the kind its suffix says; whole or not at all.

    Raises
    ------
    InputError
        A suffix other than .ply, .pcd or .laz.
    MissingExtraError
        The library for .laz is not installed.
    """
    check_kind(path)
    with atomic_path(path) as temporary, _OPENED[path.suffix](temporary) as write:
        yield write


def check_kind(path: Path) -> None:
    """Raise the error that `open_cloud` would raise."""
    if path.suffix not in _OPENED:
        raise InputError(f"{path} is of no kind that maps are written in: choose .ply, .pcd or .laz")
    if path.suffix == ".laz":
        import_extra("laspy", "las")
        import_extra("lazrs", "las")


@contextmanager
def _open_binary(path: Path, header: Callable[..., bytes]) -> Iterator[Write]:
    """Give what appends; the header is of one length whatever the number of points, and filled in at the end."""
    n = 0
    with path.open("wb") as file:
        file.write(header(_KINDS, f"{n:012d}"))

        def write(points: np.ndarray) -> None:
            nonlocal n
            n += len(points)
            file.write(np.ascontiguousarray(points, "<f4").tobytes())

        yield write
        file.seek(0)
        file.write(header(_KINDS, f"{n:012d}"))


@contextmanager
def _open_laz(path: Path) -> Iterator[Write]:
    laspy, lazrs = import_extra("laspy", "las"), import_extra("lazrs", "las")
    header = las_header()

    def write(points: np.ndarray) -> None:
        if not (np.abs(points) < REACH).all():
            raise InputError(f"the map reaches further than {REACH / 1e3:.0f} km, as LAZ does: choose --kind ply")
        record = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
        record.x, record.y, record.z = points.astype(np.float64).T
        cloud.write_points(record)

    try:
        with (
            path.open("w+b") as file,
            laspy.open(file, mode="w", header=header, do_compress=True, closefd=False) as cloud,
        ):
            yield write
    except lazrs.LazrsError as error:  # which it raises where the disk is full
        raise OSError(str(error)) from error


_OPENED: dict[str, Callable[[Path], AbstractContextManager[Write]]] = {
    ".ply": partial(_open_binary, header=ply_header),
    ".pcd": partial(_open_binary, header=pcd_header),
    ".laz": _open_laz,
}
