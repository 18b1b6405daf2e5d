"""Tables II and III of the paper with LMNet, as `automos reproduce` makes them; and their claim on real drives.

Recordings, labels, networks and scores are kept in the store by the contents of the package: a run that was interrupted
goes on, and what the tables share is made once. One process works in a folder at a time, others wait for it.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from experiment import code_digest
from labels import scores_of
from recordings import opened

from automos import load_settings
from automos.core.atomic import held
from automos.network.domains import DOMAINS, Domain, Part
from automos.network.experiments import SMALL, TUNING, Experiment, table_three, table_two
from automos.network.tables import write_curves
from automos.network.train import TrainingData

_SCHEDULE = ("network.training.batch", "network.training.validation_scans")
"""What the full network shares with the narrow one, beside the number of steps."""


@dataclass(frozen=True)
class Size:
    """How large the tables are; smaller ones only show that everything runs.

    Attributes
    ----------
    worlds, scans : recordings of each part of a domain, at most, and scans of each.
    epochs, samples : of the training, and scans an epoch.
    is_full : whether the paper's network on its image, 64 x 2048, is trained: on a GPU.
    packed, sector, seed : settings of the training.
    """

    worlds: int = 10
    scans: int = 60
    epochs: int = SMALL["network.training.epochs"]
    samples: int = SMALL["network.training.samples"]
    is_full: bool = False
    packed: int = 0
    sector: int = 0
    seed: int = 0


@contextmanager
def _opened(store: Path, size: Size) -> Iterator[Experiment]:
    """Give the experiments of this size and this state of the code, for this process alone."""
    about = {name: value for name, value in asdict(size).items() if name != "seed"}
    folder = store / "networks" / code_digest(()) / "-".join(map(str, about.values()))
    base = {name: SMALL[name] for name in _SCHEDULE} if size.is_full else SMALL
    asked = ("epochs", "samples", "packed", "sector", "seed")
    chosen = {**base, **{f"network.training.{name}": getattr(size, name) for name in asked}}
    settings = [load_settings("default", overrides=each) for each in (chosen, {**chosen, **TUNING})]
    with held(folder, waits=True):
        yield Experiment(folder, *settings)


def _sized(name: str, size: Size) -> Domain:
    """Return a simulated domain with at most so many recordings of each part."""

    def part(whole: Part) -> Part:
        return replace(whole, worlds=whole.worlds[: size.worlds], scans=size.scans)

    domain = DOMAINS[name]
    return Domain(name, *map(part, (domain.train, domain.extra, domain.validation, domain.test)))


def table(store: Path, which: int, **size: Any) -> dict[str, Any]:
    """Return the scores of Table II or III, and the curves of fine-tuning; its picture is drawn into the store."""
    asked, curves = Size(**size), None
    with _opened(store, asked) as work:
        home = work.simulated(_sized("K", asked))
        if which == 2:
            rows = table_two(work, home, {})
        else:
            rows, curves = table_three(work, home, work.simulated(_sized("A", asked)))
            write_curves(curves, store / "finetuning.png")
    scored = [{"method": row.method} | scores_of(row.counts) for row in rows]
    return {"scores": scored} | ({} if curves is None else {"curves": asdict(curves)})


def by_labels(store: Path, recording: str, labels: str, tests: tuple[str, ...], **size: Any) -> dict[str, Any]:
    """Return the scores, by recording of `tests`, of a network that a real drive and the worlds of domain K taught.

    `labels` are "true" or "automatic", of the same scans; worlds with their truth choose the epoch.
    """
    asked, scores = Size(**size), {}
    with _opened(store, asked) as work, opened(recording, store) as drive:
        home = work.simulated(_sized("K", asked))
        taught = (drive.sequence.source, *home.train)
        sources = work.given(taught) if labels == "true" else work.automatic(taught)
        name = f"{labels}_{asked.seed}"
        weights = work.network(name, TrainingData(sources, work.given(home.validation)))
        for test in tests:
            with opened(test, store) as unseen:
                counts = work.score_network(labels, name, weights, [unseen.sequence.source]).counts
            scores[test] = scores_of(counts)
    return {"scores": scores, "seconds": work.seconds[name]}
