"""Simulated worlds on disk, small and whole: raw sweeps as KITTI's files would hold them, and their points' labels.

One .npz a world: coordinates as float32, intensity in the sensor's own steps, labels as uint8. A world that is there
already is not simulated again. Real drives are where AUTOMOS_RECORDINGS has them.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos import open_sequence
from automos.core.atomic import atomic_path
from automos.core.scan import Scan, Sequence
from automos.simulation import FORMAT, simulate


class StoredWorld(Sequence):
    """A world read from its file; points have no times and no beams, as in KITTI's files."""

    def __init__(self, source: Path):
        self.source, self.name = source, source.stem

    @cached_property
    def _facts(self) -> dict[str, npt.NDArray]:
        with np.load(self.source) as arrays:
            return {name: arrays[name] for name in ("stamps", "levels", "poses")}

    def __len__(self) -> int:
        return len(self._facts["stamps"])

    def __getitem__(self, index: int) -> Scan:
        index = range(len(self))[index]
        with np.load(self.source) as arrays:
            points, steps = arrays[f"points_{index}"], arrays[f"intensity_{index}"]
        intensity = (steps / float(self._facts["levels"])).astype(np.float32)
        return Scan(points, intensity, stamp=float(self.stamps[index]), name=f"{index:06d}")

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        return self._facts["stamps"]

    @property
    def reference_poses(self) -> npt.NDArray[np.float64]:
        return self._facts["poses"]

    def truth(self, index: int) -> npt.NDArray[np.uint32]:
        with np.load(self.source) as arrays:
            return arrays[f"labels_{range(len(self))[index]}"].astype(np.uint32)

    def fingerprint(self) -> str:
        return f"{super().fingerprint()}:v{FORMAT}"


def stored_world(
    store: Path,
    scenario: str,
    sensor: str,
    n_scans: int,
    seed: int,
    progress: Callable[[str, int, int], None] | None = None,
) -> StoredWorld:
    """Return a world from folder `store`, simulated first where it is not there."""
    path = store / "worlds" / f"{scenario}-{sensor}-{n_scans}-{seed}-v{FORMAT}.npz"
    if not path.exists():
        world = simulate(scenario, sensor, n_scans, seed)
        arrays: dict[str, npt.NDArray] = {
            "stamps": world.stamps,
            "poses": world.reference_poses,
            "levels": np.array(world.sensor.levels),
        }
        for index in range(len(world)):
            scan, truth = world[index], world.truth(index)
            steps = np.round(scan.intensity * world.sensor.levels)
            arrays[f"points_{index}"] = scan.points
            arrays[f"intensity_{index}"] = steps.astype(np.uint8 if world.sensor.levels < 256 else np.uint16)
            arrays[f"labels_{index}"] = (truth & 0xFFFF).astype(np.uint8)
            if progress is not None:
                progress("simulate", index + 1, len(world))
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as temporary, open(temporary, "wb") as file:
            np.savez(file, **arrays)
    return StoredWorld(path)


def real_drive(name: str) -> Sequence:
    """Return a real recording of the folder that AUTOMOS_RECORDINGS names."""
    return open_sequence(Path(os.environ.get("AUTOMOS_RECORDINGS", "recordings")) / "sequences" / name)
