"""The paper's experiments with LMNet: Table II, Table III and the curve of fine-tuning (IV-C, IV-D).

Each is a folder that fills up: recordings, automatic labels, networks, scores. What is there is not made again, so an
experiment that was interrupted goes on with the same command.
"""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from automos.atomic import write_text
from automos.datasets import open_recordings
from automos.evaluation.moving import Counts, count
from automos.evaluation.report import evaluate_folder, find_predictions
from automos.labeling import label_recording
from automos.learning.domains import DOMAINS, write_part
from automos.learning.recordings import Source
from automos.learning.rivals import FlowThreshold, movable_labels
from automos.learning.segment import open_network, segment_recording
from automos.learning.train import TrainingData, require_training, train
from automos.odometry import estimate_trajectory
from automos.run import Progress
from automos.scan import Sequence
from automos.settings import Settings
from automos.workspace import RUN_FILE

_log = logging.getLogger(__name__)

SMALL: dict[str, Any] = {
    "network.image.height": 32,
    "network.image.width": 512,
    "network.model.channels": 8,
    "network.model.dropout": 0.1,
    "network.training.epochs": 20,
    "network.training.samples": 200,
    "network.training.batch": 4,
    "network.training.learning_rate": 0.004,
    "network.training.patience": 100,
    "network.training.validation_scans": 40,
}
"""Settings with which every experiment fits into an hour of one CPU core each: the narrow network, small images."""

TUNING: dict[str, Any] = {"network.training.epochs": 10, "network.training.learning_rate": 0.002}
"""What fine-tuning changes of them."""


@dataclass(frozen=True)
class Data:
    """The recordings of one data set by purpose; `extra` is never read for its labels."""

    train: tuple[Path, ...]
    validation: tuple[Path, ...]
    test: tuple[Path, ...]
    extra: tuple[Path, ...] = ()


@dataclass(frozen=True, eq=False)
class Row:
    """A line of a table."""

    method: str
    counts: Counts
    hours: float = 0.0


@dataclass
class Experiment:
    """The folder of one experiment and how its networks are trained."""

    folder: Path
    settings: Settings
    tuning: Settings
    device: Any = "auto"
    progress: Progress | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    def simulated(self, domain: str) -> Data:
        """Return the recordings of a simulated domain, written where they are not there yet."""
        home = self.folder / "recordings"
        parts = {}
        for name in ("train", "validation", "test", "extra"):
            written = write_part(getattr(DOMAINS[domain], name), home, self.progress)
            parts[name] = tuple(sequence.source for sequence in written if sequence.source is not None)
        return Data(**parts)

    def given(self, recordings: Iterable[Path]) -> tuple[Source, ...]:
        """Return recordings with the labels they came with."""
        return tuple(Source(path) for path in recordings)

    def automatic(self, recordings: Iterable[Path]) -> tuple[Source, ...]:
        """Return recordings with labels made by the labeler."""
        sources = []
        for path in recordings:
            for sequence in open_recordings(path):
                results = self.folder / "labels" / sequence.name
                if not (results / RUN_FILE).exists():
                    label_recording(sequence, results, self.settings)
                sources.append(Source(sequence.source or path, results))
        return tuple(sources)

    def network(self, name: str, data: TrainingData, init: Path | None = None) -> Path:
        """Return the checkpoint of the network `name`, trained where that was not done yet."""
        out = self.folder / "networks" / name
        start = time.perf_counter()
        done = out / "hours.json"
        if not done.exists():
            require_training()
            settings = self.settings if init is None else self.tuning
            train(data, out, settings, init, self.device, progress=self.progress, poses=self.folder / "poses")
            write_text(done, json.dumps({"hours": (time.perf_counter() - start) / 3600.0}))
        self.seconds[name] = 3600.0 * float(json.loads(done.read_text())["hours"])
        return out / "best.pt"

    def score_network(self, method: str, name: str, weights: Path, test: Iterable[Path]) -> Row:
        """Return how a network does online on the test recordings, all points pooled."""
        network = open_network(weights, self.settings)
        counts = Counts()
        for sequence in _sequences(test):
            folder = self.folder / "segmented" / name / sequence.name
            if not (folder / RUN_FILE).exists():
                segment_recording(sequence, folder, network, self.settings, progress=self.progress)
            counts += evaluate_folder(folder / "predictions", sequence).counts
        return Row(method, counts, self.seconds.get(name, 0.0) / 3600.0)

    def score(self, method: str, test: Iterable[Path], make: Callable[[Sequence], Callable[[int], Any]]) -> Row:
        """Return how a labeler does that gives the labels of scan i of a recording."""
        counts = Counts()
        for sequence in _sequences(test):
            labels = make(sequence)
            for i in range(len(sequence)):
                truth = sequence.truth(i)
                if truth is not None:
                    counts += count(labels(i), truth)
        return Row(method, counts)


def table_two(work: Experiment, data: Data, predictions: dict[str, Path]) -> list[Row]:
    """Return Table II: manual labels, automatic ones, automatic ones of more recordings, and the online rivals."""
    own = data.train
    networks = {
        "LMNet + manual": ("manual", work.given(own)),
        "LMNet + ours": ("ours", work.automatic(own)),
        "LMNet + ours + extra": ("extra", work.automatic((*own, *data.extra))),
    }
    rows = rivals(work, data, predictions)
    for method, (name, sources) in networks.items():
        weights = work.network(name, TrainingData(sources, work.given(data.validation)))
        rows.append(work.score_network(method, name, weights, data.test))
    return rows


def rivals(work: Experiment, data: Data, predictions: dict[str, Path]) -> list[Row]:
    """Return the rows of the online methods that LMNet is compared with."""

    def flow(sequence: Sequence) -> Callable[[int], Any]:
        trajectory = estimate_trajectory(sequence, work.settings.odometry)
        return FlowThreshold(sequence, trajectory, work.settings.network.scene_flow).labels

    def movable(sequence: Sequence) -> Callable[[int], Any]:
        def labels(index: int) -> Any:
            truth = sequence.truth(index)
            assert truth is not None, "only scans with truth are scored"
            return movable_labels(truth)

        return labels

    rows = [
        work.score("all movable classes", data.test, movable),
        work.score("scene-flow threshold", data.test, flow),
    ]
    for method, folder in predictions.items():
        sequences = list(_sequences(data.test))
        results = [evaluate_folder(find_predictions(folder, s.name, len(sequences) == 1), s) for s in sequences]
        rows.append(Row(method, sum((result.counts for result in results), Counts())))
    return rows


def table_three(work: Experiment, home: Data, away: Data) -> tuple[list[Row], dict[str, list[float]]]:
    """Return Table III, and by method the IoU on the validation recordings after each epoch (Fig. 3).

    `home` is where manual labels are (the paper's KITTI), `away` the other environment (its Apollo).
    """
    manual = work.network("manual", TrainingData(work.given(home.train), work.given(home.validation)))
    ours = work.network("ours", TrainingData(work.automatic(home.train), work.given(home.validation)))
    there = TrainingData(work.automatic(away.train), work.given(away.validation))
    retrained = work.network("retrained", there)
    tuned = work.network("tuned", there, init=ours)
    rows = [
        work.score_network("LMNet + manual, trained at home", "manual", manual, away.test),
        work.score_network("LMNet + ours, trained at home", "ours", ours, away.test),
        work.score_network("LMNet + ours, retrained", "retrained", retrained, away.test),
        work.score_network("LMNet + ours, fine-tuned", "tuned", tuned, away.test),
    ]
    from automos.network.checkpoint import load_checkpoint
    from automos.network.training import read_curve

    curves = {}
    for name, weights in (("retrained", retrained), ("tuned", tuned)):
        before = load_checkpoint(weights).card.get("iou_before", 0.0)
        curves[name] = [before, *(row["val_iou_moving"] for row in read_curve(weights.parent))]
    return rows, curves


def write_table(rows: list[Row], path: Path) -> str:
    """Write the rows as JSON to `path`; return them as a Markdown table, ratios in percent."""
    lines = ["| method | IoU | precision | recall | training, h |", "|---|---:|---:|---:|---:|"]
    content = []
    for row in rows:
        s = row.counts.scores
        ratios = [f"{100 * value:.1f}" if np.isfinite(value) else "-" for value in (s.iou, s.precision, s.recall)]
        lines.append(f"| {row.method} | {' | '.join(ratios)} | {f'{row.hours:.2f}' if row.hours else ''} |")
        content.append({"method": row.method, "iou": s.iou, "precision": s.precision, "recall": s.recall})
    write_text(path, json.dumps(content, indent=1))
    return "\n".join(lines)


def draw_curves(curves: dict[str, list[float]], path: Path) -> None:
    """Draw IoU against epochs."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
    names = {"retrained": "from scratch", "tuned": "fine-tuned"}
    for name, values in curves.items():
        axes.plot(range(len(values)), [100 * value for value in values], marker=".", label=names.get(name, name))
    axes.set(xlabel="epochs", ylabel="IoU of the moving class, %", ylim=(0, 100))
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _sequences(paths: Iterable[Path]) -> Iterable[Sequence]:
    for path in paths:
        yield from open_recordings(path)
