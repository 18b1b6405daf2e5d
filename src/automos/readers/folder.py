"""A plain folder of point files, with optional times.txt, poses.txt, calib.txt, mounts.yaml and labels/ beside them."""

import contextlib
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.label_files import read_labels
from automos.core.pose_files import read_calib, read_poses
from automos.core.reading import damage_reported, is_there
from automos.core.scan import Array, Ints, Mask, Pose, Scan
from automos.core.upright_boxes import TrueBoxes
from automos.readers import files
from automos.readers.box_truth import boxes_beside, motion_beside
from automos.readers.codecs import LAYOUTS, is_columns, parse_columns, read_columns
from automos.readers.column_names import has_time
from automos.readers.columns import Columns, coordinates, time_column, whole_column
from automos.readers.formats import Format, digest_of_files
from automos.readers.listed import FileSequence
from automos.readers.point_times import PointTimes, judge_times, sweep_starts
from automos.readers.record_layout import find_columns
from automos.readers.scan_times import read_times, times_file
from automos.readers.sensor_place import find_frame, frame_said, read_viewpoints
from automos.readers.stamped_poses import FILE as MOUNTS
from automos.readers.stamped_poses import read_mounts, sensor_poses
from automos.readers.time_order import put_in_order, put_in_seen_order, usual_step
from automos.readers.turns import parts_said
from automos.readers.units import unit_of


def find(path: Path) -> list[Path]:
    """Return `path` if it is a folder that holds point files itself, of text such as have numbers, else nothing."""
    return [path] if path.is_dir() and (files.holds_scans(path) or files.holds_tables(path)) else []


class FolderSequence(FileSequence):
    """Scans that lie as one file each in one folder: of kind `codec`, of `columns` where they do not name theirs.

    Stamps are the points' own times, else those in times.txt; where names are times, those in times.txt, else these.
    """

    def __init__(self, source: Path, codec: str | None = None, scan_folder: str = "."):
        """List the scans in `source / scan_folder`, read as `codec` says if given; other files lie in `source`.

        Raises
        ------
        InputError
            No scans, mixed formats, .bin files of no whole number of points, or a times.txt that does not fit.
        """
        self.source = Path(source)
        self.name = self.source.resolve().name
        self._folder = self.source / scan_folder
        found, self.codec, stamps = files.list_scans(self._folder, codec)
        self.paths = [self._folder / name for name in found]
        if is_guessed := codec is None and self.codec == "bin":
            codec = find_columns(self.paths)
        self.columns = LAYOUTS.get(codec or "", codec if codec and is_columns(codec) else "")
        self._names = [file.stem for file in self.paths]
        self._read = lru_cache(16)(self._read)  # type: ignore[method-assign]  # once, for all questions here
        self._mounts = read_mounts(self.source)
        times = self._read_times(stamps)
        self._clock = "the files' names" if times is stamps else times_file(self.source, self._folder).name
        self._gap = usual_step(times)
        if stamps is None and self._point_times.is_absolute:
            times = sweep_starts(self._read, self.paths, self._point_times, times)
            self._clock = "the points' own times"
        self.stamps = None
        self._T_file_sensor: Pose | None = None
        if times is None:
            ordered = put_in_seen_order(lambda index: self[index].points, self._names, self._folder)
        else:
            ordered = put_in_order(times, self._names, self._folder)
        self._order, self.stamps, self._warnings = ordered.order, ordered.stamps, ordered.warnings
        self.paths = [self.paths[i] for i in self._order]
        self._names = [self._names[i] for i in self._order]
        self._viewpoints, self._surplus = read_viewpoints(self.paths, self.codec)
        self._T_file_sensor = self._find_frame()
        self._warnings += parts_said(self._raw_points, self.stamps, len(self), self._folder)
        del self._read
        columns = f"The files have no header; their points are read as --columns {self.columns}."
        frame = "The clouds are in the frame of a map; the poses that came with them took them back."
        self._found = [columns] * (is_guessed and codec != LAYOUTS["bin"]) + [frame] * (self._T_file_sensor is not None)

    def __getitem__(self, index: int) -> Scan:
        path = self.paths[index := self._scan_number(index)]
        columns = self._read(path)
        T = None if self._T_file_sensor is None else self._T_file_sensor[index]
        scan = self._to_scan(index, columns, self._point_times.unit or 0.0, self._unit[0], T)
        return scan if self._mounts is None else self._mounts.applied_to(scan, whole_column(columns, "sensor"), path)

    def _read(self, path: Path) -> Columns:
        return read_columns(path, self.codec, self.columns)

    def _raw_points(self, index: int) -> Array:
        return self._unit[0] * coordinates(self._read(self.paths[index]), self.paths[index])

    def _find_frame(self) -> Pose | None:
        """Return (len, 4, 4) the sensor's poses in the frame of the files, None where that is the sensor's own."""
        claims = [] if self._viewpoints is None else [self._viewpoints]
        fault = ""
        try:
            T = self._poses_in_world()
            claims += [] if T is None else [T, sensor_poses(T)]
        except InputError as error:  # reported when the poses are asked for
            fault = f" ({error})"
        return find_frame(self._raw_points, len(self), claims, self._viewpoints is not None, self._folder, fault)

    @property
    def about(self) -> dict[str, str]:
        """Kind of the files, and the columns of those that do not name them; what gives the stamps; their frame."""
        files = f"{self.paths[0].suffix.lower()} files{self.columns and f' of {self.columns}'}"
        return {"files": files, "times": self._clock, "frame": frame_said(self._T_file_sensor)}

    @property
    def warnings(self) -> list[str]:
        """What is wrong with the order of the files, the times of their points and their unit, and what is left out."""
        beside = [*files.copy_warnings(self._copy_of, self._names), *files.left_out_folders(self.source, self._folder)]
        return [*self._warnings, *self._surplus, *beside, *self._point_times.warnings, *self._unit[1], *self._found]

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
        """(len, 4, 4) T_world_sensor from poses.txt (KITTI or TUM), else the viewpoints, else None."""
        T = self._viewpoints if (T := self._poses_in_world()) is None else T
        return None if T is None else sensor_poses(T)

    def _poses_in_world(self) -> Pose | None:
        path = next((path for path in self._pose_files() if is_there(path)), None)
        if path is None:
            return None
        by_name = np.argsort(self._order)
        stamps = None if self.stamps is None else self.stamps[by_name]
        names = [self._names[i] for i in by_name]
        return read_poses(path, len(self), stamps, self.T_camera_sensor, names, in_world=True)[self._order]

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return the (N,) uint32 labels of scan `index` from labels/<name>.label; None if no scan has labels."""
        if not any((self.source / "labels").glob("[!.]*.label")):
            return None
        index = self._scan_number(index)
        return read_labels(self.source / "labels" / f"{self._names[index]}.label", self._n_points(index))

    def truth_motion(self, index: int) -> npt.NDArray[np.float32] | None:
        """Return (N, 3) metres until the next scan, as the boxes beside the scans say; None without."""
        return motion_beside(self.source, self, self._scan_number(index))

    def truth_boxes(self, index: int) -> TrueBoxes | None:
        """Return the boxes beside scan `index`; None without."""
        return boxes_beside(self.source, self._names[self._scan_number(index)])

    def fingerprint(self) -> str:
        """Return a text that changes when a scan's name, size or time of change does, or the stamps."""
        kind = self.codec if self.columns == LAYOUTS["bin"] else self.codec + self.columns
        stamps = b"" if self.stamps is None else self.stamps.tobytes()
        mounts = b"" if self._mounts is None else (self.source / MOUNTS).read_bytes()
        return f"{super().fingerprint()}:{digest_of_files(self.paths, stamps, mounts, kind=kind)}"

    # -------------------------------------------------------------------------------------------- files beside
    @cached_property
    def _fullest(self) -> Path:
        """The largest file, which says most about how all of them are to be read."""
        return max(self.paths, key=lambda path: path.stat().st_size)

    def _pose_files(self) -> list[Path]:
        return [self.source / "poses.txt"]

    @cached_property
    def _copy_of(self) -> Ints:
        """(len,) for each scan the first one whose file holds the same points; those without are no copies."""
        with damage_reported(self._folder):
            return files.find_copies(self.paths, self._n_points)

    def _read_times(self, stamps_from_names: Array | None) -> Array | None:
        path = times_file(self.source, self._folder)
        return read_times(path, self._names) if is_there(path) else stamps_from_names

    def _n_points(self, index: int) -> int:
        if self.codec == "bin":
            return self.paths[index].stat().st_size // parse_columns(self.columns).itemsize
        return len(self[index])

    @cached_property
    def _unit(self) -> tuple[float, list[str]]:
        """Metres per unit of the coordinates, and what to say of it."""
        with contextlib.suppress(InputError):  # reported when the scan itself is read
            return unit_of(coordinates(self._read(self._fullest), self._fullest))
        return 1.0, []

    @cached_property
    def _point_times(self) -> PointTimes:
        """How the points' times are read; a scan of few points may not show it."""
        if self.columns and not has_time(parse_columns(self.columns).names or ()):
            return PointTimes()
        columns = self._read(self._fullest)
        # Those of few points, as recordings may begin and end with, have no times.
        most = self._fullest.stat().st_size
        full = [path for path in self.paths if 2 * path.stat().st_size >= most]
        others = [full[0], full[-1]] if time_column(columns) is not None else []
        return judge_times([columns, *(self._read(path) for path in others)], self._folder, self._gap)


FORMAT = Format(
    layout="a folder: .bin, .pcd, .ply, .npy, .las or text files, and where present poses.txt, calib.txt, times.txt",
    truth="labels/*.label",
    find=find,
    open=FolderSequence,
    has_codecs=True,
)
