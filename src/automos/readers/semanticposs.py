"""SemanticPOSS: KITTI's layout beside tag/*.tag, with classes of its own numbers.

It says what things are, not whether they move: what cannot move is static; people, riders, cars and bikes have no
truth.
"""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label
from automos.readers import kitti
from automos.readers.formats import Format

_STATIC = (8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 22)
"""Trunk, plants, traffic signs, pole, trashcan, building, cone, fence, ground."""


def find(path: Path) -> list[Path]:
    """Return the recordings at `path` that have tags."""
    return [recording for recording in kitti.find(path) if (recording / "tag").is_dir()]


class SemanticPossSequence(kitti.KittiSequence):
    """One sequence."""

    def truth(self, index: int) -> npt.NDArray[np.uint32] | None:
        """Return (N,) uint32: STATIC for what cannot move, UNLABELED for all else, ids in the upper 16 bits."""
        packed = super().truth(index)
        if packed is None:
            return None
        label = np.where(np.isin(packed & 0xFFFF, _STATIC), Label.STATIC, Label.UNLABELED)
        return (packed & np.uint32(0xFFFF0000)) | label.astype(np.uint32)


FORMAT = Format(
    layout="SemanticPOSS: KITTI's layout and tag/*.tag",
    truth="static classes of labels/*.label; what moves is not labelled",
    find=find,
    open=SemanticPossSequence,
)
