"""PandaSet: lidar/*.pkl.gz, poses.json and timestamps.json of each drive; the points are those of its Pandar64.

Clouds come in the frame of a map, where the poses take them back from, and without the car's motion during a sweep.
They are pickles of pandas, which are taken apart here: arrays are all that is built of what they name.
"""

from __future__ import annotations

import gzip
import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.errors import InputError
from automos.core.reading import MAX_TEXT, damage_reported, is_there, read_json
from automos.core.scan import Pose, Scan
from automos.readers.columns import Columns
from automos.readers.formats import Format, recordings_at
from automos.readers.listed import ListedSequence
from automos.readers.stamped_poses import from_quaternions, sensor_poses

_SPINNING = 0
"""What the column `d` says of points of the LiDAR that turns; others are of one in front."""
_NUMPY = {"ndarray", "dtype", "_reconstruct", "scalar", "_frombuffer", "slice", "object", "_reconstructor"}
"""What arrays are made of."""


class _Part:
    """What stands for any part of pandas: how it was made, and what it was given."""

    args: tuple = ()
    state: Any = None

    def __new__(cls, *args: Any) -> _Part:
        part = super().__new__(cls)
        part.args = args
        return part

    def __setstate__(self, state: Any) -> None:
        self.state = state


class _Parts(pickle.Unpickler):
    """Builds arrays, and tables as their parts; nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        """Return what makes an array or a part of a table."""
        package = module.partition(".")[0]
        if package == "pandas":
            return _Part
        if package in ("numpy", "builtins", "copyreg") and name in _NUMPY:
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"it asks for {module}.{name}, which no table of points needs")


def _columns(packed: bytes) -> Columns:
    """Return the columns of a pickled table."""
    table = _Parts(io.BytesIO(packed)).load().state
    manager = table.get("_data", table.get("_mgr"))
    if manager.args:
        blocks, axes = manager.args
        pieces = [block.args[:2] for block in blocks]
    else:
        told = manager.state[3]["0.14.1"]
        axes, pieces = told["axes"], [(block["values"], block["mgr_locs"]) for block in told["blocks"]]
    names = axes[0].args[1]["data"]
    columns: Columns = {}
    for values, place in pieces:
        columns |= dict(zip(names[place].tolist(), values, strict=True))
    return columns


def _is_recording(path: Path) -> bool:
    lidar = path / "lidar"
    has_both = is_there(lidar / "poses.json") and is_there(lidar / "timestamps.json")
    return has_both or any(lidar.glob("[!.]*.pkl.gz"))  # what is absent is named when it is read


class PandasetSequence(ListedSequence):
    """One drive."""

    is_compensated = True

    def __init__(self, source: Path):
        """List the scans of the drive in folder `source`; read its poses.

        Raises
        ------
        InputError
            No scans, or poses and times that are damaged, or as many as no scans.
        """
        folder = source / "lidar"
        files = sorted(folder.glob("[!.]*.pkl.gz"))
        with damage_reported(folder, "holds damaged poses or times", "download them again"):
            poses = read_json(folder / "poses.json")
            stamps = np.array(read_json(folder / "timestamps.json"), np.float64)
            places = [[pose["position"][axis] for axis in "xyz"] for pose in poses]
            turns = [[pose["heading"][axis] for axis in "xyzw"] for pose in poses]
        if not len(files) == len(stamps) == len(poses):
            raise InputError(f"{folder} holds {len(files)} scans, {len(stamps)} times and {len(poses)} poses")
        super().__init__(source, files, stamps)
        self._T_map_sensor: Pose = from_quaternions(places, turns, folder / "poses.json")

    def __getitem__(self, index: int) -> Scan:
        path = self.paths[index := self._scan_number(index)]
        with damage_reported(path, "is no table of points of PandaSet", "download it again", kinds=Exception):
            with gzip.open(path) as packed:
                table = _columns(packed.read(MAX_TEXT))
            is_own = table["d"] == _SPINNING
            columns = {name: table[name][is_own] for name in ("x", "y", "z", "i", "t")}
        return self._to_scan(index, columns, 1.0, 1.0, self._T_map_sensor[index])

    @property
    def reference_poses(self) -> Pose:
        """(len, 4, 4) T_world_sensor."""
        return sensor_poses(self._T_map_sensor)


FORMAT = Format(
    layout="PandaSet: lidar/*.pkl.gz, poses.json, timestamps.json",
    find=lambda path: recordings_at(path, _is_recording),
    open=PandasetSequence,
)
