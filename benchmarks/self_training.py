"""One round of self-training: do the labels get better when a network that learnt from such labels is heard?

    python benchmarks/self_training.py RECORDING... [--weights FILE] [--weight 0.5] [--out FOLDER] [--json FILE]

Every recording (with truth) is labelled, run through the network (the one that came along, or --weights, e.g. a
`networks/ours/best.pt` of `automos reproduce`), and labelled again with the network's probabilities as a further cue.
The network must not have seen the truth of these recordings. IoU / precision / recall of the moving class in percent.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from automos import load_settings, open_sequence
from automos.evaluation.moving import Counts
from automos.evaluation.report import evaluate_folder
from automos.labeling import label_recording
from automos.learning.segment import open_network, segment_recording
from automos.network.deployed import Deployed
from automos.scan import Sequence

ROUNDS = ("labels", "network", "labels with the network")


def measure(sequence: Sequence, network: Deployed, weight: float, out: Path, workers: int) -> dict[str, Counts]:
    """Return how labels, network and labels that heard the network do on one recording."""
    cue, results = out / "network" / sequence.name, out / "labels" / sequence.name
    plain = load_settings("default")
    label_recording(sequence, results, plain, workers=workers)
    before = evaluate_folder(results / "predictions", sequence).counts
    segment_recording(sequence, cue, network, plain, probabilities=True)
    heard = {"self_training.folder": str(cue / "probabilities"), "self_training.weight": weight}
    label_recording(sequence, results, load_settings("default", overrides=heard), workers=workers)
    after = evaluate_folder(results / "predictions", sequence).counts
    return dict(zip(ROUNDS, (before, evaluate_folder(cue / "predictions", sequence).counts, after), strict=True))


def percent(counts: Counts) -> list[float]:
    s = counts.scores
    return [round(100 * value, 1) for value in (s.iou, s.precision, s.recall)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--weights", type=Path, help="default: the network that came along")
    parser.add_argument("--weight", type=float, default=0.5, help="of the cue: self_training.weight")
    parser.add_argument("--out", type=Path, default=Path("self_training"))
    parser.add_argument("--workers", type=int, default=0)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    network = open_network(arguments.weights)
    console, table = Console(width=120), Table("recording", *ROUNDS, title="IoU / precision / recall, %")
    rows: dict[str, Any] = {}
    together = dict.fromkeys(ROUNDS, Counts())
    for path in arguments.recordings:
        sequence = open_sequence(path)
        counts = measure(sequence, network, arguments.weight, arguments.out, arguments.workers)
        together = {name: together[name] + counts[name] for name in ROUNDS}
        rows[sequence.name] = {name: percent(counts[name]) for name in ROUNDS}
        console.log(sequence.name, rows[sequence.name])
    rows["all points together"] = {name: percent(together[name]) for name in ROUNDS}
    for name, cells in rows.items():
        table.add_row(name, *(" / ".join(f"{value:.1f}" for value in cells[column]) for column in ROUNDS))
    console.print(table)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
