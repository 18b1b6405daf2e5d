"""The scores of objects and of their boxes as one short table."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from automos.evaluation.boxes import GOOD, BoxErrors
from automos.evaluation.objects import SIZES

if TYPE_CHECKING:
    from rich.table import Table


def objects_table(objects: dict[str, Any], boxes: BoxErrors | None = None) -> Table:
    """Return `scores_of_objects`, and the errors of boxes where the truth has any, as a table of two columns."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

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
    for name, what, unit in (
        ("iou", "box IoU from above", "%"),
        ("length", "box length", "m"),
        ("width", "box width", "m"),
        ("yaw", "box yaw", "degrees"),
        ("velocity", "box velocity", "m/s"),
    ):
        values, scale = (
            (scores[name][key] for key in ("median", "worst_tenth", "over_movers")),
            100 * (name == "iou") or 1,
        )
        yield what, f"{' / '.join('-' if value is None else f'{scale * value:.2f}' for value in values)} {unit}"


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.2f}"


def _percent(value: float | None) -> str:
    return "-" if value is None or math.isnan(value) else f"{100 * value:.1f} %"
