"""Boxes of a results folder against those that came with the recording."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from automos.core.geometry import Array, inverse, transform
from automos.core.scan import Sequence
from automos.core.upright_boxes import Boxes, TrueBoxes
from automos.evaluation.boxes import BoxErrors, compare_boxes, tracks_of_boxes, true_velocity
from automos.evaluation.overlaps import Ints, Overlaps
from automos.results.open_run import runs_in
from automos.results.run_files import RunFiles


def score_boxes(results: Path, recordings: Mapping[Sequence, Overlaps]) -> BoxErrors | None:
    """Return the errors of the boxes in a results folder; None without true boxes, or where labels are all it is.

    Parameters
    ----------
    results : as `evaluate_recordings` takes it.
    recordings : what the movers and tracks of each share.
    """
    runs = runs_in(results, recordings, lambda s: any(s.truth_boxes(i) is not None for i in range(len(s))))
    found = [box_errors(run, recordings[run.sequence]) for run in runs]
    return BoxErrors.concatenate([BoxErrors.empty(), *found]) if found else None


def box_errors(run: RunFiles, overlaps: Overlaps) -> BoxErrors:
    """Return the errors of a run's boxes; `overlaps` says which track is which mover's."""
    scan, mover, track = tracks_of_boxes(overlaps)
    true = {i: boxes for i in range(len(run)) if (boxes := run.sequence.truth_boxes(i)) is not None}
    velocity = _velocities(run, true) if true else {}
    parts = [BoxErrors.empty()]
    for index in np.unique(scan).tolist():
        if index in true:
            here = scan == index
            parts.append(_in_scan(run, index, true[index], velocity[index], mover[here], track[here]))
    return BoxErrors.concatenate(parts)


def _in_scan(run: RunFiles, index: int, true: TrueBoxes, velocity: Array, mover: Ints, track: Ints) -> BoxErrors:
    """Return the errors in scan `index`: a row for each of the movers (K,) that has a true box."""
    found = run.boxes_level(index)
    row_of, place_of = ({int(one): k for k, one in enumerate(ids)} for ids in (true.ids, found.ids))
    has_box = np.array([int(one) >> 16 in row_of for one in mover], np.bool_)
    mover, track = mover[has_box], track[has_box]
    errors = BoxErrors(mover, *np.full((5, len(mover)), np.nan))
    is_found = np.array([int(one) in place_of for one in track], np.bool_)
    if not is_found.any():
        return errors
    rows = [row_of[int(one) >> 16] for one in mover[is_found]]
    places = [place_of[int(one)] for one in track[is_found]]
    T = true.T_boxes_sensor @ inverse(run.T_level_sensor(index))
    mine = found.boxes[np.array(places)]
    heading = np.column_stack([np.cos(mine.yaw), np.sin(mine.yaw), np.zeros(len(places))]) @ T[:3, :3].T
    turned = Boxes(transform(T, mine.center), mine.size, np.arctan2(heading[:, 1], heading[:, 0]), mine.score)
    speed_off = np.linalg.norm((found.velocity[places] - velocity[rows])[:, :2], axis=1)
    off = (*compare_boxes(turned, true.boxes[np.array(rows)]), speed_off)
    for column, values in zip((errors.iou, errors.length, errors.width, errors.yaw, errors.velocity), off, strict=True):
        column[is_found] = values
    return errors


def _velocities(run: RunFiles, true: dict[int, TrueBoxes]) -> dict[int, Array]:
    """Return (K, 3) metres per second of the true boxes of each scan, level frame: seen from the run's own poses."""
    level = {index: run.T_level_sensor(index) @ inverse(one.T_boxes_sensor) for index, one in true.items()}
    center = np.concatenate([transform(level[k], one.boxes.center) for k, one in true.items()])
    ids = np.concatenate([one.ids for one in true.values()])
    counts = [len(one.ids) for one in true.values()]
    stamp, velocity = np.repeat(run.stamps[list(true)], counts), np.empty_like(center)
    for one in np.unique(ids):
        rows = ids == one
        velocity[rows] = true_velocity(stamp[rows], center[rows])
    return dict(zip(true, np.split(velocity, np.cumsum(counts)[:-1]), strict=True))
