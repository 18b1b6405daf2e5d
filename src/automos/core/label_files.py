"""SemanticKITTI's label files, one uint32 per point, and files of confidences: read and checked."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.labels import find_unknown
from automos.core.reading import damage_reported, read_array, read_bytes, require_regular


def read_labels(path: Path, n_points: int | None = None) -> npt.NDArray[np.uint32]:
    """Return the (n_points,) uint32 labels in a .label file; as many as it holds where their number is not given.

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
        if n_points is not None and size != 4 * n_points:
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


def read_confidences(path: Path, n_points: int) -> npt.NDArray[np.float32]:
    """Return the (n_points,) confidences in [0, 1] in a file of `--confidence`; InputError where it holds others."""
    with damage_reported(path, "holds no confidences of its scan"):
        certain = read_array(path)
        if certain.shape != (n_points,) or certain.dtype.kind != "f" or not ((certain >= 0) & (certain <= 1)).all():
            raise ValueError(f"{n_points} numbers from 0 to 1 are needed")
    return certain
