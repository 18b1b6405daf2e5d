"""Scenes to be reconstructed: NVIDIA NCore v4, and drivestudio's processed scene.

NCore: one store with the sensor's poses, its rays as measured, and tracks of boxes of what moves.

The world is the level frame, the rig is the sensor. Poses are stored at the start, the middle and the end of each
sweep, so that poses between them compensate the rays as they were when they were labelled.

Drivestudio: pictures, cameras, poses, points and what moves, as it loads KITTI.

It is of recordings whose cameras are read, which are KITTI's raw drives. The vehicle is the sensor, the world the level
frame. Masks of the sky come from programs of its own.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path, write_json, write_raw, write_text
from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.core.geometry import inverse, make_transform, se3_exp, transform
from automos.core.labels import Label
from automos.core.scan import Array, Pose
from automos.objects.kinds import Kind
from automos.odometry.elevation import raised_scan
from automos.readers.kitti_raw import KittiRawSequence
from automos.results.run_files import RunFiles
from automos.results.run_objects import Box
from automos.writers.formats import Export, intensity_of, make_folders
from automos.writers.training.scans import full_scale_of

_LIDAR = "lidar"


def _write_ncore(run: RunFiles, out: Path) -> None:
    """Write `out / <recording>.ncore4.zarr.itar`; labels, objects and rings are generic data of each frame."""
    v4, upath = import_extra("ncore.data.v4", "ncore"), import_extra("upath", "ncore")
    interval = import_extra("ncore.impl.common.transformations", "ncore").HalfClosedInterval
    times, poses = _sweeps(run)
    with tempfile.TemporaryDirectory(dir=out, prefix=".automos-") as scratch:
        whole, name = interval.from_start_end(int(times[0, 0]), int(times[-1, -1])), run.sequence.name
        store = v4.SequenceComponentGroupsWriter(upath.UPath(scratch), name, name, whole, {"labelled by": "automos"})
        for component in (v4.IntrinsicsComponent, v4.MasksComponent):  # empty ones, which its loader asks for
            store.register_component_writer(component.Writer, "default")
        placed = store.register_component_writer(v4.PosesComponent.Writer, "default")
        placed.store_static_pose(_LIDAR, "rig", np.eye(4))
        placed.store_dynamic_pose("rig", "world", poses.reshape(-1, 4, 4), times.ravel())
        rays, scale = store.register_component_writer(v4.LidarSensorComponent.Writer, _LIDAR), full_scale_of(run)
        boxes: list[Any] = []
        for index in run.each("writing rays"):
            rays.store_frame(**_rays(run, index, times[index], scale), model_element=None, generic_meta_data={})
            boxes += _boxes(run, index, int(times[index, 1]))
        store.register_component_writer(v4.CuboidsComponent.Writer, "default").store_observations(boxes)
        for made in store.finalize():
            with atomic_path(out / made.name) as temporary:
                Path(made).replace(temporary)


def _sweeps(run: RunFiles) -> tuple[npt.NDArray[np.uint64], Pose]:
    """Return (N, 3) microseconds and (N, 3, 4, 4) poses in the level frame: start, middle and end of each sweep."""
    path = run.frames.trajectory
    if len(run) < 2 or (np.diff(run.stamps) < 1e-5).any():
        raise InputError(f"{run.sequence.name} has one scan, or two at one time: NCore asks for a time of each")
    steps = np.diff(run.stamps, append=2.0 * run.stamps[-1] - run.stamps[-2])
    middle = np.round(1e6 * (run.stamps - min(0.0, float(run.stamps[0] - steps[0])))).astype(np.int64)
    half = np.maximum(np.round(0.5e6 * abs(path.timing.share) * steps).astype(np.int64), 1)
    start, end = middle - half, middle + half
    start[1:] = np.maximum(start[1:], end[:-1] + 1)  # sweeps that follow each other share an instant
    twists = [np.outer((-0.5, 0.0, 0.5), motion) for motion in path.sweep_motion]
    poses = np.stack([[run.T_level_sensor(k) @ se3_exp(xi) for xi in twists[k]] for k in range(len(run))])
    return np.column_stack([start, middle, end]).astype(np.uint64), poses


def _rays(run: RunFiles, index: int, times: npt.NDArray[np.uint64], full_scale: float) -> dict[str, Any]:
    """Return the rays of the points of use of scan `index` as measured; `times` (3,) are its start, middle and end."""
    scan, frame = run.scan(index), run.frames[index]
    points = raised_scan(scan, run.frames.trajectory.elevation).points[frame.kept].astype(np.float64)
    ranges = np.linalg.norm(points, axis=1)
    share = np.zeros(len(points)) if frame.sweep_time is None else frame.sweep_time.astype(np.float64)
    instants = np.round(float(times[1]) + share * float(times[2] - times[0])).astype(np.uint64)
    labels, instances = run.labels(index, len(scan))[frame.kept], run.instances(index, len(scan))[frame.kept]
    generic = {"label": labels, "moving": labels == Label.MOVING, "instance": instances.astype(np.uint32)}
    if scan.ring is not None:
        generic["ring"] = scan.ring[frame.kept]
    return {
        "direction": (points / ranges[:, None]).astype(np.float32),
        "timestamp_us": np.clip(instants, times[0], times[2]),
        "distance_m": ranges[None].astype(np.float32),
        "intensity": np.clip(intensity_of(scan)[None, frame.kept] / np.float32(full_scale), 0.0, 1.0),
        "frame_timestamps_us": times[[0, 2]],
        "generic_data": generic,
    }


def _boxes(run: RunFiles, index: int, time: int) -> list[Any]:
    types = import_extra("ncore.impl.data.types", "ncore")
    return [
        types.CuboidTrackObservation(
            track_id=str(box.id),
            class_id=box.kind.name.lower(),
            timestamp_us=time,
            reference_frame_id="world",
            reference_frame_timestamp_us=time,
            bbox3=types.BBox3(tuple(box.center.tolist()), tuple(box.size.tolist()), (0.0, 0.0, box.yaw)),
            source=types.LabelSource.AUTOLABEL,
        )
        for box in run.boxes_level(index).moving
    ]


_CAMERAS = (2, 3)
_CLASS_OF_KIND = ("Car", "Truck", "Cyclist", "Pedestrian", "Van")
_HUMANS = (Kind.TWO_WHEELER, Kind.PERSON)
_MASKS = ("all", "human", "vehicle")
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def _write_drivestudio(run: RunFiles, out: Path) -> None:
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
    write_json(out / "instances" / "instances_info.json", objects)
    write_json(out / "instances" / "frame_instances.json", frames)


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


def _write_table(path: Path, rows: Array) -> None:
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


EXPORTS = {
    "ncore": Export("NVIDIA NCore v4: RECORDING.ncore4.zarr.itar, tracks of boxes", _write_ncore, needs="ncore"),
    "drivestudio": Export(
        "drivestudio's processed scene: images, lidar, ego_pose, instances, dynamic_masks", _write_drivestudio
    ),
}
