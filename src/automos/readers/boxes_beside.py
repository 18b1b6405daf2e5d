"""Boxes beside the scans, boxes/NAME.json, as `automos simulate` writes them: every object, in the level frame."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.errors import InputError
from automos.core.geometry import transform
from automos.core.labels import Label
from automos.core.reading import is_there, read_json
from automos.core.scan import Sequence
from automos.core.upright_boxes import Boxes, TrueBoxes
from automos.readers.box_truth import checked_boxes, motion_with_boxes
from automos.readers.stamped_poses import rigid_transforms

FOLDER = "boxes"


def boxes_beside(source: Path, name: str) -> TrueBoxes | None:
    """Return the boxes that `source` has of scan `name`; None without, InputError where they are damaged."""
    path = source / FOLDER / f"{name}.json"
    if not is_there(path):
        return None  # before anything is read: few recordings have boxes, and all their scans are asked
    try:
        document = read_json(path)
        rows = document["boxes"]
        columns = [np.array([row[key] for row in rows], np.float64) for key in ("center", "size", "yaw")]
        ids = np.array([row["id"] for row in rows], np.int64)
        center, size, yaw = columns[0].reshape(-1, 3), columns[1].reshape(-1, 3), columns[2].reshape(len(ids))
        T_level_sensor = np.array(document["T_level_sensor"], np.float64).reshape(4, 4)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is not a file of boxes ({error!r}); simulate the recording again") from None
    return TrueBoxes(ids, checked_boxes(center, size, yaw, path), rigid_transforms(T_level_sensor[None], path)[0])


def motion_beside(source: Path, sequence: Sequence, index: int) -> npt.NDArray[np.float32] | None:
    """Return what `Sequence.truth_motion` does, of the boxes in `source`; None without boxes or instance ids.

    Raises
    ------
    InputError : a file of boxes that is damaged.
    """
    names = sequence.names
    now = boxes_beside(source, names[index])
    truth = None if now is None else sequence.truth(index)
    if now is None or truth is None:
        return None
    later = boxes_beside(source, names[index + 1]) if index + 1 < len(names) else None
    ids, boxes = (np.zeros(0, np.int64), Boxes.empty()) if later is None else later[:2]
    points = transform(now.T_boxes_sensor, sequence[index].points)
    motion = motion_with_boxes(points, (truth >> 16).astype(np.int64), now[:2], (ids, boxes))
    motion = motion @ now.T_boxes_sensor[:3, :3].astype(np.float32)
    motion[(truth & 0xFFFF) == Label.UNLABELED] = np.nan
    return motion
