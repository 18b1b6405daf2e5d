"""Whether boxes are as an annotator would draw them: overlap from above, heading, size and velocity.

A true box of a mover is compared with the box, in the same scan, of the moving track that holds most of its points
there; scans in which it has fewer than `FEWEST` points are left out, as nobody could draw a box in them.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from automos.core.column_data import ColumnData
from automos.core.geometry import Array
from automos.core.upright_boxes import Boxes, iou_3d
from automos.evaluation.objects import SIZES
from automos.evaluation.overlaps import NO_TRACK, STANDS, Ints, Overlaps

FEWEST = 30
"""Points in a scan from which a mover's box counts."""
GOOD = (0.4, 0.7)
"""Intersections over union from above that are counted: the right place, and the right extent and heading."""
LAG = 0.4
"""Seconds before and after, about, between which a true box's velocity is measured: its jitter is that of a hand."""


@dataclass(frozen=True, eq=False)
class BoxErrors(ColumnData):
    """True boxes of movers, a row each, against their tracks' boxes; NaN where there is no such box.

    Attributes
    ----------
    mover : (R,) int64
        Class and instance id as the truth packs them.
    iou : (R,) float64
        Intersection over union from above.
    length, width : (R,) float64
        Metres, absolute.
    yaw : (R,) float64
        Degrees, in [0, 90]: modulo half a turn.
    velocity : (R,) float64
        Metres per second, over the ground; NaN, too, where the truth has no boxes around it.
    """

    mover: Ints
    iou: Array
    length: Array
    width: Array
    yaw: Array
    velocity: Array

    @classmethod
    def empty(cls) -> Self:
        """Return no rows."""
        return cls(np.zeros(0, np.int64), *np.zeros((5, 0)))

    def to_dict(self) -> dict[str, Any]:
        """Return shares of the true boxes, in [0, 1], and of each error median, worst tenth and mean over movers."""
        shares: dict[str, float | None] = {"with_track": None}
        if len(self):
            shares = {"with_track": float(np.mean(np.isfinite(self.iou)))}
            shares |= {f"iou_{good:g}": float(np.mean(self.iou >= good)) for good in GOOD}
        spread = {name: _spread(self.mover, getattr(self, name), worst) for name, (worst, *_) in _MEASURES.items()}
        return {"boxes": len(self), **shares, **spread}


_MEASURES = {
    "iou": (10, "box IoU from above", 100, "%"),
    "length": (90, "box length", 1, "m"),
    "width": (90, "box width", 1, "m"),
    "yaw": (90, "box yaw", 1, "degrees"),
    "velocity": (90, "box velocity", 1, "m/s"),
}
"""Of each column of `BoxErrors`: its worst percentile, what a table calls it, the factor to its unit, and the unit."""


def _spread(mover: Ints, values: Array, worst: int) -> dict[str, float | None]:
    known = np.isfinite(values)
    if not known.any():
        return dict.fromkeys(("median", "worst_tenth", "over_movers"))
    mover, values = mover[known], values[known]
    ids, row = np.unique(mover, return_inverse=True)
    means = np.bincount(row, values) / np.bincount(row, minlength=len(ids))
    tenth = float(np.percentile(values, worst))
    return {"median": float(np.median(values)), "worst_tenth": tenth, "over_movers": float(means.mean())}


def tracks_of_boxes(overlaps: Overlaps) -> tuple[Ints, Ints, Ints]:
    """Return scan, mover and track, a row for each scan in which a mover has `FEWEST` points or more.

    The track is the one with most of its points there, `NO_TRACK` without any.
    """
    on = overlaps[overlaps.mover > STANDS]
    scan, mover, n_points = on.total(("scan", "mover"))
    most_first = on[np.argsort(-np.where(on.track > NO_TRACK, on.n_points, 0), kind="stable")]
    _, first = np.unique(np.stack([most_first.scan, most_first.mover]), axis=1, return_index=True)
    kept = n_points >= FEWEST
    return scan[kept], mover[kept], np.maximum(most_first.track[first], NO_TRACK)[kept]


def compare_boxes(found: Boxes, true: Boxes) -> tuple[Array, Array, Array, Array]:
    """Return (M,) IoU from above, errors of length and width (metres) and yaw (degrees) of M pairs in one frame.

    Of a true box that is wider than long, the longer side is its length: some datasets measure along y.
    """
    is_across = true.size[:, 1] > true.size[:, 0]
    size = np.where(is_across[:, None], true.size[:, [1, 0, 2]], true.size)
    yaw = true.yaw + np.where(is_across, 0.5 * np.pi, 0.0)
    one, other = _flat(found.center, found.size, found.yaw), _flat(true.center, size, yaw)
    iou = np.array([iou_3d(one[k : k + 1], other[k : k + 1])[0, 0] for k in range(len(yaw))])
    turn = np.degrees(np.abs((found.yaw - yaw + 0.5 * np.pi) % np.pi - 0.5 * np.pi))
    length, width = np.abs(found.size - size)[:, :2].T
    return iou, length, width, turn


def _flat(center: Array, size: Array, yaw: Array) -> Boxes:
    """Return boxes one metre high that stand at height 0: their overlap in space is that from above."""
    return Boxes(center * [1.0, 1.0, 0.0], size * [1.0, 1.0, 0.0] + [0.0, 0.0, 1.0], yaw, np.ones(len(yaw)))


def true_velocity(stamps: Array, centers: Array) -> Array:
    """Return (M, 3) metres per second of a box at times `stamps` (M,) and places `centers` (M, 3) that stand still.

    Each is the displacement from some `LAG` before to some `LAG` after; NaN where that is more than four of them apart.
    """
    velocity = np.full((len(stamps), 3), np.nan)
    for k, time in enumerate(stamps.tolist()):
        before, after = (np.abs(stamps - time + lag) for lag in (LAG, -LAG))
        before[k:], after[: k + 1] = np.inf, np.inf
        a, b = int(before.argmin()), int(after.argmin())
        if a < k < b and stamps[b] - stamps[a] < 4.0 * LAG + 0.1:
            velocity[k] = (centers[b] - centers[a]) / (stamps[b] - stamps[a])
    return velocity


def objects_table(objects: dict[str, Any], boxes: BoxErrors | None = None) -> Table:
    """Return `scores_of_objects`, and the errors of boxes where the truth has any, as a table of two columns."""
    title = "One mover, one object; of boxes: median / worst tenth / mean over movers"
    table = Table("", title=title, box=SIMPLE_HEAD, padding=0, show_edge=False, show_header=False)
    table.add_column(no_wrap=True)
    for name, value in [*_of_objects(objects), *([] if boxes is None else _of_boxes(boxes.to_dict()))]:
        table.add_row(name, value)
    return table


def _of_objects(scores: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for least in SIZES:
        counts = scores["movers"][f"{least}+ points"]
        rest = ", ".join(f"{n} {name}" for name, n in counts.items() if name != "whole")
        yield f"movers of {least} points and more ", f"{counts['whole']} of {sum(counts.values())} whole; {rest}"
    yield "S_assoc (LSTQ)", _number(scores["association"])
    yield "moving tracks a mover found", _number(scores["tracks_per_mover"])
    yield "moving tracks elsewhere", f"{scores['tracks_elsewhere']}"
    on, off = (_percent(scores[name]) for name in ("unowned_on_movers", "unowned_elsewhere"))
    yield "moving points on no track", f"{on} on movers, {off} elsewhere"
    yield "HOTA, DetA, AssA by points", ", ".join(_percent(scores[name]) for name in ("hota", "det_a", "ass_a"))
    yield "IDF1 by points", _percent(scores["idf1"])


def _of_boxes(scores: dict[str, Any]) -> Iterator[tuple[str, str]]:
    if not scores["boxes"]:
        return
    yield "true boxes with a track", f"{_percent(scores['with_track'])} of {scores['boxes']:,}"
    good = ", ".join(f"{_percent(scores[f'iou_{one:g}'])} from {one:g} on" for one in GOOD)
    yield "... by IoU from above", good
    for name, (_, what, scale, unit) in _MEASURES.items():
        values = ("-" if value is None else f"{scale * value:.2f}" for value in scores[name].values())
        yield what, f"{' / '.join(values)} {unit}"


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.2f}"


def _percent(value: float | None) -> str:
    return "-" if value is None or math.isnan(value) else f"{100 * value:.1f} %"
