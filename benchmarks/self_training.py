"""One round of self-training: do the labels get better when a network that learnt from such labels is a cue?

    python benchmarks/self_training.py RECORDING... [--weights FILE] [--weight 0.5] [--out FOLDER] [--json FILE]
    python benchmarks/self_training.py --networks FOLDER [--json FILE]       those of `networks.py table-2 --out FOLDER`

Every recording (with truth) is labelled, run through the network (the one that came along, or --weights, e.g. a
`networks/ours/best.pt` of `automos reproduce`), and labelled again with the network's probabilities as a further cue.
With --networks it is *LMNet + ours* of Table II, trained where it is not there yet, on recordings that it did not see.
The network must not have seen the truth of these recordings. IoU / precision / recall of the moving class in percent.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from networks import add_size, network_of_ours, opened, sized
from rich.console import Console
from rich.table import Table
from scores import ratios_of

from automos import load_settings, open_sequence
from automos.core.scan import Sequence
from automos.evaluation.moving import Counts
from automos.evaluation.report import evaluate_folder
from automos.labeling import label_recording
from automos.network.deployed import Deployed
from automos.network.segment import open_network, segment_recording

ROUNDS = ("labels", "network", "labels with the network")
UNSEEN = ("city_HDL-64E_32", "avenue_HDL-64E_31", "junction_HDL-64E_31", "campus_HDL-64E_31")
"""Recordings of domain K that are not trained on in *LMNet + ours*, by the names of their folders."""


def measure(sequence: Sequence, network: Deployed, weight: float, out: Path, workers: int) -> dict[str, Counts]:
    """Return how labels, network and labels with it do on one recording."""
    cue, results = out / "network" / sequence.name, out / "labels" / sequence.name
    plain = load_settings("default")
    label_recording(sequence, results, plain, workers=workers)
    before = evaluate_folder(results / "predictions", sequence).counts
    segment_recording(sequence, cue, network, plain, probabilities=True)
    with_cue = {"self_training.folder": str(cue / "probabilities"), "self_training.weight": weight}
    label_recording(sequence, results, load_settings("default", overrides=with_cue), workers=workers)
    after = evaluate_folder(results / "predictions", sequence).counts
    return dict(zip(ROUNDS, (before, evaluate_folder(cue / "predictions", sequence).counts, after), strict=True))


def percent(counts: Counts) -> list[float | None]:
    return [None if value is None else round(100 * value, 1) for value in ratios_of(counts).values()]


def compare(paths: list[Path], network: Deployed, weight: float, out: Path, workers: int) -> dict[str, Any]:
    """Return IoU, precision and recall of each round on each recording, and of all points together."""
    rows: dict[str, Any] = {}
    together = dict.fromkeys(ROUNDS, Counts())
    for path in paths:
        sequence = open_sequence(path)
        counts = measure(sequence, network, weight, out, workers)
        together = {name: together[name] + counts[name] for name in ROUNDS}
        rows[sequence.name] = {name: percent(counts[name]) for name in ROUNDS}
        Console(width=120).log(sequence.name, rows[sequence.name])
    rows["all points together"] = {name: percent(together[name]) for name in ROUNDS}
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="*")
    parser.add_argument("--weights", type=Path, help="default: the network that came along")
    parser.add_argument(
        "--networks", type=Path, help="folder of networks.py: its network, and recordings it did not see"
    )
    parser.add_argument("--weight", type=float, default=0.5, help="of the cue: self_training.weight")
    parser.add_argument("--out", type=Path, default=Path("self_training"))
    parser.add_argument("--workers", type=int, default=0)
    add_size(parser)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    shape = (arguments.weight, arguments.out, arguments.workers)
    if arguments.networks:
        with opened(arguments.networks, arguments) as work:
            data = work.simulated(sized("K", arguments))
            weights = network_of_ours(work, data)
        unseen = {path.name: path for path in data.extra}
        paths = [unseen[name] for name in UNSEEN if name in unseen]
        rows = compare(paths, open_network(weights), *shape)
    else:
        rows = compare(arguments.recordings, open_network(arguments.weights), *shape)
    table = Table("recording", *ROUNDS, title="IoU / precision / recall, %")
    for name, cells in rows.items():
        table.add_row(name, *(" / ".join(map(str, cells[column])) for column in ROUNDS))
    Console(width=120).print(table)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
