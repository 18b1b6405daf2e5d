"""NVIDIA NCore v4: one store with the sensor's poses, its rays as measured, and tracks of boxes of what moves.

The world is the level frame, the rig is the sensor. Poses are stored at the start, the middle and the end of each
sweep, so that poses between them compensate the rays as they were when they were labelled.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path
from automos.core.errors import InputError
from automos.core.geometry import se3_exp
from automos.core.labels import Label
from automos.core.scan import Pose
from automos.odometry.elevation import raised_scan
from automos.readers.formats import import_extra
from automos.results.run_files import RunFiles
from automos.writers.formats import Export
from automos.writers.point_columns import intensity_of
from automos.writers.training.scans import full_scale_of

_LIDAR = "lidar"


def write(run: RunFiles, out: Path) -> None:
    """Write `out / <recording>.ncore4.zarr.itar`; labels, objects and rings are generic data of each frame."""
    v4, upath = import_extra("ncore.data.v4", "ncore"), import_extra("upath", "ncore")
    interval = import_extra("ncore.impl.common.transformations", "ncore").HalfClosedInterval
    times, poses = _sweeps(run)
    out.mkdir(parents=True, exist_ok=True)
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


EXPORT = Export(
    writes="NVIDIA NCore v4: RECORDING.ncore4.zarr.itar, tracks of boxes",
    write=write,
    needs="ncore",
    modules=("ncore", "upath"),
)
