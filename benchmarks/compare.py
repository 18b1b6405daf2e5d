"""What got worse between two results of the same experiments."""

from collections.abc import Callable
from typing import Any

import numpy as np
from rows import has_movers, is_still, mean_iou, sensor_of

WORST = 1.0
"""Points of IoU that an experiment may lose."""
MEAN = 0.05
"""Points that the mean of a sensor may lose."""
MORE = 1.03
"""How much more false points or cost there may be."""
Row = dict[str, Any]


def verdicts(rows: list[Row], before: list[Row]) -> list[str]:
    """Return what got worse: a sensor's mean, an experiment by more than WORST, false points, cost."""
    was = {_key(row): row for row in before if row["head"]["status"] == "done"}
    both = [row for row in rows if row["head"]["status"] == "done" and _key(row) in was]
    if not both:
        return ["nothing to compare with"]
    said, old = [], [was[_key(row)] for row in both]
    for sensor in dict.fromkeys(map(sensor_of, both)):
        a, b = (mean_iou([row for row in some if sensor_of(row) == sensor]) for some in (both, old))
        if a < b - MEAN / 100.0:
            said.append(f"mean of {sensor or 'recordings'} fell from {100 * b:.1f} to {100 * a:.1f}")
    for new, one in zip(both, old, strict=True):
        if has_movers(new) and 100.0 * (new["iou"] - one["iou"]) < -WORST:
            said.append(f"{new['recording']} fell from {100 * one['iou']:.1f} to {100 * new['iou']:.1f}")
    for name, of in _GROWING.items():
        if of(both) > MORE * of(old):
            said.append(f"{name} grew from {of(old):,.4g} to {of(both):,.4g}")
    return [f"[red]worse: {line}" for line in said] or [f"[green]nothing is worse in {len(both)} experiments"]


def _key(row: Row) -> tuple[str, ...]:
    return tuple(str(row.get(name, "")) for name in ("recording", "method", "change"))


_GROWING: dict[str, Callable[[list[Row]], float]] = {
    "points called moving where nothing moves": lambda rows: sum(r["called_moving"] for r in rows if is_still(r)),
    "processor seconds a scan": lambda rows: sum(r["cpu_seconds"] for r in rows) / sum(r["scans"] for r in rows),
    "peak MB": lambda rows: float(np.max([row["peak_mb"] or 0.0 for row in rows])),
}
