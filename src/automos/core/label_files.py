"""SemanticKITTI's label files, one uint32 per point: read and checked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.labels import find_unknown
from automos.core.reading import read_bytes, require_regular


def read_labels(path: Path, n_points: int) -> npt.NDArray[np.uint32]:
    """Return the (n_points,) uint32 labels in a .label file.

    Raises
    ------
    InputError
        A file that is absent, of another number of points, or with a class that there is not.
    """
    try:
        require_regular(path)
        size = path.stat().st_size  # before anything is read: a damaged file system gives files any
        if size % 4:
            raise InputError(f"{path} has {size} bytes, no multiple of a label (uint32, 4 bytes); copy it again")
        if size != 4 * n_points:
            raise InputError(
                f"{path} holds {size // 4} labels, but its scan has {n_points} points; it belongs to another scan or "
                "was cut short"
            )
        labels = np.frombuffer(read_bytes(path), np.uint32)
    except FileNotFoundError:
        raise InputError(f"{path} is missing; each scan needs a label file of its name") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    if (unknown := find_unknown(labels)) is not None:
        raise InputError(f"{path} has a point of class {unknown}, which SemanticKITTI has not; copy it again")
    return labels
