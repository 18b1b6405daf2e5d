"""How fast the queue of the review gets through a recording's doubtful points, and how many points are wrong indeed.

    AUTOMOS_RECORDINGS=folder python benchmarks/review_queue.py --out FOLDER [--recordings kitti_0005 kitti_0027]
                                                                [--json FILE]

Recordings are those of the folder's sequences/; each is labelled into FOLDER where that was not done.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from rich.console import Console
from store import real_drive

from automos import load_settings
from automos.core.labels import Label, to_mos
from automos.labeling import label_recording
from automos.results.open_run import open_run
from automos.review.run_stages import RunStages
from automos.review.stake import most_telling, weigh

FIRST = 100
"""Decisions after which is counted what they cover."""


def queue_of(folder: Path) -> dict[str, Any]:
    """Return how many objects of a run hold its doubtful points; how many points are wrong, None without truth."""
    run = open_run(folder)
    doubtful = weigh(RunStages(folder, run.sequence)).doubtful
    order, n_core = most_telling(doubtful)
    wrong: int | None = 0
    for i in range(len(run)):
        truth = run.sequence.truth(i)
        if truth is None or wrong is None:
            wrong = None
            continue
        is_known = to_mos(truth) != Label.UNLABELED
        is_moving = run.labels(i, len(truth)) == Label.MOVING
        wrong += int((is_known & (is_moving != (to_mos(truth) == Label.MOVING))).sum())
    return {
        "objects": len(doubtful),
        "hold_95_percent": int(n_core),
        "doubtful_points": float(doubtful.sum()),
        "first_share": float(doubtful[order[:FIRST]].sum() / max(doubtful.sum(), 1e-9)),
        "wrong_points": wrong,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--recordings", nargs="+", default=["kitti_0005", "kitti_0027"])
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    found = {}
    for name in given.recordings:
        label_recording(real_drive(name), given.out / name, load_settings("default"))
        found[name] = queue_of(given.out / name)
        Console().print(name, found[name])
    if given.json:
        given.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
