"""Table I of the paper on any recording: every method is scored, timed and compared with the others."""

import json
import logging
import math
import statistics
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Column, Table
from rich.text import Text

from automos.baselines.comparison.agreement import Agreement, measure_agreement
from automos.baselines.comparison.cost import Cost
from automos.baselines.comparison.panel import choose_scan, draw_panel
from automos.baselines.comparison.runs import MethodRuns, is_moving
from automos.baselines.methods import NEEDS_FUTURE, TITLES, choose_methods, title_of
from automos.core.atomic import write_text
from automos.core.errors import InputError, MissingExtraError
from automos.core.json_members import without_nan
from automos.core.scan import Mask
from automos.evaluation.moving import Counts, Scores, count, percent, ranges_of

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Comparison:
    """The result of a comparison.

    Attributes
    ----------
    recording, n_scans : str and int
        Name and number of scans.
    poses : str
        Source of the poses.
    scores : dict of str to Scores
        Of all that was compared, by name; empty if the recording has no truth.
    costs : dict of str to Cost, optional
        Of each, None where another program made the labels.
    missing : dict of str to str
        Methods that did not, and why.
    agreement : Agreement
        Between those that ran.
    """

    recording: str
    n_scans: int
    poses: str
    scores: dict[str, Scores]
    costs: dict[str, Cost | None]
    missing: dict[str, str]
    agreement: Agreement

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers; ratios in [0, 1], None if there is none."""
        methods = {}
        for name, cost in self.costs.items():
            scores = self.scores.get(name)
            methods[name] = {
                "title": title_of(name),
                **(scores.ratios | asdict(scores) if scores else {}),
                "needs_future": NEEDS_FUTURE.get(name),
                **({} if cost is None else _plain_cost(cost)),
            }
        plain = {key: getattr(self, key) for key in ("recording", "n_scans", "poses")} | {"methods": methods}
        return without_nan({**plain, "missing": self.missing, "agreement": self.agreement.to_dict()})

    def tables(self) -> list[Table]:
        """Return Table I, and how far the methods agree."""
        notes = [f"{TITLES[name]}: {reason}" for name, reason in self.missing.items()]
        if not all(cost is None or cost.was_alone for cost in self.costs.values()):
            notes.append("< : other programs kept the machine busy meanwhile; seconds are upper bounds")
        headings = ("IoU %", "precision", "recall", "s/scan", "±", "MB", "future")
        table = Table(
            Column("method", no_wrap=True),
            *(Column(heading, justify="right") for heading in headings),
            title=f"{self.recording}: {self.n_scans} scans, {self.poses}",
            caption=Text("\n".join(notes)) if notes else None,
            box=SIMPLE_HEAD,
            pad_edge=False,
        )
        for name, cost in self.costs.items():
            scores = self.scores.get(name)
            ratios = map(percent, scores.ratios.values()) if scores else [""] * 3
            future = {True: "needed", False: "no", None: ""}[NEEDS_FUTURE.get(name)]
            table.add_row(title_of(name), *ratios, *_cost_cells(cost), future)
        names = [title_of(name) for name in self.agreement.methods]
        columns = (Column(f"{k + 1}", justify="right") for k in range(len(names)))
        matrix = Table(Column(no_wrap=True), *columns, title="agreement: IoU % of what moves", box=SIMPLE_HEAD)
        for k, (name, row) in enumerate(zip(names, self.agreement.iou, strict=True)):
            cells = ("" if i == k or math.isnan(iou) else f"{100 * iou:.0f}" for i, iou in enumerate(row))
            matrix.add_row(f"{k + 1} {name}", *cells)
        return [table, matrix]


def compare(runs: MethodRuns, methods: Iterable[str] | None = None) -> Comparison:
    """Compare `methods` (all by default) on a recording; the result names those whose library is missing.

    Raises
    ------
    InputError
        A method that there is not, or none that could be run.
    """
    costs: dict[str, Cost | None] = {}
    missing: dict[str, str] = {}
    for method in [*choose_methods(methods), *runs.predictions]:
        try:
            costs[method] = runs.cost(method)
        except MissingExtraError as error:
            missing[method] = str(error)
            _log.warning("%s is left out: %s", TITLES[method], error)
    if not costs:
        raise InputError("no method could be run: " + "; ".join(missing.values()))
    counts = {method: Counts() for method in costs}
    agreement = measure_agreement(list(costs), _masks(runs, counts))
    has_truth = any(part.n_scans for part in counts.values())
    scores = {method: part.scores for method, part in counts.items()} if has_truth else {}
    return Comparison(
        runs.sequence.name,
        len(runs.sequence),
        _describe_poses(runs),
        scores,
        costs,
        missing,
        agreement,
    )


def write_comparison(
    runs: MethodRuns, comparison: Comparison, radius: float = 40.0, scan: int | None = None
) -> tuple[Path, Path]:
    """Write `compare.json` and the panel `compare.png` into the runs' folder; return both paths.

    `radius` is how far around the sensor is shown, metres; `scan` which one, by default the one with most movers.
    """
    methods = list(comparison.costs)
    require_scan(runs, scan)
    scan = choose_scan(runs, methods) if scan is None else scan
    report, picture = runs.folder / "compare.json", runs.folder / "compare.png"
    draw_panel(runs, methods, scan, radius, picture)
    write_text(report, json.dumps({**comparison.to_dict(), "picture_of_scan": scan}, indent=2, allow_nan=False) + "\n")
    return report, picture


def require_scan(runs: MethodRuns, scan: int | None) -> None:
    """Raise InputError if the recording has no such scan to draw."""
    if scan is not None and not 0 <= scan < len(runs.sequence):
        raise InputError(f"there is no scan {scan}: {runs.sequence.name} has 0 to {len(runs.sequence) - 1}")


def _masks(runs: MethodRuns, counts: dict[str, Counts]) -> Iterator[list[Mask]]:
    """Yield the points that each method labels moving in each scan; also add scores to `counts`."""
    for i in range(len(runs.sequence)):
        scan, truth = runs.sequence[i], runs.sequence.truth(i)
        said = {method: runs.labels(method, i, len(scan)) for method in counts}
        if truth is not None:
            ranges = ranges_of(scan.points)
            for method, labels in said.items():
                counts[method] += count(labels, truth, ranges)
        yield [is_moving(labels) for labels in said.values()]


def _describe_poses(runs: MethodRuns) -> str:
    thickness = runs.trajectory.diagnostics.get("wall_thickness_m")
    source = {
        "given": "poses given",
        "shared": "one odometry's poses for all",
        "own": "poses by each preset's own odometry, the default's for the others",
    }[runs.poses]
    return source if thickness is None else f"{source} (walls {100 * thickness:.1f} cm thick)"


def _cost_cells(cost: Cost | None) -> tuple[str, str, str]:
    """Return seconds, their spread and megabytes, as the table shows them."""
    if cost is None:
        return "", "", ""
    spread = f"{cost.spread:.2f}" if len(cost.seconds) > 1 else ""
    memory = "" if math.isnan(cost.peak_memory) else f"{cost.peak_memory / 1e6:.0f}"
    return f"{'' if cost.was_alone else '< '}{cost.seconds_per_scan:.2f}", spread, memory


def _plain_cost(cost: Cost) -> dict[str, Any]:
    return {
        "seconds_per_scan": cost.seconds_per_scan,
        "seconds_spread": cost.spread,
        "runs": len(cost.seconds),
        "cpu_seconds_per_scan": statistics.median(cost.busy),
        "peak_mb": cost.peak_memory / 1e6,
        "cores_of_others": max(cost.others),
    }
