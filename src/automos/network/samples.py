"""What one training step sees: windows drawn from recordings, changed at random, as images with targets."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from automos.core.arrays import evenly_spread
from automos.core.errors import InputError
from automos.core.geometry import Array
from automos.core.run import Progress, silent
from automos.network.augmentation import UNCHANGED, apply_change, draw_change
from automos.network.images import BASE_CHANNELS, make_image
from automos.network.projection import Image
from automos.network.recordings import LabelledRecording, Labels, Shelf
from automos.settings import NetworkSettings

Rows = npt.NDArray[np.int64]
_CACHED_SCANS = 200
"""Scans kept in memory, thinned to one point per pixel: half a gigabyte at most, at the full image."""
_CLASS_NAMES = ("unlabeled", "static", "moving")


class _Samples:
    """Windows of several recordings with half of their past or more: row by row, recording and scan."""

    def __init__(self, recordings: list[LabelledRecording], settings: NetworkSettings, cached: int):
        self._shelf, self._settings = Shelf(recordings, cached), settings
        self._all = np.array([(r, i) for r, recording in enumerate(recordings) for i in recording.with_past])
        self._order = self._all

    def __len__(self) -> int:
        return len(self._order)

    @property
    def neighbours(self) -> Rows:
        """Return all indices, those of neighbouring scans together."""
        return np.lexsort(self._order.T[::-1])


class TrainingSamples(_Samples):
    """Windows of several recordings; which ones, and how they are changed, follows from seed and epoch alone."""

    def __init__(self, recordings: list[LabelledRecording], settings: NetworkSettings):
        super().__init__(recordings, settings, _CACHED_SCANS)
        self.begin_epoch(0)

    def begin_epoch(self, epoch: int) -> None:
        """Draw the windows of an epoch."""
        training = self._settings.training
        rng = np.random.default_rng([training.seed, epoch, 1])
        self._order, self._epoch = self._all[draw_order(len(self._all), training.samples, rng)], epoch

    def __getitem__(self, index: int) -> dict[str, npt.NDArray]:
        if not 0 <= index < len(self):
            raise IndexError(index)
        recording, scan = self._order[index]
        size, training = self._settings.image, self._settings.training
        rng = np.random.default_rng([training.seed, self._epoch, index, 2])
        window, labels = self._shelf.window(int(recording), int(scan))
        change = draw_change(rng, size.height, size.width) if training.augment else UNCHANGED
        grid = self._shelf.recordings[recording].grid
        window, rows = apply_change(window, change, grid, rng)
        image = make_image(window, grid)
        target, confidence = _targets(image.index, labels.classes[rows], labels.confidence[rows])
        columns = draw_sector(target, training.sector, rng)
        sample: dict[str, npt.NDArray] = {"image": image.channels[:, :, columns], "target": target[:, columns]}
        if training.use_confidence:
            sample["confidence"] = confidence[:, columns]
        return sample


class ValidationSamples(_Samples):
    """Windows evenly spread over several recordings, unchanged."""

    def __init__(self, recordings: list[LabelledRecording], settings: NetworkSettings):
        super().__init__(recordings, settings, _CACHED_SCANS // 10)
        self._order = np.array(evenly_spread(self._all, settings.training.validation_scans))

    def begin_epoch(self, epoch: int) -> None:
        """Do nothing: they are the same in every epoch."""

    def __getitem__(self, index: int) -> dict[str, npt.NDArray]:
        recording, scan = self._order[index]
        window, labels = self._shelf.window(int(recording), int(scan))
        image = make_image(window, self._shelf.recordings[recording].grid)
        target, _ = _targets(image.index, labels.classes, labels.confidence)
        return {"image": image.channels, "target": target}


def draw_order(n: int, wanted: int, rng: np.random.Generator) -> Rows:
    """Return `wanted` (0: `n`) of the numbers below `n`, in rounds: none comes twice more often than another."""
    wanted = wanted or n
    return np.concatenate([rng.permutation(n) for _ in range(-(-wanted // n))])[:wanted]


def draw_sector(target: npt.NDArray, n_columns: int, rng: np.random.Generator) -> Rows | slice:
    """Return which columns to train on: all where `n_columns` is 0, else a sector, every other time of what moves.

    Little of a scan moves, and a step costs what its pixels cost: so more of what is learnt from is seen for it.
    """
    width = target.shape[1]
    if not 0 < n_columns < width:
        return slice(None)
    middle = rng.integers(width)
    moving = np.flatnonzero((target == 2).any(axis=0))
    if len(moving) and rng.random() < 0.5:
        middle = rng.choice(moving) + rng.integers(-n_columns // 3, n_columns // 3)
    return (middle - n_columns // 2 + np.arange(n_columns)) % width


def _targets(index: npt.NDArray[np.int32], classes: Labels, confidence: Image) -> tuple[npt.NDArray, Image]:
    """Return the class (H, W) int64 and the confidence (H, W) of what each pixel shows; 0 if it shows nothing."""
    if len(classes) == 0:
        return np.zeros(index.shape, np.int64), np.zeros(index.shape, np.float32)
    is_seen = index >= 0
    rows = np.maximum(index, 0)
    return np.where(is_seen, classes[rows], 0).astype(np.int64), np.where(is_seen, confidence[rows], np.float32(0.0))


def measure_classes(recordings: list[LabelledRecording], progress: Progress = silent, n_scans: int = 60) -> Array:
    """Return (3,) class weights, 1 / sqrt(share of labelled points) and 0 for unlabeled, from evenly spread scans.

    LMNet weighs by 1 / share, so that a pixel counts as moving from a probability of its share on: a few percent, which
    finds more than moves. Doing without weights starts too slowly; the root lies between.

    Raises
    ------
    InputError : no point of a class in any of them.
    """
    counts = np.zeros(3)
    for recording, index in _spread_scans(recordings, n_scans, "labels", progress):
        counts += np.bincount(recording.read(index).classes, minlength=3)[:3]
    for c in (1, 2):
        if counts[c] == 0:
            names = ", ".join(recording.sequence.name for recording in recordings[:5])
            raise InputError(
                f"no {_CLASS_NAMES[c]} point in the labels of {names}: add recordings in which there are some"
            )
    share = counts[1:] / counts[1:].sum()
    return np.concatenate([[0.0], 1.0 / np.sqrt(share)])


def measure_scale(
    recordings: list[LabelledRecording], progress: Progress = silent, n_scans: int = 20
) -> tuple[npt.NDArray, npt.NDArray]:
    """Return the mean and the standard deviation (2,) of the base channels over the pixels that show something."""
    n = len(BASE_CHANNELS)
    pixels = []
    for recording, index in _spread_scans(recordings, n_scans, "channels", progress):
        window, _ = recording.window(index, recording.read)
        channels = make_image(window, recording.grid).channels[:n]
        pixels.append(channels[:, channels[0] > 0.0])
    values = np.concatenate(pixels, axis=1).astype(np.float64)
    deviation = np.maximum(values.std(axis=1), 1e-3)
    return values.mean(axis=1).astype(np.float32), deviation.astype(np.float32)


def _spread_scans(
    recordings: list[LabelledRecording], n_scans: int, what: str, progress: Progress
) -> Iterator[tuple[LabelledRecording, int]]:
    """Yield about `n_scans` scans, some of every recording."""
    each = max(-(-n_scans // len(recordings)), 1)
    chosen = [(recording, i) for recording in recordings for i in evenly_spread(range(len(recording)), each)]
    for done, one in enumerate(chosen, start=1):
        yield one
        progress(what, done, len(chosen))
