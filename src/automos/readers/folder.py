"""A plain folder of point files, with optional times.txt, poses.txt, calib.txt, mounts.yaml and labels/ beside them."""

from __future__ import annotations

import contextlib
import hashlib
import logging
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import inverse
from automos.core.label_files import read_labels
from automos.core.pose_files import lines_of_scans, read_calib, read_poses
from automos.core.reading import damage_reported, is_there, read_text
from automos.core.scan import LATEST, Mask, Pose, Scan, Sequence
from automos.readers import files
from automos.readers.bin import WIDTHS, guess_codec
from automos.readers.boxes_beside import motion_beside
from automos.readers.codecs import read_columns
from automos.readers.columns import coordinates, sensor_column, time_column, to_scan
from automos.readers.formats import Format
from automos.readers.mounts import FILE as MOUNTS
from automos.readers.mounts import read_mounts
from automos.readers.point_times import PointTimes, judge_times, sweep_bounds
from automos.readers.seen_order import put_in_seen_order
from automos.readers.time_order import put_in_order, usual_step, with_all_times
from automos.readers.units import unit_of

logger = logging.getLogger(__name__)


def find(path: Path) -> list[Path]:
    """Return `path` if it is a folder that holds point files itself, else nothing."""
    return [path] if path.is_dir() and files.holds_point_files(path) else []


def open_recording(path: Path, codec: str | None = None) -> FolderSequence:
    """Return the recording in folder `path`; `codec` where the kind of its files should not be guessed."""
    return FolderSequence(path, codec=codec)


class FolderSequence(Sequence):
    """Scans that lie as one file each in one folder. Holds names, not points; files are read when asked for."""

    source: Path

    def __init__(self, source: Path, scan_folder: str = ".", codec: str | None = None):
        """List the scans in `source / scan_folder`; the recording's other files are looked for in `source`.

        Raises
        ------
        InputError
            No scans, mixed formats, .bin files of no whole number of points, or a times.txt that does not fit.
        """
        self.source = Path(source)
        self.name = self.source.resolve().name
        self._folder = self.source / scan_folder
        self._files, found, stamps = files.list_scans(self._folder, codec)
        if codec is None:
            codec = guess_codec(self._paths) if found == "bin" else found
        self._codec = codec
        self._names = [Path(file).stem for file in self._files]
        self._mounts = read_mounts(self.source)
        times = self._read_times(stamps)
        self._gap = usual_step(times)
        if stamps is None and self._point_times.is_absolute:
            times = self._times_of_points(times)
        self._stamps: npt.NDArray[np.float64] | None = None
        if times is None:
            ordered = put_in_seen_order(lambda index: self[index].points, self._names, self._folder)
        else:
            ordered = put_in_order(times, self._names, self._folder)
        self._order, self._stamps, self._warnings = ordered.order, ordered.stamps, ordered.warnings
        self._files = [self._files[i] for i in self._order]
        self._names = [self._names[i] for i in self._order]
        if codec == "pcd":
            _warn_of_viewpoint(self._paths[0])

    def __len__(self) -> int:
        return len(self._files)

    def __getitem__(self, index: int) -> Scan:
        index = self._scan_number(index)
        path = self._folder / self._files[index]
        columns = read_columns(path, self._codec)
        has_time = time_column(columns) is not None
        stamp = None if self._stamps is None else float(self._stamps[index])
        time_unit = (self._point_times.unit or 0.0) if has_time else None
        scan = to_scan(columns, path, self._names[index], stamp, time_unit, self._unit[0])
        return scan if self._mounts is None else self._mounts.applied_to(scan, sensor_column(columns), path)

    @property
    def names(self) -> list[str]:
        """File names without their suffix."""
        return self._names

    @property
    def stamps(self) -> npt.NDArray[np.float64] | None:
        """(len,) seconds from the points' own times, else times.txt; where names are times, times.txt, else these."""
        return self._stamps

    @property
    def warnings(self) -> list[str]:
        """What is wrong with the order of the files, the times of their points and their unit, and what is left out."""
        beside = [*files.copy_warnings(self._copy_of, self._names), *files.left_out_folders(self.source, self._folder)]
        return [*self._warnings, *beside, *self._point_times.warnings, *self._unit[1]]

    @cached_property
    def repeats(self) -> Mask:
        """(len,) bool: files that hold what the one before them holds."""
        return files.are_repeats(self._copy_of)

    @cached_property
    def T_camera_sensor(self) -> Pose | None:
        """(4, 4) from calib.txt, None where there is none: poses are then the sensor's own."""
        path = self.source / "calib.txt"
        return read_calib(path) if is_there(path) else None

    @cached_property
    def reference_poses(self) -> Pose | None:
        """(len, 4, 4) T_world_sensor from poses.txt (KITTI or TUM), None where there is none."""
        path = next((path for path in self._pose_files() if is_there(path)), None)
        if path is None:
            return None
        by_name = np.argsort(self._order)
        stamps = None if self._stamps is None else self._stamps[by_name]
        names = [self._names[i] for i in by_name]
        T = read_poses(path, len(self), stamps, self.T_camera_sensor, names)[self._order]
        return inverse(T[0]) @ T

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return the (N,) uint32 labels of scan `index` from labels/<name>.label; None if no scan has labels."""
        if not self._has_truth:
            return None
        index = self._scan_number(index)
        return read_labels(self.source / "labels" / f"{self._names[index]}.label", self._n_points(index))

    def truth_motion(self, index: int) -> npt.NDArray[np.float32] | None:
        """Return (N, 3) metres until the next scan, as the boxes beside the scans say; None without."""
        index = self._scan_number(index)
        return motion_beside(self.source, self, index)

    def fingerprint(self) -> str:
        """Return a text that changes when a scan's name, size or time of change does, or the stamps."""
        digest = hashlib.sha256(self._codec.encode())
        with damage_reported(self._folder):
            for path in self._paths:
                status = path.stat()
                digest.update(f"{path.name}\0{status.st_size}\0{status.st_mtime_ns}\n".encode())
        if self._stamps is not None:
            digest.update(self._stamps.tobytes())
        if self._mounts is not None:
            digest.update((self.source / MOUNTS).read_bytes())
        return f"{super().fingerprint()}:{digest.hexdigest()}"

    # -------------------------------------------------------------------------------------------- files beside
    @property
    def _paths(self) -> list[Path]:
        return [self._folder / file for file in self._files]

    @cached_property
    def _fullest(self) -> Path:
        """The largest file, which says most about how all of them are to be read."""
        return max(self._paths, key=lambda path: path.stat().st_size)

    def _pose_files(self) -> list[Path]:
        return [self.source / "poses.txt"]

    @cached_property
    def _copy_of(self) -> npt.NDArray[np.int64]:
        """(len,) for each scan the first one whose file holds the same points; those without are no copies."""
        with damage_reported(self._folder):
            return files.find_copies(self._paths, self._n_points)

    def _read_times(self, stamps_from_names: npt.NDArray[np.float64] | None) -> npt.NDArray[np.float64] | None:
        path = self.source / "times.txt"
        if not is_there(path):
            return stamps_from_names
        try:
            times = np.array([float(line) for line in read_text(path).splitlines() if line.strip()])
        except (OSError, ValueError) as error:
            raise InputError(f"{path} must hold one time in seconds a line: {error}") from None
        is_time = np.abs(times) < LATEST
        if not is_time.all():
            raise InputError(f"{path}, line {int(np.argmin(is_time)) + 1}: the time is not a number of seconds")
        times = times[lines_of_scans(len(times), len(self), self._names, path, "times")]
        return times

    def _times_of_points(self, others: npt.NDArray[np.float64] | None) -> npt.NDArray[np.float64]:
        """Return (len,) seconds at which the scans' points begin, on one clock; `others` if too few have any."""
        unit = self._point_times.unit

        def start(path: Path) -> float:
            times = time_column(read_columns(path, self._codec))
            return np.nan if times is None or unit is None else sweep_bounds(times, unit)[0]

        with ThreadPoolExecutor() as pool:
            times = with_all_times(np.array(list(pool.map(start, self._paths))))
        return times if others is None or np.isfinite(times).all() else others

    @cached_property
    def _has_truth(self) -> bool:
        return any((self.source / "labels").glob("[!.]*.label"))

    def _n_points(self, index: int) -> int:
        if self._codec in WIDTHS:
            return (self._folder / self._files[index]).stat().st_size // (4 * WIDTHS[self._codec])
        return len(self[index])

    @cached_property
    def _unit(self) -> tuple[float, list[str]]:
        """Metres per unit of the coordinates, and what to say of it."""
        with contextlib.suppress(InputError):  # reported when the scan itself is read
            return unit_of(coordinates(read_columns(self._fullest, self._codec), self._fullest))
        return 1.0, []

    @cached_property
    def _point_times(self) -> PointTimes:
        """How the points' times are read, determined once: a scan of few points may not show it."""
        if self._codec in WIDTHS:
            return PointTimes()
        columns = read_columns(self._fullest, self._codec)
        # Those of few points, as recordings may begin and end with, have no times.
        most = self._fullest.stat().st_size
        full = [path for path in self._paths if 2 * path.stat().st_size >= most]
        others = [full[0], full[-1]] if time_column(columns) is not None else []
        return judge_times([columns, *(read_columns(path, self._codec) for path in others)], self._folder, self._gap)


def _warn_of_viewpoint(path: Path) -> None:
    from automos.readers.pcd import read_header

    if not np.allclose(read_header(path).viewpoint, np.eye(4)):
        logger.warning("%s has a VIEWPOINT; it is not applied, points are taken as they are in the sensor frame", path)


FORMAT = Format(
    layout="a folder of .bin, .pcd, .ply, .npy or text files, and where present poses.txt, calib.txt, times.txt",
    truth="labels/*.label",
    find=find,
    open=open_recording,
    has_codecs=True,
)
