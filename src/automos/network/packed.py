"""Samples prepared beforehand: drawn, changed, projected and packed in files, so that a GPU waits for none of it.

FOLDER/image.npy       (N, 2 + K, H, W) float16
FOLDER/target.npy      (N, H, W) uint8, and confidence.npy float16 where it is used
FOLDER/packed.json     what they were made of, and how many parts of them are done: packing goes on after a stop

A packed sample is one change of one window. In every epoch it is mirrored anew, which costs nothing.
"""

import json
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import write_json
from automos.core.parallel import map_in_order
from automos.core.run import Progress
from automos.network.samples import TrainingSamples, ValidationSamples, draw_order, draw_sector
from automos.settings import NetworkSettings

_TYPES = {"image": np.float16, "target": np.uint8, "confidence": np.float16}
_AT_ONCE = 32
"""Samples of a part, which one process makes: neighbours, so that it reads few scans more than once."""


def pack(
    samples: TrainingSamples | ValidationSamples, folder: Path, key: str, workers: int, progress: Progress
) -> None:
    """Write all of `samples` into `folder`, by `workers` processes (0: one per core); what `key` made stays."""
    folder.mkdir(exist_ok=True)
    state, rows = folder / "packed.json", samples.neighbours
    done = _parts_done(state, key)
    if done == 0:
        for name, value in samples[0].items():
            shape = (len(samples), *value.shape)
            np.lib.format.open_memmap(folder / f"{name}.npy", "w+", _TYPES[name], shape).flush()
    parts = [rows[k : k + _AT_ONCE] for k in range(0, len(rows), _AT_ONCE)]
    for _ in map_in_order(partial(_fill, samples, folder), parts[done:], workers, chunk=1):
        done += 1
        write_json(state, {"key": key, "parts": done})
        progress(folder.name, min(done * _AT_ONCE, len(samples)), len(samples))


def _parts_done(state: Path, key: str) -> int:
    found = json.loads(state.read_text()) if state.exists() else {}
    return int(found["parts"]) if found.get("key") == key else 0


def _fill(samples: TrainingSamples | ValidationSamples, folder: Path, rows: npt.NDArray[np.int64]) -> None:
    for row in rows:
        for name, value in samples[int(row)].items():
            np.load(folder / f"{name}.npy", mmap_mode="r+")[row] = value


class PackedSamples:
    """What `pack` left, in the order and with the turns that an epoch draws; as it is without `settings`."""

    def __init__(self, folder: Path, settings: NetworkSettings | None = None):
        self._training = None if settings is None else settings.training
        self._arrays = {path.stem: np.load(path, mmap_mode="r") for path in sorted(folder.glob("*.npy"))}
        self._n = len(self._arrays["target"])
        self.begin_epoch(0)

    def begin_epoch(self, epoch: int) -> None:
        """Draw the order anew."""
        self._epoch, self._order = epoch, np.arange(self._n)
        if self._training is not None:
            rng = np.random.default_rng([self._training.seed, epoch, 3])
            self._order = draw_order(self._n, self._training.samples, rng)

    def __len__(self) -> int:
        return len(self._order)

    def __getitem__(self, index: int) -> dict[str, npt.NDArray]:
        if not 0 <= index < len(self):
            raise IndexError(index)
        row = self._order[index]
        columns: slice | npt.NDArray[np.int64] = slice(None)
        if self._training is not None:
            rng = np.random.default_rng([self._training.seed, self._epoch, index, 4])
            columns = draw_sector(self._arrays["target"][row], self._training.sector, rng)
            if self._training.augment and rng.random() < 0.5:
                columns = np.arange(self._arrays["target"].shape[2])[columns][::-1]
        sample = {name: np.ascontiguousarray(values[row][..., columns]) for name, values in self._arrays.items()}
        return sample | {"image": sample["image"].astype(np.float32), "target": sample["target"].astype(np.int64)}
