"""Boxes of a results folder against those that came with the recording."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from automos.core.geometry import inverse, transform
from automos.core.scan import Sequence
from automos.core.upright_boxes import Boxes, TrueBoxes
from automos.evaluation.boxes import BoxErrors, compare_boxes, tracks_of_boxes, true_velocity
from automos.evaluation.overlaps import Ints, Overlaps
from automos.results.run_files import RunFiles


def score_boxes(results: Path, recordings: Mapping[Sequence, Overlaps]) -> BoxErrors | None:
    """Return the errors of the boxes in a results folder; None without true boxes, or where labels are all it is.

    Parameters
    ----------
    results : as `evaluate_recordings` takes it.
    recordings : what the movers and tracks of each share.
    """
    found = []
    for sequence, overlaps in recordings.items():
        folder = results if len(recordings) == 1 else results / sequence.name
        is_run = (folder / "tracks.json").exists() and (folder / "poses.txt").exists()
        if is_run and any(sequence.truth_boxes(i) is not None for i in range(len(sequence))):
            found.append(box_errors(RunFiles(folder, sequence), overlaps))
    return BoxErrors.concatenate([BoxErrors.empty(), *found]) if found else None


def box_errors(run: RunFiles, overlaps: Overlaps) -> BoxErrors:
    """Return the errors of a run's boxes; `overlaps` says which track is which mover's."""
    scan, mover, track = tracks_of_boxes(overlaps)
    true = {i: boxes for i in range(len(run)) if (boxes := run.sequence.truth_boxes(i)) is not None}
    velocity = _velocities(run, true)
    parts = [BoxErrors.empty()]
    for index in np.unique(scan).tolist():
        if index in true:
            here = scan == index
            parts.append(_in_scan(run, index, true[index], mover[here], track[here], velocity))
    return BoxErrors.concatenate(parts)


def _in_scan(
    run: RunFiles, index: int, true: TrueBoxes, mover: Ints, track: Ints, velocity: dict[tuple[int, int], np.ndarray]
) -> BoxErrors:
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
    for name, values in zip(
        ("iou", "length", "width", "yaw"), compare_boxes(turned, true.boxes[np.array(rows)]), strict=True
    ):
        getattr(errors, name)[is_found] = values
    true_speed = np.array([velocity.get((index, int(one) >> 16), np.full(3, np.nan)) for one in mover[is_found]])
    errors.velocity[is_found] = np.linalg.norm((found.velocity[places] - true_speed)[:, :2], axis=1)
    return errors


def _velocities(run: RunFiles, true: dict[int, TrueBoxes]) -> dict[tuple[int, int], np.ndarray]:
    """Return (3,) metres per second of each true box, level frame, by scan and id: seen from the run's own poses."""
    scans, ids, centers = [], [], [np.zeros((0, 3))]
    for index, one in true.items():
        T = run.T_level_sensor(index) @ inverse(one.T_boxes_sensor)
        scans += [index] * len(one.ids)
        ids += one.ids.tolist()
        centers.append(transform(T, one.boxes.center))
    scan, of, center = np.array(scans, np.int64), np.array(ids, np.int64), np.concatenate(centers)
    velocity: dict[tuple[int, int], np.ndarray] = {}
    for one in np.unique(of).tolist():
        rows = np.flatnonzero(of == one)
        found = true_velocity(run.stamps[scan[rows]], center[rows])
        velocity |= {(int(scan[row]), one): v for row, v in zip(rows.tolist(), found, strict=True)}
    return velocity
