"""The files with one value per point: labels and, on demand, their confidence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.atomic import write_npy, write_raw
from automos.core.labels import Label, pack


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
