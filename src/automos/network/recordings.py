"""Recordings with labels, manual or automatic, as the network learns from them.

A scan is read, compensated and thinned to the points its image shows; that is all a window needs of it, for its own
pixels as for the residuals of later scans. Thinned scans are kept in memory up to a number, nothing is stored on disk.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.arrays import evenly_spread
from automos.core.beam_pattern import learn_pattern
from automos.core.errors import InputError
from automos.core.label_files import read_confidences, read_labels, to_mos
from automos.core.labels import Label
from automos.core.run import Progress, Run, silent
from automos.core.scan import Frame, Sequence
from automos.core.stages import fingerprint
from automos.core.workspace import Workspace
from automos.evaluation.predictions import StoredStages, find_predictions
from automos.network.images import SPACING, Window, pick_past, thin
from automos.network.projection import ImageGrid, beam_grid
from automos.odometry.estimate import estimate_trajectory
from automos.odometry.trajectory import Trajectory, make_frame
from automos.readers import open_recordings
from automos.settings import ImageSettings, Settings

Labels = npt.NDArray[np.uint8]

_CLASS = np.zeros(256, np.uint8)
_CLASS[Label.STATIC], _CLASS[Label.MOVING] = 1, 2


@dataclass(frozen=True)
class Source:
    """Where a recording and its labels are: those that came with it, or a results folder of `automos label`."""

    recording: Path
    results: Path | None = None

    @staticmethod
    def parse(text: str) -> Source:
        """Return the source that `RECORDING` or `RECORDING=RESULTS` names."""
        recording, sign, results = text.partition("=")
        if sign and not results:
            raise InputError(f"{text} names no results folder after '=': write RECORDING=RESULTS, or RECORDING alone")
        return Source(Path(recording), Path(results) if sign else None)


@dataclass(frozen=True, eq=False)
class ThinScan:
    """The points of one scan that its image shows.

    Attributes
    ----------
    points : (M, 3) float32, metres, sensor frame, compensated.
    classes : (M,) uint8: 0 unlabeled, 1 static, 2 moving.
    confidence : (M,) float32 in [0, 1].
    """

    points: npt.NDArray[np.float32]
    classes: Labels
    confidence: npt.NDArray[np.float32]


class ScanLabels:
    """The labels of a recording: those of a results folder, else its own."""

    def __init__(self, sequence: Sequence, results: Path | None = None):
        """Find them; raise InputError if there are none."""
        self.sequence = sequence
        self.folder = None if results is None else find_predictions(results, sequence.name, is_only=True)
        if results is None and all(sequence.truth(i) is None for i in range(min(len(sequence), 10))):
            raise InputError(
                f"{sequence.name} came without labels: label it first and give RECORDING=RESULTS, or leave it out"
            )

    def read(self, index: int, n_points: int) -> tuple[Labels, npt.NDArray[np.float32]]:
        """Return the (N,) labels of a scan, 0 if nobody labelled it, and how sure each is."""
        name = self.sequence.names[index]
        certain = np.ones(n_points, np.float32)
        if self.folder is None:
            truth = self.sequence.truth(index)
            return (np.zeros(n_points, np.uint8) if truth is None else to_mos(truth)), certain
        path = self.folder.parent / "confidences" / f"{name}.npy"
        if path.exists():
            certain = read_confidences(path, n_points)
        return to_mos(read_labels(self.folder / f"{name}.label", n_points)), certain

    def have(self, label: Label) -> bool:
        """Whether any point of any scan has `label`; every tenth scan is read first."""
        scans = sorted(range(len(self.sequence)), key=lambda i: i % 10)
        return any((self.read(i, len(self.sequence[i]))[0] == label).any() for i in scans)


class LabelledRecording:
    """One recording with its poses, its labels and the way its sensor's scans become images."""

    def __init__(self, labels: ScanLabels, trajectory: Trajectory, settings: ImageSettings):
        self.sequence, self.trajectory, self.settings = labels.sequence, trajectory, settings
        self._labels = labels
        few = evenly_spread(range(len(self)), 5)
        self.grid = measure_grid([make_frame(self.sequence[i], trajectory, i) for i in few], settings)

    def __len__(self) -> int:
        return len(self.sequence)

    @property
    def with_past(self) -> range:
        """Scans with half of the past that residuals show or more, by which motion is seen; all, where none has it."""
        stamps = self.trajectory.stamps
        first = int(np.searchsorted(stamps, stamps[0] + 0.499 * SPACING * self.settings.residuals))
        return range(first if first < len(self) else 0, len(self))

    def read(self, index: int) -> ThinScan:
        """Return scan `index`, thinned."""
        scan = self.sequence[index]
        frame = make_frame(scan, self.trajectory, index)
        labels, confidence = self._labels.read(index, len(scan))
        rows = thin(frame.points, self.grid)
        kept = frame.kept[rows]
        return ThinScan(frame.points[rows], _CLASS[labels[kept]], confidence[kept])

    def window(self, index: int, read: Callable[[int], ThinScan]) -> tuple[Window, ThinScan]:
        """Return scan `index` with the earlier scans that its residuals need, each from `read`."""
        now = read(index)
        stamps, poses = self.trajectory.stamps, self.trajectory.T_world_sensor
        reach = SPACING * (self.settings.residuals + 1)
        first = int(np.searchsorted(stamps, stamps[index] - 1.001 * reach))
        ages = stamps[index] - stamps[first:index][::-1]
        chosen = pick_past(ages, self.settings.residuals)
        past = tuple(None if k < 0 else read(index - 1 - int(k)).points for k in chosen)
        T_now_past = np.linalg.inv(poses[index]) @ poses[[index if k < 0 else index - 1 - int(k) for k in chosen]]
        return Window(now.points, past, T_now_past), now


class Shelf:
    """Thinned scans of several recordings, the latest used kept in memory."""

    def __init__(self, recordings: list[LabelledRecording], size: int):
        """Keep at most `size` scans."""
        self.recordings, self._size = recordings, size
        self._kept: OrderedDict[tuple[int, int], ThinScan] = OrderedDict()

    def window(self, recording: int, index: int) -> tuple[Window, ThinScan]:
        """Return scan `index` of one of the recordings with its past."""
        return self.recordings[recording].window(index, lambda i: self._read(recording, i))

    def _read(self, recording: int, index: int) -> ThinScan:
        key = (recording, index)
        scan = self._kept.pop(key, None) or self.recordings[recording].read(index)
        self._kept[key] = scan
        while len(self._kept) > self._size:
            self._kept.popitem(last=False)
        return scan


def open_labelled(
    sources: Iterable[Source], settings: Settings, cache: Path, progress: Progress = silent
) -> list[LabelledRecording]:
    """Return the recordings of `sources`; poses are those of the results folder, else estimated once into `cache`.

    Raises
    ------
    InputError : nothing to read, no labels, labels of other scans, or nothing that moves or is static in any of them.
    """
    labelled = []
    for source in sources:
        sequences = open_recordings(source.recording)
        for sequence in sequences:
            results = source.results
            if results is not None and len(sequences) > 1:
                results = results / sequence.name
            labelled.append(ScanLabels(sequence, results))
    for label in (Label.STATIC, Label.MOVING):  # before poses, which take far longer
        if not any(labels.have(label) for labels in labelled):
            names = ", ".join(labels.sequence.name for labels in labelled[:5])
            raise InputError(f"no {label.name.lower()} point in the labels of {names}: add recordings that have some")
    return [
        LabelledRecording(each, _trajectory(each, settings, cache, progress), settings.network.image)
        for each in labelled
    ]


def measure_grid(frames: list[Frame], settings: ImageSettings) -> ImageGrid:
    """Return how a sensor's scans become images, from a few of its frames."""
    pattern = learn_pattern(frames)
    return beam_grid(settings.height, settings.width, pattern.row_of_sine, pattern.n_rows)


def _trajectory(labels: ScanLabels, settings: Settings, cache: Path, progress: Progress) -> Trajectory:
    sequence = labels.sequence
    found = None if labels.folder is None else StoredStages(labels.folder).load("odometry", "all")
    if found is None:
        key = fingerprint(sequence.fingerprint(), settings.odometry.model_dump(mode="json"))
        tell = lambda _, done, total: progress(f"poses {sequence.name}", done, total)  # noqa: E731
        find = partial(estimate_trajectory, sequence, settings.odometry, None)
        kept = Run(Workspace(cache), {"odometry": key}, sequence.names, tell)
        found = kept.once("odometry", lambda tick: find(tick).to_arrays())
    return Trajectory.from_arrays(found)
