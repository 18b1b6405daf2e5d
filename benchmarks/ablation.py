"""What each choice of the preset `default` is worth: labels with one of them taken back, on the same recordings.

    python benchmarks/ablation.py RECORDING [RECORDING ...] [--choices NAME ...] [--json FILE]

The poses are estimated once a recording; only `poses not refined` has others. The table gives the IoU of the moving
class, and in brackets the false points, with everything and with each choice taken back.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from automos import Workspace, label, load_settings, open_sequence
from automos.evaluation.moving import Counts, Scores, count
from automos.progress import StageProgress
from automos.settings import PRESETS

NEVER = 1e9
CHOICES: dict[str, dict[str, Any]] = {
    "everything": {},
    "poses not refined": {"odometry.refine": False},
    "evidence of 1 s only": {"candidates.free_space.spans": [0.2, 0.4, 0.6, 0.8, 1.0],
                             "candidates.free_space.first_spans": [0.6, 1.0]},
    "a lone point seen through counts in full": {"candidates.free_space.lone_weight": 1.0},
    "a see-through beside a ray counts in full": {"candidates.free_space.near_miss": NEVER},
    "ERASOR instead of free space": {"candidates.method": "erasor"},
    "HDBSCAN instead of components": {"instances.method": "hdbscan"},
    "objects of 20 m at most": {"instances.components.max_side": 20.0},
    "curtains of points join what they touch": {"instances.components.segments.thin_share": 0.0},
    "torn segments stay whole": {"instances.components.torn_share": 0.5},
    "long things are seen whole": {"tracking.filter.measurement_share": 0.0},
    "where it went does not count": {"tracking.judge.displacement": 0.0},
    "unsteady things move, too": {"tracking.judge.unsteady": 0.0},
    "hovering things move, too": {"tracking.judge.hover": 0.0},
    "pieces are as good as wholes": {"tracking.judge.pieces": 0.0},
    "more likely than not is moving": {"tracking.judge.min_probability": 0.5},
    "ground beside objects stays ground": {"tracking.completion.margin": 0.0},
    "the paper's tracker and verdict": {f"tracking.{k}": v for k, v in PRESETS["paper"]["tracking"].items()},
}  # fmt: skip


def scores(path: Path, overrides: dict[str, Any], cache: Path, progress: StageProgress) -> Scores:
    sequence = open_sequence(path)
    workspace = Workspace(cache / path.name) if "odometry.refine" not in overrides else Workspace()
    result = label(sequence, load_settings("default", None, overrides), workspace=workspace, progress=progress)
    return sum((count(result.labels(i), sequence.truth(i)) for i in range(len(sequence))), Counts()).scores


def main() -> None:
    import tempfile

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--choices", nargs="+", default=list(CHOICES), choices=list(CHOICES))
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    table, rows = Table("", *(path.name for path in arguments.recordings), title="IoU % (false points)"), []
    with tempfile.TemporaryDirectory() as cache:
        for choice in arguments.choices:
            cells = []
            for path in arguments.recordings:
                with StageProgress(Console(stderr=True), f"{path.name}, {choice}") as progress:
                    found = scores(path, CHOICES[choice], Path(cache), progress)
                cells.append(f"{100 * found.iou:.1f} ({found.false_dynamic:,})")
                rows.append({"choice": choice, "recording": path.name, "iou": found.iou, "false": found.false_dynamic})
            table.add_row(choice, *cells)
            Console().print(f"{choice}: {', '.join(cells)}")
    Console().print(table)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows))


if __name__ == "__main__":
    main()
