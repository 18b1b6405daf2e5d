"""SemanticKITTI's labels: their classes, and its files of one uint32 per point; and files of confidences."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.labels import Label
from automos.core.reading import damage_reported, read_array, read_bytes, require_regular

OUTLIER = 1
"""SemanticKITTI's number for drops, dust and false returns in the air. Its moving-object benchmark leaves them out."""


def to_mos(semantic: npt.ArrayLike) -> npt.NDArray[np.uint8]:
    """Return SemanticKITTI labels mapped as its moving-object benchmark maps them (semantic-kitti-mos.yaml).

    Parameters
    ----------
    semantic : (N,) integers; the lower 16 bits are the class, the upper 16 the instance.

    Returns
    -------
    (N,) uint8 with the values of `Label`: 9..99 are STATIC, 251..259 MOVING, everything else UNLABELED.
    """
    classes = np.asarray(semantic).astype(np.uint32) & 0xFFFF
    moves, stands = _moves(classes), (classes >= Label.STATIC) & (classes < 100)
    return np.select([moves, stands], [Label.MOVING, Label.STATIC], Label.UNLABELED).astype(np.uint8)


def find_unknown(semantic: npt.NDArray[np.uint32]) -> int | None:
    """Return a class among `semantic` (N,) that SemanticKITTI does not have (0 to 99, 251 to 259); None if all are."""
    classes = semantic & 0xFFFF
    is_known = (classes < 100) | _moves(classes)
    return None if is_known.all() else int(classes[is_known.argmin()])


def _moves(classes: npt.NDArray[np.integer]) -> npt.NDArray[np.bool_]:
    return (classes >= Label.MOVING) & (classes < 260)


def pack(labels: npt.NDArray, instances: npt.NDArray | None = None) -> npt.NDArray[np.uint32]:
    """Return (N,) uint32 labels as SemanticKITTI stores them: class below, instance id in the upper 16 bits."""
    packed = labels.astype(np.uint32)
    if instances is not None:
        # 16 bits are all the format has; ids beyond it wrap but never to 0, which means "no instance".
        ids = instances.astype(np.int64)
        packed |= np.where(ids > 0, (ids - 1) % 0xFFFF + 1, 0).astype(np.uint32) << np.uint32(16)
    return packed


def read_labels(path: Path, n_points: int | None = None) -> npt.NDArray[np.uint32]:
    """Return the (n_points,) uint32 labels in a .label file; as many as it holds where their number is not given.

    Raises
    ------
    InputError
        A file that is absent, of another number of points, or with a class that there is not.
    """
    with damage_reported(path, missing="each scan needs a label file of its name"):
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
