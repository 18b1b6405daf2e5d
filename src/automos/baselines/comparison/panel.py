"""Fig. 4 of the paper: one scan, one picture per method, from the same view."""

from pathlib import Path

import numpy as np

from automos.baselines.comparison.runs import MethodRuns, is_moving
from automos.baselines.methods import title_of
from automos.core.label_files import to_mos
from automos.core.labels import Label
from automos.views.topdown import View, draw_views


def draw_panel(runs: MethodRuns, methods: list[str], scan: int, radius: float, path: Path) -> None:
    """Draw scan `scan` as each of `methods` labels it, to a PNG file.

    True dynamic points are green, false dynamic red, false static blue, true static grey, and so are points without
    truth. Where no point has any, what is called moving is green. `radius` (metres) is how far around the sensor is
    shown.
    """
    frame, truth = runs.frames[scan], runs.sequence.truth(scan)
    true = None if truth is None else to_mos(truth)[frame.kept]
    views = []
    for method in methods:
        labels = runs.labels(method, scan, frame.n_points)[frame.kept].astype(np.uint8)
        if true is not None:
            labels[true == Label.UNLABELED] = Label.UNLABELED
        views.append(View(title_of(method), frame.points_level, labels, true))
    draw_views(views, path, frame.origin_level[:2], radius, columns=4)


def choose_scan(runs: MethodRuns, methods: list[str]) -> int:
    """Return the scan with most truly moving points or, without ground truth, most points labelled moving.

    It is looked for in the middle half of the recording: methods that use only the past know nothing at the start.
    """
    n_scans = len(runs.sequence)
    middle = range(n_scans // 4, max(n_scans - n_scans // 4, n_scans // 4 + 1))
    counts = []
    for i in middle:
        truth = runs.sequence.truth(i)
        if truth is not None:
            counts.append(int(is_moving(to_mos(truth)).sum()))
        else:
            n = len(runs.sequence[i])
            counts.append(sum(int(is_moving(runs.labels(method, i, n)).sum()) for method in methods))
    return middle[int(np.argmax(counts))]
