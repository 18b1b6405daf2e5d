"""drivestudio's processed scene: pictures, cameras, poses, points and what moves, as it loads KITTI.

It is of recordings whose cameras are read, which are KITTI's raw drives. The vehicle is the sensor, the world the level
frame. Masks of the sky come from programs of its own.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path, write_raw, write_text
from automos.core.errors import InputError
from automos.core.geometry import inverse, make_transform, transform
from automos.core.scan import Pose
from automos.objects.kinds import Kind
from automos.readers.kitti_raw import KittiRawSequence
from automos.results.run_files import RunFiles
from automos.results.run_objects import Box
from automos.writers.formats import Export, make_folders
from automos.writers.point_columns import intensity_of

_CAMERAS = (2, 3)
_CLASS_OF_KIND = ("Car", "Truck", "Cyclist", "Pedestrian", "Van")
_HUMANS = (Kind.TWO_WHEELER, Kind.PERSON)
_MASKS = ("all", "human", "vehicle")
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def write(run: RunFiles, out: Path) -> None:
    """Write the folder `out` of one scene.

    Raises
    ------
    InputError
        The recording has no cameras, or a scan has no picture.
    """
    drive = run.sequence
    if not isinstance(drive, KittiRawSequence):
        raise InputError(f"{drive.name} has no cameras that are read: drivestudio asks for a raw drive of KITTI's")
    missing = (drive.picture(n, k) for n in _CAMERAS for k in range(len(run)) if not drive.picture(n, k).exists())
    if (path := next(missing, None)) is not None:
        raise InputError(f"{path} is missing, and drivestudio asks for the pictures of both cameras: download them")
    masks = [f"dynamic_masks/{kind}" for kind in _MASKS]
    make_folders(out, "images", "extrinsics", "intrinsics", "ego_pose", "lidar", "instances", *masks)
    cameras = [_write_camera(drive, number, out, name) for name, number in enumerate(_CAMERAS)]
    number_of: dict[int, int] = {}
    objects: dict[str, Any] = {}
    frames: dict[str, list[int]] = {}
    for index in run.each("writing scene"):
        _write_points(run, index, out)
        moving = run.boxes_level(index).moving
        for name, (number, T_camera_sensor, K) in enumerate(cameras):
            size = _write_picture(drive.picture(number, index), out / "images" / f"{index:03d}_{name}.jpg")
            T_camera_level = T_camera_sensor @ inverse(run.T_level_sensor(index))
            _write_masks(moving, T_camera_level, K, size, out / "dynamic_masks", f"{index:03d}_{name}.png")
        for box in moving:
            number = number_of.setdefault(box.id, len(number_of))
            entry = objects.setdefault(
                str(number),
                {
                    "id": str(box.id),
                    "class_name": _CLASS_OF_KIND[box.kind],
                    "frame_annotations": {"frame_idx": [], "obj_to_world": [], "box_size": []},
                },
            )
            values = (index, box.pose.round(6).tolist(), box.size.tolist())
            for column, value in zip(entry["frame_annotations"].values(), values, strict=True):
                column.append(value)
        frames[str(index)] = [number_of[box.id] for box in moving]
    write_text(out / "instances" / "instances_info.json", json.dumps(objects))
    write_text(out / "instances" / "frame_instances.json", json.dumps(frames))


def _write_camera(drive: KittiRawSequence, number: int, out: Path, name: int) -> tuple[int, Pose, npt.NDArray]:
    """Write a camera's calibration; return its number, T_camera_sensor and K (3, 3)."""
    T_rectified_sensor, projection, _ = drive.camera(number)
    K = projection[:, :3]
    T_camera_sensor = make_transform(t=np.linalg.solve(K, projection[:, 3])) @ T_rectified_sensor
    _write_table(out / "extrinsics" / f"{name}.txt", inverse(T_camera_sensor))
    _write_table(out / "intrinsics" / f"{name}.txt", np.array([[K[0, 0], K[1, 1], K[0, 2], K[1, 2], *5 * [0.0]]]).T)
    return number, T_camera_sensor, K


def _write_points(run: RunFiles, index: int, out: Path) -> None:
    scan = run.scan(index)
    rows = np.column_stack([run.points_at_pose(scan, index), intensity_of(scan)])[scan.is_valid]
    write_raw(out / "lidar" / f"{index:03d}.bin", rows.astype(np.float32))
    _write_table(out / "ego_pose" / f"{index:03d}.txt", run.T_level_sensor(index))


def _write_table(path: Path, rows: npt.NDArray[np.float64]) -> None:
    write_text(path, "".join(" ".join(f"{value:.12g}" for value in row) + "\n" for row in rows))


def _write_picture(source: Path, target: Path) -> tuple[int, int]:
    """Write `source` as JPEG; return its width and height."""
    from PIL import Image

    with Image.open(source) as picture, atomic_path(target) as temporary:
        picture.convert("RGB").save(temporary, "JPEG", quality=95)
        return picture.size


def _write_masks(
    moving: list[Box], T_camera_level: Pose, K: npt.NDArray, size: tuple[int, int], folder: Path, name: str
) -> None:
    """Write pictures that are white in the rectangles around boxes that the camera sees whole."""
    from PIL import Image

    masks = {kind: np.zeros(size[::-1], np.uint8) for kind in _MASKS}
    for box in moving:
        corners = transform(T_camera_level @ box.pose, _CORNERS * box.size)
        if corners[:, 2].min() <= 0.0:
            continue
        pixels = (corners / corners[:, 2:]) @ K.T
        (left, top), (right, bottom) = pixels[:, :2].min(axis=0).astype(int), pixels[:, :2].max(axis=0).astype(int)
        if left >= 0 and top >= 0 and right < size[0] and bottom < size[1]:
            for kind in ("all", "human" if box.kind in _HUMANS else "vehicle"):
                masks[kind][top:bottom, left:right] = 255
    for kind, mask in masks.items():
        with atomic_path(folder / kind / name) as temporary:
            Image.fromarray(mask).save(temporary, "PNG")


EXPORT = Export(writes="drivestudio's processed scene: images, lidar, ego_pose, instances, dynamic_masks", write=write)
