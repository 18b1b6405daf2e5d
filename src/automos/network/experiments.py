"""The paper's experiments with LMNet: Table II, Table III and the curve of fine-tuning (IV-C, IV-D).

Each is a folder that fills up: recordings, automatic labels, networks, scores. What is there is not made again, so an
experiment that was interrupted goes on with the same command.
"""

import logging
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from automos.core.claims import EXPERIMENT, claim
from automos.core.run import Progress, silent
from automos.core.scan import Sequence
from automos.core.workspace import RUN_FILE
from automos.evaluation.moving import Counts, count
from automos.evaluation.predictions import find_predictions
from automos.evaluation.report import evaluate_folder
from automos.labeling import label_recording
from automos.network.domains import Domain, write_part
from automos.network.recordings import Source
from automos.network.rivals import flow_labels, movable_labels
from automos.network.segment import open_network, segment_recording
from automos.network.tables import Curves, Row
from automos.network.train import TrainingData, require_training, train
from automos.odometry.estimate import estimate_trajectory
from automos.readers import open_recordings
from automos.settings import Settings

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
    "network.training.validation_scans": 40,
}
"""Settings with which every experiment fits into an hour of one CPU core each: the narrow network, small images."""

_SHIPPED = {
    **SMALL,
    "network.image.height": 64,
    "network.image.width": 1024,
    "network.training.epochs": 35,
    "network.training.samples": 800,
    "network.training.sector": 256,
    "network.training.packed": 1500,
}
_FULL = {"network.training.epochs": 20, "network.training.samples": 1200, "network.training.packed": 3200}

SIZES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "table2": (SMALL, {}),
    "table3": (SMALL, {}),
    "network": (_SHIPPED, _FULL),
}
"""Settings of each experiment, small and full. The full network sees 24,000 scans of many sensors, six minutes at the
70 a second of an H100; the small one 28,000 quarters of scans, an hour of a CPU core."""

TUNING: dict[str, Any] = {"network.training.keep": (1, 2, 4, 8, 16)}
"""What fine-tuning changes: networks are kept on the way for the curve. Only the start differs from retraining."""


@dataclass(frozen=True)
class Data:
    """The recordings of one data set by purpose; `extra` is never read for its labels."""

    train: tuple[Path, ...]
    validation: tuple[Path, ...]
    test: tuple[Path, ...]
    extra: tuple[Path, ...] = ()


@dataclass
class Experiment:
    """The folder of one experiment and how its networks are trained."""

    folder: Path
    settings: Settings
    tuning: Settings
    device: Any = "auto"
    progress: Progress = silent
    seconds: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        claim(self.folder, EXPERIMENT)

    def simulated(self, domain: Domain) -> Data:
        """Return the recordings of a simulated domain, written where they are not there yet."""
        parts = (domain.train, domain.validation, domain.test, domain.extra)
        written = [write_part(part, self.folder / "recordings", self.progress) for part in parts]
        return Data(*(tuple(each.source for each in part if each.source is not None) for part in written))

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
        require_training()
        from automos.network.training import read_curve

        if not (out / "best.pt").exists():
            settings = self.settings if init is None else self.tuning
            train(data, out, settings, init, self.device, progress=self.progress, poses=self.folder / "poses")
        self.seconds[name] = sum(row.get("seconds", 0.0) for row in read_curve(out))
        return out / "best.pt"

    def score_network(self, method: str, name: str, weights: Path, test: Iterable[Path]) -> Row:
        """Return how a network does online on the test recordings, all points pooled."""
        network = open_network(weights)
        counts = Counts()
        for sequence in _sequences(test):
            folder = self.folder / "segmented" / name / sequence.name
            if not (folder / RUN_FILE).exists():
                segment_recording(sequence, folder, network, self.settings, progress=self.progress)
            counts += evaluate_folder(folder / "predictions", sequence).counts
        return Row(method, counts, self.seconds.get(name, 0.0) / 3600.0)

    def score(self, method: str, test: Iterable[Path], make: Callable[[Sequence], Callable[[int, Any], Any]]) -> Row:
        """Return how a labeler does that gives the labels of a scan of a recording, from its index and its truth."""
        counts = Counts()
        for sequence in _sequences(test):
            labels = make(sequence)
            for i in range(len(sequence)):
                if (truth := sequence.truth(i)) is not None:
                    counts += count(labels(i, truth), truth)
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


def many_sensors(work: Experiment, data: Data) -> list[Row]:
    """Return how a network of true labels of simulated worlds does on others; lmnet.pt and lmnet.onnx ship."""
    weights = work.network("shipped", TrainingData(work.given(data.train), work.given(data.validation)))
    from automos.network.checkpoint import load_checkpoint, save_checkpoint
    from automos.network.export import export_onnx

    checkpoint = load_checkpoint(weights)
    save_checkpoint(work.folder / "lmnet.pt", checkpoint, half=True)
    export_onnx(checkpoint, work.folder / "lmnet.onnx")
    return [work.score_network("LMNet, many sensors", "shipped", weights, data.test)]


def rivals(work: Experiment, data: Data, predictions: dict[str, Path]) -> list[Row]:
    """Return the rows of the online methods that LMNet is compared with."""

    def flow(sequence: Sequence) -> Callable[[int, Any], Any]:
        trajectory = estimate_trajectory(sequence, work.settings.odometry)
        return lambda index, truth: flow_labels(sequence, trajectory, index)

    rows = [
        work.score("all movable classes", data.test, lambda sequence: lambda index, truth: movable_labels(truth)),
        work.score("scene-flow threshold", data.test, flow),
    ]
    for method, folder in predictions.items():
        sequences = list(_sequences(data.test))
        results = [evaluate_folder(find_predictions(folder, s.name, len(sequences) == 1), s) for s in sequences]
        rows.append(Row(method, sum((result.counts for result in results), Counts())))
    return rows


def table_three(work: Experiment, home: Data, away: Data) -> tuple[list[Row], Curves]:
    """Return Table III, and the IoU against the number of epochs (Fig. 3).

    `home` is where manual labels are (the paper's KITTI), `away` the other environment (its Apollo).
    """
    manual = work.network("manual", TrainingData(work.given(home.train), work.given(home.validation)))
    ours = work.network("ours", TrainingData(work.automatic(home.train), work.given(home.validation)))
    there = TrainingData(work.automatic(away.train), work.given(away.validation))
    retrained = work.network("retrained", there)
    tuned = work.network("tuned", there, init=ours)
    networks = {
        "LMNet + manual, trained at home": ("manual", manual),
        "LMNet + ours, trained at home": ("ours", ours),
        "LMNet + ours, retrained": ("retrained", retrained),
        "LMNet + ours, fine-tuned": ("tuned", tuned),
    }
    rows = [work.score_network(method, *network, away.test) for method, network in networks.items()]
    return rows, _curves(work, retrained, tuned, rows, away.test)


def _curves(work: Experiment, retrained: Path, tuned: Path, rows: list[Row], test: Iterable[Path]) -> Curves:
    """Return Fig. 3: every epoch on the validation recordings, the networks kept on the way on the test recordings."""
    from automos.network.checkpoint import load_checkpoint
    from automos.network.training import read_curve

    validation = {}
    for name, weights in (("retrained", retrained), ("fine-tuned", tuned)):
        before = load_checkpoint(weights).card.get("iou_before", 0.0)
        validation[name] = [before, *(row["val_iou_moving"] for row in read_curve(weights.parent))]
    tested = {0: rows[1].counts.scores.iou}
    for weights in sorted((tuned.parent / "epochs").glob("*.pt")):
        row = work.score_network(weights.stem, f"tuned_{weights.stem}", weights, test)
        tested[int(weights.stem)] = row.counts.scores.iou
    return Curves(validation, tested, rows[2].counts.scores.iou)


def _sequences(paths: Iterable[Path]) -> Iterable[Sequence]:
    for path in paths:
        yield from open_recordings(path)
