"""nuScenes, Lyft, TruckScenes: tables in v1.0-*/*.json, sweeps in samples/ and sweeps/; a scene is a recording.

Scenes are named as if they lay in the tables' folder: `v1.0-mini/scene-0061`, and of several LiDARs each is a recording
of its own: `scene-0061/LIDAR_LEFT`. Boxes are drawn twice a second, so two
scans a second have truth. The tables are read directly; of the large ones only what belongs to the scene is kept.
"""

from collections import defaultdict
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.errors import InputError
from automos.core.labels import Label
from automos.core.reading import damage_reported, is_there, read_json
from automos.core.scan import Pose, Scan
from automos.readers.box_truth import DrawnBoxes, DrawnTruth, checked_boxes
from automos.readers.codecs import read_columns
from automos.readers.formats import Format
from automos.readers.listed import ListedSequence
from automos.readers.stamped_poses import from_quaternions, sensor_poses

_MOVING = {"vehicle.moving", "cycle.with_rider", "pedestrian.moving"}

Row = dict[str, Any]


def find(path: Path) -> list[Path]:
    """Return the scenes at `path`: itself, those of its tables, or those of all tables in it, by name."""
    if _is_tables(path.parent) and not path.exists():
        return [path]
    if _is_tables(path):
        names = sorted(scene["name"] for scene in _read(path, "scene"))
        if len(set(names)) < len(names) or any(name != Path(name).name for name in names):
            raise InputError(f"{path / 'scene.json'} names a scene twice, or by a path; unpack the metadata again")
        channels = _channels(path)
        return [path / name / channel if len(channels) > 1 else path / name for name in names for channel in channels]
    if not path.is_dir():
        return [path] if _is_tables(path.parent.parent) and path.name in _channels(path.parent.parent) else []
    return [scene for tables in sorted(path.glob("v1.0-*")) if _is_tables(tables) for scene in find(tables)]


def _channels(tables: Path) -> list[str]:
    """Return what the LiDARs are called: nuScenes has one, TruckScenes six."""
    return sorted(row["channel"] for row in _read(tables, "sensor") if row["channel"].startswith("LIDAR"))


def _is_tables(path: Path) -> bool:
    return all(is_there(path / f"{name}.json") for name in ("scene", "sample", "sample_data"))


class NuscenesSequence(DrawnTruth, ListedSequence):
    """One scene, in the frame of the LiDAR."""

    def __init__(self, path: Path):
        """Find the sweeps of the scene that `path` names below its tables.

        Raises
        ------
        InputError
            No such scene, a damaged table, or a table that names a file or row that is absent.
        """
        place = path if _is_tables(path.parent) else path.parent
        tables = place.parent
        channel = _channels(tables)[0] if place == path else path.name
        scenes, data = tables / "scene.json", tables / "sample_data.json"
        scene = next((row for row in _read(tables, "scene") if row["name"] == place.name), None)
        if scene is None:
            raise InputError(f"{scenes} has no scene {place.name!r}; its scenes are listed by giving {tables}")
        samples = {row["token"]: row for row in _read(tables, "sample") if row["scene_token"] == scene["token"]}
        sweeps = _sweeps_of(tables, samples, channel)
        files = [tables.parent / row["filename"] for row in sweeps]
        absent = next((file for file in files if not file.exists()), None)
        if absent is not None:
            raise InputError(f"{data} names {absent}, which is absent; unpack the archive of its sweeps too")
        name = place.name if place == path else f"{place.name}_{channel}"
        super().__init__(path, files, [1e-6 * row["timestamp"] for row in sweeps], name)
        self._T_global_sensor = _named_by(sweeps, tables, "ego_pose") @ _named_by(sweeps, tables, "calibrated_sensor")
        self._keyframe_of = [row["sample_token"] if row["is_key_frame"] else None for row in sweeps]
        self._drawn = _boxes_of(tables, samples)

    def __getitem__(self, index: int) -> Scan:
        path = self.paths[index := self._scan_number(index)]
        return self._to_scan(index, read_columns(path, "pcd" if path.suffix == ".pcd" else "bin5"))

    @property
    def reference_poses(self) -> Pose:
        """(len, 4, 4) T_world_sensor from the tables."""
        return sensor_poses(self._T_global_sensor)

    def _boxes_of(self, index: int) -> tuple[DrawnBoxes, Pose] | None:
        """Return the boxes of a keyframe. An instance moves if any of its attributes in the scene says so."""
        keyframe = self._keyframe_of[index]
        if keyframe is None or self._drawn is None:
            return None
        return self._drawn.of(keyframe), self._T_global_sensor[index]


@lru_cache(maxsize=8)
def _read(tables: Path, name: str) -> list[Row]:
    path, remedy = tables / f"{name}.json", "unpack the metadata of nuScenes again"
    with damage_reported(path, "is damaged", remedy, remedy):
        rows = read_json(path)
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise ValueError("it is no list of rows")
    return rows


def _named_by(sweeps: list[Row], tables: Path, name: str) -> Pose:
    """Return (N, 4, 4) the transforms of a table's rows that the rows of sweeps name."""
    path, tokens = tables / f"{name}.json", [row[f"{name}_token"] for row in sweeps]
    wanted = set(tokens)
    found = {row["token"]: row for row in _read(tables, name) if row["token"] in wanted}
    missing = next(iter(wanted - found.keys()), None)
    if missing is not None:
        raise InputError(f"{path} has no row {missing}, which another table names; unpack it again")
    return _transforms([found[token] for token in tokens], path)


def _sweeps_of(tables: Path, samples: dict[str, Row], channel: str) -> list[Row]:
    """Return the rows of one LiDAR's sweeps in a scene, in order of time."""
    sensors = {row["token"] for row in _read(tables, "sensor") if row["channel"] == channel}
    mounts = {row["token"] for row in _read(tables, "calibrated_sensor") if row["sensor_token"] in sensors}
    of_scene = (row for row in _read(tables, "sample_data") if row["sample_token"] in samples)
    rows = [row for row in of_scene if row["calibrated_sensor_token"] in mounts]
    if not rows:
        raise InputError(f"{tables / 'sample_data.json'} has no sweeps of the {channel} for this scene")
    links = {row["token"] for row in rows} | {"", None}
    lost = next((row[way] for row in rows for way in ("prev", "next") if row.get(way) not in links), None)
    if lost is not None:
        raise InputError(
            f"{tables / 'sample_data.json'} has no row {lost}, which others name as the sweep beside them; it was cut: "
            "unpack it again"
        )
    return sorted(rows, key=lambda row: row["timestamp"])


def _transforms(rows: list[Row], path: Path) -> Pose:
    """Return (N, 4, 4) of rows of the table at `path` with a translation and a rotation, scalar first."""
    with damage_reported(path):
        quaternions = np.roll([row["rotation"] for row in rows], -1, axis=1)
        return from_quaternions([row["translation"] for row in rows], quaternions, path)


def _boxes_of(tables: Path, samples: dict[str, Row]) -> DrawnBoxes | None:
    """Return the boxes of a scene by keyframe, in the global frame; None where it came without, as the test split."""
    path = tables / "sample_annotation.json"
    if not is_there(path):
        return None
    rows = [row for row in _read(tables, "sample_annotation") if row["sample_token"] in samples]
    if not rows:
        return None
    T_global_box = _transforms(rows, path)
    yaw = np.arctan2(T_global_box[:, 1, 0], T_global_box[:, 0, 0])
    size = np.array([row["size"] for row in rows], np.float64)[:, [1, 0, 2]]  # theirs is width, length, height
    boxes = checked_boxes(T_global_box[:, :3, 3], size, yaw, path)
    seconds = np.array([1e-6 * samples[row["sample_token"]]["timestamp"] for row in rows])
    keyframes, instances = (np.array([row[f"{of}_token"] for row in rows]) for of in ("sample", "instance"))
    drawn = DrawnBoxes.judged(keyframes, instances, boxes, seconds, np.eye(4))
    attributes = {row["token"]: row["name"] for row in _read(tables, "attribute")}
    said: dict[str, set[str]] = defaultdict(set)
    for row in rows:
        said[row["instance_token"]] |= {attributes[token] for token in row["attribute_tokens"]}
    told = {one: Label.MOVING if names & _MOVING else Label.STATIC for one, names in said.items() if names}
    labels = [told.get(one, label) for one, label in zip(instances.tolist(), drawn.label, strict=True)]
    return replace(drawn, label=np.array(labels, np.uint8))


FORMAT = Format(
    layout="nuScenes, TruckScenes: v1.0-*/*.json, samples/, sweeps/; give a scene: v1.0-mini/scene-0061",
    truth="boxes of the keyframes and their attributes",
    find=find,
    open=NuscenesSequence,
)
