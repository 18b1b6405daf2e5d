"""OpenSceneFlow's HDF5: one file per recording, one group per scan, and the index of scans for its data loader.

Points, poses and flow are in the sensor's frame. Poses are float32 there, so they are relative to the first scan.
What moves is `dufo`, and on which object `dufocluster`: self-supervised trainers (SeFlow, TeFlow) ask for these, and
for scans ten times a second. Categories of moving points go by the size of their object.
"""

import pickle
from pathlib import Path

import numpy as np

from automos.core.atomic import atomic_path
from automos.core.geometry import inverse
from automos.core.labels import Label
from automos.readers.formats import import_extra
from automos.results.run_files import RunFiles
from automos.writers.flow import scan_flow, timestamps
from automos.writers.formats import Export
from automos.writers.point_columns import intensity_of

CATEGORIES = np.array([19, 11, 4, 17, 19], np.uint8)
"""Argoverse 2's numbers of each `Kind`: regular and large vehicle, bicyclist, pedestrian; 0 is none."""


def write(run: RunFiles, out: Path) -> None:
    """Write `out / <recording>.h5`, index_total.pkl (all scans) and index_flow.pkl (all but the last) into `out`."""
    h5py = import_extra("h5py", "flow")
    out.mkdir(parents=True, exist_ok=True)
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
    for index_file, listed in (("index_total.pkl", rows), ("index_flow.pkl", rows[:-1])):
        with atomic_path(out / index_file) as temporary, temporary.open("wb") as file:
            pickle.dump(listed, file)


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


EXPORT = Export(
    writes="scene flow: RECORDING.h5, index_*.pkl, as OpenSceneFlow loads it",
    write=write,
    needs="flow",
    modules=("h5py",),
)
