"""A second cue of motion: the probabilities of a network that has labelled the recording before.

Its log-odds are added to those of the evidence. They are bounded, so that clear evidence is not outvoted.
"""

import hashlib
from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.reading import read_array
from automos.settings import SelfTrainingSettings

_MOST = 0.98  # upper bound of the network's probabilities: a few in a hundred of the labels of its training are wrong


def add_cue(
    log_odds: npt.NDArray[np.floating], probability: npt.NDArray[np.floating], settings: SelfTrainingSettings
) -> npt.NDArray[np.float16]:
    """Return (M,) `log_odds` of having moved plus the weighted log-odds of the network's `probability` (M,)."""
    bounded = np.clip(probability.astype(np.float64), 1.0 - _MOST, _MOST)
    return (log_odds + settings.weight * np.log(bounded / (1.0 - bounded))).astype(np.float16)


def read_cue(settings: SelfTrainingSettings, name: str, n_points: int) -> npt.NDArray[np.floating]:
    """Return (n_points,) probabilities of the scan `name`; InputError if they are missing or of another scan."""
    path = Path(settings.folder) / f"{name}.npy"
    try:
        probability = read_array(path)
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path} cannot be read ({error}): self_training.folder must hold what automos segment --probabilities "
            "writes for this recording"
        ) from None
    if probability.dtype.kind != "f" or not ((probability >= 0.0) & (probability <= 1.0)).all():
        raise InputError(f"{path} does not hold probabilities from 0 to 1: segment it again")
    if probability.shape != (n_points,):
        raise InputError(f"{path} has shape {probability.shape}, but the scan has {n_points} points: segment it again")
    return probability


def cue_fingerprint(settings: SelfTrainingSettings) -> str:
    """Return a text that changes whenever a file of the cue changes."""
    digest = hashlib.sha256()
    for path in sorted(Path(settings.folder).glob("*.npy")):
        status = path.stat()
        digest.update(f"{path.name}\0{status.st_size}\0{status.st_mtime_ns}\n".encode())
    return digest.hexdigest()
