"""A results folder: whether it is ours and nobody else writes there, and its files with one value per point.

These are labels, objects and confidences, written and read.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.arguments import require_own_names
from automos.core.atomic import faults_reported, held, remove_parts, write_npy, write_raw
from automos.core.claims import RESULTS, claim, remove
from automos.core.errors import InputError
from automos.core.label_files import read_confidences, read_labels
from automos.core.labels import Label, as_probability, pack, to_mos
from automos.core.scan import Sequence
from automos.core.workspace import RESULT_FILES, RUN_FILE, Workspace
from automos.evaluation.predictions import StoredStages
from automos.readers.files import holds_scans

PER_SCAN = ("predictions/*.label", "confidences/*.npy", "probabilities/*.npy")
"""What a results folder holds of every scan."""


def per_scan_files(folder: Path) -> list[Path]:
    """Return the files that `folder` holds of each scan."""
    return [path for pattern in PER_SCAN for path in folder.glob(pattern)]


def require_room(folder: Path, recording: Sequence | None) -> None:
    """Claim `folder` for results; InputError where it is not ours, or a scan has a name that no file can have."""
    if recording is not None:
        Workspace(folder).require_names(recording.names, len(recording))
    claim(folder, RESULTS)


def refuse_scans(folder: Path) -> None:
    """Raise InputError where `folder`, in which results would lie in folders of their own, is some recording's."""
    if any(holds_scans(place) for place in (folder, folder / "velodyne") if place.is_dir()):
        raise InputError(f"{folder} holds the scans of a recording: choose another --out")


def refuse_unrepeatable(folder: Path) -> None:
    """Raise InputError where nothing makes the labels in `folder` again: they were corrected, or a sensor's."""
    if (folder / "merge.json").exists():
        raise InputError(f"{folder} holds labels corrected by automos merge, which would be lost: choose another --out")
    if Workspace(folder).read_run().get("recording", {}).get("is_sensor"):
        raise InputError(f"{folder} holds labels of what a sensor sent, which would be lost: choose another --out")


def refuse_others_results(folder: Path, sequence: Sequence) -> None:
    """Raise InputError where `folder`, which nobody chose, holds the results of another recording that is still there.

    Recordings of one name (`data`, `velodyne`) would have one default folder, and the second run would replace what the
    first found, and what a person decided of it.
    """
    was = Workspace(folder).read_run().get("recording", {}).get("source")
    if was is None or sequence.address is None or not os.path.exists(was):
        return
    if os.path.realpath(was) != os.path.realpath(sequence.address):
        raise InputError(f"{folder} holds the results of {was}, another recording of that name: choose another --out")


def results_folders(recordings: list[Sequence], out: Path | None, default: Path) -> list[Path]:
    """Return the results folder of each recording: `out` itself for one, else a folder of its name in it, or `default`.

    Raises
    ------
    InputError : two are named alike, or nobody chose the folder, and it holds results of another recording.
    """
    require_own_names([sequence.name for sequence in recordings])
    if out is not None and len(recordings) == 1:
        return [out]
    folders = [(out or default) / sequence.name for sequence in recordings]
    if out is None:
        for folder, sequence in zip(folders, recordings, strict=True):
            refuse_others_results(folder, sequence)
    return folders


def refuse_folder_of(sequence: Sequence, folder: Path) -> None:
    """Raise InputError where `folder` is the recording's own: points in another format would be read as its scans."""
    if sequence.source is not None and os.path.realpath(sequence.source) == os.path.realpath(folder):
        raise InputError(f"{folder} is the folder of the recording {sequence.name}: choose another --out")


@contextmanager
def claimed(folder: Path, places: list[str], recording: Sequence | None) -> Iterator[None]:
    """Hold the results folder of what labels scan by scan (`automos segment`, `live`), emptied, until the block ends.

    Parameters
    ----------
    places : folders in it that are made.
    recording : where one is labelled; its own folder is not written into. None of a sensor: no labels are replaced.

    Raises
    ------
    InputError : the folder holds what other commands or programs wrote, another process writes, or writing fails.
    """
    with held(folder):
        if any((folder / "stages").glob("*")):
            raise InputError(f"{folder} holds labels that automos segment did not write: choose another --out")
        refuse_unrepeatable(folder)
        require_room(folder, recording)
        if recording is None and any(folder.glob(PER_SCAN[0])):
            raise InputError(f"{folder} holds labels of an earlier run, which would be lost: choose another --out")
        with faults_reported(folder):
            for stale in [*(folder / name for name in (RUN_FILE, *RESULT_FILES)), *per_scan_files(folder)]:
                remove(stale)
            for name in places:
                (folder / name).mkdir(exist_ok=True)
            remove_parts(folder)
        yield


def no_points() -> dict[str, int]:
    """Return how many points have each label, none yet."""
    return dict.fromkeys((label.name.lower() for label in Label), 0)


def count_points(counts: dict[str, int], labels: npt.NDArray) -> None:
    """Add the points of a scan, `labels` (N,), to `counts`."""
    for label in Label:
        counts[label.name.lower()] += int(np.count_nonzero(labels == label))


def write_points(
    folder: Path,
    name: str,
    labels: npt.NDArray,
    track_ids: npt.NDArray | None,
    confidence: npt.NDArray[np.float32] | None,
) -> None:
    """Write what is known of the points of scan `name` into the results folder `folder`.

    labels : (N,) of `Label`.   track_ids : (N,), -1 for none, where they are wanted.
    confidence : (N,) in [0, 1], where it is wanted.
    """
    write_raw(folder / "predictions" / f"{name}.label", pack(labels, None if track_ids is None else track_ids + 1))
    if confidence is not None:
        write_npy(folder / "confidences" / f"{name}.npy", confidence)


class PointFiles:
    """What a results folder says of every point, after what a person decided.

    folder : the results folder.   names : of the scans.   predictions : the folder of their label files.
    """

    def __init__(self, folder: Path, names: list[str], predictions: Path):
        self.folder, self.names, self._predictions = folder, names, predictions

    @cached_property
    def stored(self) -> StoredStages:
        """What the run's stages keep."""
        return StoredStages(self.folder)

    def packed(self, index: int, n_points: int | None = None) -> npt.NDArray[np.uint32]:
        """Return the (n_points,) uint32 of scan `index` as they are in its label file."""
        return read_labels(self._predictions / f"{self.names[index]}.label", n_points)

    def labels(self, index: int, n_points: int | None = None) -> npt.NDArray[np.uint8]:
        """Return the labels of scan `index`, in the order of its points.

        Parameters
        ----------
        index : int
            Number of the scan, from 0.
        n_points : int, optional
            How many points the scan has; InputError where there is another number of labels.

        Returns
        -------
        (N,) uint8
            `Label` of each point.
        """
        return to_mos(self.packed(index, n_points))

    def instances(self, index: int, n_points: int | None = None) -> npt.NDArray[np.int64]:
        """Return (N,) the id of the object that each moving point belongs to, 0 for none.

        Raises
        ------
        InputError
            Neither the label files nor the run's stages say so.
        """
        tracks = self.stored.tracks(self.names[index], self.packed(index, n_points))
        if tracks is None:
            raise self._silent("which object each point belongs to", "--set output.track_ids=true")
        return tracks

    def confidence(self, index: int) -> npt.NDArray[np.float32]:
        """Return (N,) the probability in [0, 1] that each label of scan `index` is right, 0 where nothing was found.

        Raises
        ------
        InputError
            Neither the folder `confidences` nor the run's stages say so.
        """
        path = self.folder / "confidences" / f"{self.names[index]}.npy"
        if path.exists():
            return read_confidences(path, len(self.packed(index)))
        found = self.stored.of_points(self.names[index], "confidence")
        if found is None:
            raise self._silent("how sure each label is", "--confidence")
        return as_probability(found)

    def _silent(self, asked: str, option: str) -> InputError:
        return InputError(f"{self.folder} does not say {asked}; label again with {option}")
