"""The files with one value per point: labels, objects and confidences, written and read."""

from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.arrays import Ints
from automos.core.atomic import write_npy, write_raw
from automos.core.errors import InputError
from automos.core.label_files import pack, read_confidences, read_labels, to_mos
from automos.core.labels import Label, as_probability
from automos.evaluation.predictions import StoredStages


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

    def instances(self, index: int, n_points: int | None = None) -> Ints:
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
