"""The labels of one scan after its boxes were corrected.

A correction changes only the points of an object whose box was moved, removed or given another verdict, and points that
are now in a moving box. The ground under a moving object is not changed.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from automos.core.labels import Label
from automos.core.scan import Ints, Mask, Points
from automos.core.upright_boxes import points_in_boxes
from automos.readers.box_truth import SOLE
from automos.results.run_objects import ScanBoxes
from automos.results.tracks_file import VERDICTS
from automos.writers.edits import EditedBox, EditedScan

MOVED, TURNED = 0.01, 0.01
"""Metres and radians by which a box must differ to have been changed; tools round their numbers."""

_STATIC, _MOVING = VERDICTS.index("static"), VERDICTS.index("moving")


@dataclass(frozen=True)
class Change:
    """What was done to one box: before and after, None where there was or is none."""

    track: int
    before: EditedBox | None
    after: EditedBox | None

    @property
    def kinds(self) -> list[str]:
        """What to count it as: added, removed, moved, verdict; none of them if it is as it was."""
        if self.before is None or self.after is None:
            return ["added" if self.before is None else "removed"]
        turned = np.abs(np.angle(np.exp(1j * (self.after.yaw - self.before.yaw))))
        lengths = np.subtract((*self.after.center, *self.after.size), (*self.before.center, *self.before.size))
        is_moved = np.abs(lengths).max() > MOVED or turned > TURNED
        return ["moved"] * bool(is_moved) + ["verdict"] * (self.after.verdict != self.before.verdict)


def compare(found: ScanBoxes, edited: EditedScan | None) -> list[Change]:
    """Return what was done to each box of a scan, by track id, boxes that are as they were included.

    edited : None where the tool left the scan out: nothing was.
    """
    before = {
        box.id: EditedBox(tuple(box.center), tuple(box.size), box.yaw, VERDICTS.index(box.verdict)) for box in found
    }
    edited = before if edited is None else edited
    return [Change(track, before.get(track), edited.get(track)) for track in sorted({*before, *edited})]


def relabel(
    points: Points,
    is_valid: Mask,
    labels: npt.NDArray[np.uint8],
    instances: Ints,
    changes: list[Change],
) -> tuple[npt.NDArray[np.uint8], Ints]:
    """Return the labels and instances of a scan after `changes`.

    Parameters
    ----------
    points : (N, 3) metres, in the frame of the boxes.
    is_valid : (N,) bool; other points keep their labels.
    labels, instances : (N,) before; neither is changed.
    """
    label, instance = labels.copy(), instances.copy()
    real = [change for change in changes if change.kinds]
    for change in real:  # first what no longer moves, that others may have its points
        if change.before is not None and change.before.verdict == _MOVING:
            held = _inside(points, change.before) & (label == Label.MOVING) & (instance == 0)
            theirs = (instance == change.track) | held
            label[theirs], instance[theirs] = Label.STATIC, 0
    for change in real:
        after = change.after
        if after is None:
            continue
        bottom = after.center[2] - 0.5 * after.size[2]
        inside = _inside(points, after) & is_valid
        body = inside & ((points[:, 2] >= bottom + SOLE) | (labels == Label.MOVING))
        if after.verdict == _MOVING:
            free = body & (instance == 0)
            label[free], instance[free] = Label.MOVING, change.track
        elif after.verdict == _STATIC:
            label[inside & (instance == 0)] = Label.STATIC
        else:
            label[body & (instance == 0)] = Label.UNLABELED
    return label, instance


def _inside(points: Points, box: EditedBox) -> Mask:
    return points_in_boxes(points, box.to_boxes()) >= 0
