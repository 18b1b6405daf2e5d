"""The moving objects of a scan, for detectors: motion says nothing of what stands, be it a parked car or a bush."""

from __future__ import annotations

import numpy as np

from automos.core.scan import Points
from automos.results.run_files import RunFiles
from automos.results.scan_boxes import ScanBoxes
from automos.results.tracks_file import VERDICTS

MOVING = VERDICTS.index("moving")


def only_moving(found: ScanBoxes) -> ScanBoxes:
    """Return those of the objects of a scan that move."""
    rows = np.flatnonzero(found.verdict == MOVING)
    boxes, ids, velocity = found.boxes[rows], found.ids[rows], found.velocity[rows]
    return ScanBoxes(boxes, ids, found.verdict[rows], velocity, found.observed[rows])


def upright_points(run: RunFiles, index: int) -> Points:
    """Return the (M, 4) points of use of scan `index`, in its upright frame, with their intensity."""
    scan = run.scan(index)
    intensity = np.zeros(len(scan), np.float32) if scan.intensity is None else np.nan_to_num(scan.intensity)
    return np.column_stack([run.points_upright(scan, index), intensity])[scan.is_valid].astype(np.float32)


def split_of(frames: list[str]) -> dict[str, list[str]]:
    """Return names of `frames` for training and, the last fifth in time, for validation."""
    edge = len(frames) - len(frames) // 5
    return {"train": frames[:edge], "val": frames[edge:]}
