"""Recordings by name: real ones, simulated worlds, and either as another recorder would have kept it.

A name is a folder, the name of a folder in `sequences/` of AUTOMOS_RECORDINGS, or a world as
scenario:sensor:scans:seed (`avenue:OS1-128:60:4`); then, where wanted, ~K (stamps off by a tenth of a millisecond,
drawn with seed K: nobody would call it another recording) or @CASE, one of `cases.py` (`city:VLP-16:40:2@dust`), or the
fields of a recorder's convention (`DRIVE@turns=1.09;order=time`).
"""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
from cases import ALTERED, CASES, Case, Recording, kept_by

from automos import open_sequence
from automos.core.atomic import atomic_path
from automos.core.errors import InputError
from automos.core.scan import Scan, Sequence
from automos.core.upright_boxes import Boxes, TrueBoxes
from automos.simulation import FORMAT, Convention, simulate

JITTER = 1e-4
"""Seconds, the standard deviation of stamps that are off."""


@contextmanager
def opened(name: str, store: Path) -> Iterator[Recording]:
    """Give the recording called `name`; worlds are kept in folder `store`."""
    base, _, case = name.partition("@")
    base, _, seed = base.partition("~")
    if case in CASES or "=" in case:
        kept = CASES.get(case) or Case(Convention.parse(case.split(";")))
        with tempfile.TemporaryDirectory() as folder:
            yield kept_by(kept, _world_of(base) or _real(base), Path(folder) / "recording")
        return
    world = _world_of(base)
    sequence = stored_world(store, *world) if world else _real(base)
    if case:
        if case not in ALTERED:
            raise InputError(f"{name}: there is no case '{case}' in benchmarks/cases.py")
        yield Recording(ALTERED[case](sequence), has_noisy_poses=case == "noisy poses")
    else:
        yield Recording(Jittered(sequence, int(seed)) if seed else sequence)


def _world_of(name: str) -> tuple[str, str, int, int] | None:
    if name.count(":") != 3 or Path(name).exists():
        return None
    scenario, sensor, n_scans, seed = name.split(":")
    return scenario, sensor, int(n_scans), int(seed)


def _real(name: str) -> Sequence:
    root = os.environ.get("AUTOMOS_RECORDINGS")
    if Path(name).exists() or root is None:
        return open_sequence(Path(name))
    return open_sequence(Path(root) / "sequences" / name)


class Jittered(Sequence):
    """A recording whose stamps are off by a tenth of a millisecond."""

    def __init__(self, inner: Sequence, seed: int):
        if inner.stamps is None:
            raise InputError(f"{inner.name} has no stamps that could be off")
        self._inner, self.name = inner, f"{inner.name}~{seed}"
        self._stamps = inner.stamps + np.random.default_rng(seed).normal(0.0, JITTER, len(inner))

    def __len__(self) -> int:
        return len(self._inner)

    def __getitem__(self, index: int) -> Scan:
        index = range(len(self))[index]
        return replace(self._inner[index], stamp=float(self._stamps[index]))

    @property
    def stamps(self) -> npt.NDArray[np.float64]:
        return self._stamps

    @property
    def is_compensated(self) -> bool | None:
        return self._inner.is_compensated

    @property
    def reference_poses(self) -> npt.NDArray[np.float64] | None:
        return self._inner.reference_poses

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        return self._inner.truth(index)

    def truth_boxes(self, index: int) -> TrueBoxes | None:
        return self._inner.truth_boxes(index)


class StoredWorld(Sequence):
    """A world read from its file; points have no times and no beams, as in KITTI's files."""

    def __init__(self, source: Path):
        self.source, self.name = source, source.stem

    @cached_property
    def _facts(self) -> dict[str, npt.NDArray]:
        with np.load(self.source) as arrays:
            return {name: arrays[name] for name in ("stamps", "levels", "poses", "T_level_world")}

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
            return arrays[f"labels_{range(len(self))[index]}"]

    def truth_now(self, index: int) -> npt.NDArray[np.uint32]:
        """Return (N,) labels as `truth`, but moving is what moves in this very sweep."""
        with np.load(self.source) as arrays:
            return arrays[f"now_{range(len(self))[index]}"]

    def truth_boxes(self, index: int) -> TrueBoxes:
        with np.load(self.source) as arrays:
            rows = arrays[f"boxes_{range(len(self))[index]}"]
        boxes = Boxes(rows[:, 1:4], rows[:, 4:7], rows[:, 7], np.ones(len(rows)))
        return TrueBoxes(rows[:, 0].astype(np.int64), boxes, self._facts["T_level_world"] @ self.reference_poses[index])

    def fingerprint(self) -> str:
        return f"{super().fingerprint()}:v{FORMAT}"


def stored_world(store: Path, scenario: str, sensor: str, n_scans: int, seed: int) -> StoredWorld:
    """Return a world from folder `store`, simulated first where it is not there.

    One .npz a world: coordinates as float32, intensity in the sensor's own steps, labels with instances, of whole
    lives and of now, boxes.
    """
    path = store / "worlds" / f"{scenario}-{sensor}-{n_scans}-{seed}-v{FORMAT}-now.npz"
    if not path.exists():
        world = simulate(scenario, sensor, n_scans, seed)
        levels = world.sensor.levels
        arrays: dict[str, npt.NDArray] = {
            "stamps": world.stamps,
            "poses": world.reference_poses,
            "levels": np.array(levels),
            "T_level_world": world.T_level_world,
        }
        for index in range(len(world)):
            scan, truth = world[index], world.truth(index)
            steps = np.round(scan.intensity * levels)
            arrays[f"points_{index}"] = scan.points
            arrays[f"intensity_{index}"] = steps.astype(np.uint8 if levels < 256 else np.uint16)
            arrays[f"labels_{index}"], arrays[f"now_{index}"] = truth, world.truth_now(index)
            ids, boxes, _ = world.truth_boxes(index)
            arrays[f"boxes_{index}"] = np.column_stack([ids, boxes.center, boxes.size, boxes.yaw])
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as temporary, open(temporary, "wb") as file:
            np.savez(file, **arrays)
    return StoredWorld(path)
