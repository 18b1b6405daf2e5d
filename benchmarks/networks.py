"""Tables II and III of the paper with LMNet, as `automos reproduce` makes them, on simulated worlds.

    python benchmarks/networks.py table-2 --out FOLDER [--worlds 10] [--scans 60] [--epochs 20] [--samples 200]
                                          [--full] [--json FILE]
    python benchmarks/networks.py table-3 --out FOLDER [--picture FILE] ...             with the curve of fine-tuning

Recordings, labels, networks and scores are kept in FOLDER: a run that was interrupted goes on, and what both tables
(and `self_training.py`) need is made once. One process works in a folder at a time, others wait for it. A folder
is for one size and one state of the code; the smaller sizes only show that everything runs. --full trains the
paper's network on its image, 64 x 2048, for as many steps: on a GPU.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

from rich.console import Console
from scores import ratios_of

from automos import load_settings
from automos.core.atomic import held
from automos.core.progress import StageProgress
from automos.network.domains import DOMAINS, Domain, Part
from automos.network.experiments import SMALL, TUNING, Data, Experiment, table_three, table_two
from automos.network.tables import write_curves, write_table
from automos.network.train import TrainingData, device_note

_SCHEDULE = ("network.training.batch", "network.training.validation_scans")
"""What the full network shares with the narrow one, beside the number of steps."""


def add_size(parser: argparse.ArgumentParser) -> None:
    """Add how large the experiment is; the defaults are those of `automos reproduce`."""
    parser.add_argument("--worlds", type=int, default=10, help="recordings of each part of a domain, at most")
    parser.add_argument("--scans", type=int, default=60, help="of each recording")
    parser.add_argument("--epochs", type=int, default=SMALL["network.training.epochs"])
    parser.add_argument("--samples", type=int, default=SMALL["network.training.samples"], help="scans an epoch")
    parser.add_argument("--full", action="store_true", help="the full network and image")


@contextmanager
def opened(folder: Path, size: argparse.Namespace) -> Iterator[Experiment]:
    """Give the experiment in `folder`, for this process alone."""
    console = Console(stderr=True)
    base = {name: SMALL[name] for name in _SCHEDULE} if size.full else SMALL
    chosen = {**base, "network.training.epochs": size.epochs, "network.training.samples": size.samples}
    settings = [load_settings("default", overrides=each) for each in (chosen, {**chosen, **TUNING})]
    with held(folder, waits=True), StageProgress(console, folder.name) as progress:
        console.print(device_note("auto"))
        yield Experiment(folder, *settings, progress=progress)


def sized(name: str, size: argparse.Namespace) -> Domain:
    """Return a simulated domain with at most so many recordings of each part."""

    def part(whole: Part) -> Part:
        return replace(whole, worlds=whole.worlds[: size.worlds], scans=size.scans)

    domain = DOMAINS[name]
    return Domain(name, *map(part, (domain.train, domain.extra, domain.validation, domain.test)))


def network_of_ours(work: Experiment, data: Data) -> Path:
    """Return the network that learnt from automatic labels of the recordings to train on."""
    return work.network("ours", TrainingData(work.automatic(data.train), work.given(data.validation)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("experiment", choices=["table-2", "table-3"])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--picture", type=Path, help="where to draw the curve of fine-tuning")
    add_size(parser)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    result = {}
    with opened(arguments.out, arguments) as work:
        home = work.simulated(sized("K", arguments))
        if arguments.experiment == "table-2":
            rows = table_two(work, home, {})
        else:
            rows, curves = table_three(work, home, work.simulated(sized("A", arguments)))
            picture = arguments.out / "figure3.png"
            write_curves(curves, picture)
            result["curves"] = asdict(curves)
            if arguments.picture:
                arguments.picture.write_bytes(picture.read_bytes())
    stored = [{"method": row.method} | ratios_of(row.counts) for row in rows]
    print(write_table(rows, arguments.out / f"{arguments.experiment}.json"))
    if arguments.json:
        arguments.json.write_text(json.dumps({"rows": stored, **result}, indent=1))


if __name__ == "__main__":
    main()
