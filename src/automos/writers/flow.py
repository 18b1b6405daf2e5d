"""Scene flow of a run: the motion of each point until the next scan, on its own and as seen by the moving sensor.

A point moves with its track; all others are static. The apparent motion by the sensor follows from the poses.

As Argoverse 2 scores it: LOG/TIMESTAMP.feather, a row per point of the sweep. Flow leads from a point to its place in
the next sweep's frame, the sensor's own motion included. Of an Argoverse log it is in the vehicle's frame, as there;
else in the sensor's. The last sweep has no next one and no file.

OpenSceneFlow's HDF5: one file per recording, one group per scan, and the index of scans for its data loader. Points,
poses and flow are in the sensor's frame. Poses are float32 there, so they are relative to the first scan. What moves is
`dufo`, and on which object `dufocluster`: self-supervised trainers (SeFlow, TeFlow) ask for these, and for scans ten
times a second. Categories of moving points go by the size of their object.
"""

import pickle
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import atomic_path, write_bytes
from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.core.geometry import inverse, transform
from automos.core.labels import Label
from automos.core.scan import Ints, Mask, Pose, Sequence
from automos.evaluation.flow import DYNAMIC, FlowCounts, evaluate_flow
from automos.results.open_run import runs_in
from automos.results.run_files import RunFiles
from automos.writers.formats import Export, intensity_of, microseconds

Motion = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class ScanFlow:
    """The flow of one scan's points to the next scan.

    Attributes
    ----------
    points : (N, 3) metres, as seen from the scan's pose (motion during the sweep taken out).
    own : (N, 3) metres that each point itself moves, sensor frame of this scan.
    T_next_this : (4, 4) from this scan's sensor frame to the next one's.
    is_dynamic : (N,) whether a point moves faster than a crawl.
    is_known : (N,) False for points without a label, and for moving ones on no track.
    instances : (N,) track ids, 0 for none.
    """

    points: npt.NDArray[np.float32]
    own: Motion
    T_next_this: Pose
    is_dynamic: Mask
    is_known: Mask
    instances: Ints

    @property
    def flow(self) -> Motion:
        """(N, 3) metres from each point to its place in the next scan's sensor frame."""
        return (transform(self.T_next_this, self.points + self.own) - self.points).astype(np.float32)


def scan_flow(run: RunFiles, index: int) -> ScanFlow:
    """Return the flow of scan `index`, which must not be the last, to the next one."""
    scan = run.scan(index)
    labels, instances = run.labels(index, len(scan)), run.instances(index, len(scan))
    found = run.boxes_level(index)
    seconds = float(run.stamps[index + 1] - run.stamps[index])
    step = np.zeros((max(int(found.ids.max(initial=0)), int(instances.max(initial=0))) + 1, 3))
    has_track = np.zeros(len(step), bool)
    # Velocities are level; those of rows are turned by the transposed rotation on their right.
    step[found.ids] = seconds * found.velocity @ run.T_level_sensor(index)[:3, :3]
    has_track[found.ids] = True
    is_moving = labels == Label.MOVING
    own = np.where(is_moving[:, None], step[instances], 0.0).astype(np.float32)
    return ScanFlow(
        points=run.points_at_pose(scan, index),
        own=own,
        T_next_this=inverse(run.T_world_sensor[index + 1]) @ run.T_world_sensor[index],
        is_dynamic=np.linalg.norm(own, axis=1) >= DYNAMIC * seconds,
        is_known=scan.is_valid & (labels != Label.UNLABELED) & (~is_moving | has_track[instances]),
        instances=instances,
    )


def score_flow(results: Path, sequences: Iterable[Sequence]) -> FlowCounts | None:
    """Return how far off the flow in a results folder is; None without truth of motion, or where labels are all it is.

    Parameters
    ----------
    results : as `evaluate_recordings` takes it.
    """
    total = None
    has_truth = lambda s: any(s.truth_motion(i) is not None for i in range(len(s) - 1))  # noqa: E731
    for run in runs_in(results, list(sequences), has_truth):
        try:
            counts = evaluate_flow(run.sequence, lambda i, run=run: scan_flow(run, i).own)  # type: ignore[misc]
        except InputError:
            continue  # labels without instances, of a run whose stages are gone
        total = counts if total is None else total + counts
    return total


def timestamps(run: RunFiles) -> list[str]:
    """Return the scans' times in nanoseconds, as texts: their own names where those are, else rounded to 1 us.

    Of sixteen digits, names may count microseconds (Waymo's do); the scans' stamps show it.
    """
    if all(name.isdecimal() and len(name) >= 16 for name in run.names):
        counts = np.array([float(name) for name in run.names])
        if not np.allclose(1e-6 * counts, run.stamps, rtol=0.0, atol=1e-3):
            return list(run.names)
    return [str(1000 * value) for value in microseconds(run).tolist()]


def _write_av2(run: RunFiles, out: Path) -> None:
    """Write `out / recording / <nanoseconds>.feather`: flow_tx_m, flow_ty_m, flow_tz_m (float16), is_dynamic."""
    arrow, feather = import_extra("pyarrow", "arrow"), import_extra("pyarrow.feather", "arrow")
    folder = out / run.sequence.name
    folder.mkdir(parents=True, exist_ok=True)
    T_vehicle_sensor, stamps = run.sequence.T_vehicle_sensor, timestamps(run)
    for index in run.each("writing flow"):
        if index + 1 == len(run):
            break
        found = scan_flow(run, index)
        flow = found.flow if T_vehicle_sensor is None else found.flow @ T_vehicle_sensor[:3, :3].T
        columns = {f"flow_t{axis}_m": arrow.array(flow[:, k].astype(np.float16)) for k, axis in enumerate("xyz")}
        table = arrow.table({**columns, "is_dynamic": arrow.array(found.is_dynamic)})
        with atomic_path(folder / f"{stamps[index]}.feather") as temporary:
            feather.write_feather(table, temporary)


CATEGORIES = np.array([19, 11, 4, 17, 19], np.uint8)
"""Argoverse 2's numbers of each `Kind`: regular and large vehicle, bicyclist, pedestrian; 0 is none."""


def _write_opensceneflow(run: RunFiles, out: Path) -> None:
    """Write `out / <recording>.h5`, index_total.pkl (all scans) and index_flow.pkl (all but the last) into `out`."""
    h5py = import_extra("h5py", "flow")
    name, stamps = run.sequence.name, timestamps(run)
    # its loader finds a recording's last scan by comparing these as text: 1 s comes after 0.9 s
    width = max(map(len, stamps))
    stamps = [stamp.zfill(width) for stamp in stamps]
    # Through Python's file: where the disk is full, HDF5's own ends the process.
    with atomic_path(out / f"{name}.h5") as temporary, temporary.open("w+b") as raw, h5py.File(raw, "w") as file:
        for index in run.each("writing flow"):
            for key, values in _group(run, index).items():
                file.create_dataset(f"{stamps[index]}/{key}", data=values)
    rows = [[name, stamp] for stamp in stamps]
    write_bytes(out / "index_total.pkl", pickle.dumps(rows))
    write_bytes(out / "index_flow.pkl", pickle.dumps(rows[:-1]))


def _group(run: RunFiles, index: int) -> dict[str, np.ndarray]:
    """Return the arrays of scan `index`, of its points of use only: trainers sort whatever is there into voxels."""
    scan = run.scan(index)
    is_moving, instances = run.labels(index, len(scan)) == Label.MOVING, run.instances(index, len(scan))
    _, clusters = np.unique(np.append(0, np.where(is_moving, instances, 0)), return_inverse=True)
    T_world_sensor = inverse(run.T_world_sensor[0]) @ run.T_world_sensor[index]
    group = {
        "lidar": np.column_stack([run.points_at_pose(scan, index), intensity_of(scan)]).astype(np.float32),
        "ground_mask": run.is_ground(scan, index),
        "dufo": is_moving.astype(np.uint8),
        "dufocluster": clusters[1:].astype(np.int16),
        "lidar_id": np.ones(len(scan), np.uint8),
        "lidar_dt": np.zeros(len(scan), np.float32) if scan.time is None else scan.time.astype(np.float32),
    }
    of_scan = {"pose": T_world_sensor.astype(np.float32)}
    if index + 1 < len(run):
        found = scan_flow(run, index)
        of_scan["ego_motion"] = found.T_next_this.astype(np.float32)
        group |= {
            "flow": found.flow,
            "flow_is_valid": found.is_known,
            "flow_category_indices": np.where(found.instances > 0, CATEGORIES[run.kinds(found.instances)], np.uint8(0)),
            # 15 bits are all there is: ids beyond wrap, but never to 0, which means "no instance", or below.
            "flow_instance_id": np.where(found.instances > 0, (found.instances - 1) % 0x7FFF + 1, 0).astype(np.int16),
        }
    return {name: values[scan.is_valid] for name, values in group.items()} | of_scan


EXPORTS = {
    "flow-av2": Export("scene flow: LOG/TIMESTAMP.feather, as Argoverse 2 scores it", _write_av2, needs="arrow"),
    "opensceneflow": Export(
        "scene flow: RECORDING.h5, index_*.pkl, as OpenSceneFlow loads it", _write_opensceneflow, needs="flow"
    ),
}
