"""The view of one scan: the surroundings of the sensor from above, and its moving objects."""

from typing import Any

import numpy as np

from automos.core.labels import Label
from automos.core.scan import GROUND
from automos.review.changes import Changes, changed_labels, number_of, parts_in, replaced
from automos.review.run_stages import RunStages
from automos.review.scenes import AROUND, AROUND_GROUND, OTHER_MOVING, OWN, pack_moments, thin

MAX_STANDING, MAX_GROUND = 60_000, 15_000
"""Points shown of what stands and of the ground; of what moves, all."""
REACH = 120.0
"""Metres around the sensor that are shown."""
UNSURE = OWN
"""Kind of points without a label, drawn like an object that is decided on."""


def place(stages: RunStages, index: int, changes: Changes) -> dict[str, Any]:
    """Return scan `index` as the page draws it: as a scene of one moment, the sensor at its origin."""
    frame, labels = stages.frame(index), changed_labels(stages, index, changes)["label"]
    kind = stages.stage("candidates").load(stages.names[index], "kind")["kind"]
    points = frame.points_level - frame.origin_level
    label = labels[frame.kept]
    kinds = np.select(
        [label == Label.MOVING, kind == GROUND, label == Label.UNLABELED],
        [OTHER_MOVING, AROUND_GROUND, UNSURE],
        AROUND,
    ).astype(np.uint8)
    near = (np.abs(points) < REACH).all(axis=1)
    rows = [
        thin(np.flatnonzero(near & (kinds == one)), most)
        for one, most in ((AROUND_GROUND, MAX_GROUND), (AROUND, MAX_STANDING), (UNSURE, 10**6), (OTHER_MOVING, 10**6))
    ]
    shown = np.concatenate(rows)
    return {
        "scan": stages.names[index],
        "index": index,
        "time": round(float(stages.trajectory.stamps[index] - stages.trajectory.stamps[0]), 2),
        "origin": frame.origin_level.round(3).tolist(),
        "boxes": _boxes(stages, index, changes),
        **pack_moments([points[shown]], [kinds[shown]]),
    }


def _boxes(stages: RunStages, index: int, changes: Changes) -> list[tuple[int | float, ...]]:
    """Return the objects of scan `index`, found and made by hand: id, x, y, length, width, yaw; level frame."""
    tracks, gone = stages.tracks, replaced(stages, index, changes)
    rows = np.flatnonzero((tracks.scan == index) & ~np.isin(tracks.track, gone))
    columns = np.column_stack([tracks.center[rows, :2], tracks.size[rows, :2], tracks.yaw[rows]]).round(3)
    found = [(int(tracks.track[row]) + 1, *box) for row, box in zip(rows, columns.tolist(), strict=True)]
    T = stages.trajectory.T_level_sensor[index]
    made = [
        (number_of(stages, one) + 1, *one.parts[stages.names[index]].box_level(T)[[0, 1, 3, 4, 6]].round(3).tolist())
        for one, _ in parts_in(stages, index, changes)
    ]
    return found + made
