"""Scores of labels on disk: label files are matched with scans by name and counted together; table and JSON."""

import json
import logging
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from automos.core.arguments import require_own_names
from automos.core.errors import InputError
from automos.core.json_members import without_nan
from automos.core.label_files import read_labels
from automos.core.run import Progress, silent
from automos.core.scan import Sequence
from automos.evaluation.moving import Counts, Scores, count, percent, ranges_of
from automos.evaluation.objects import FOUND, OUTCOMES, Movers, movers_of, scores_of_objects
from automos.evaluation.overlaps import NO_TRACK, Overlaps, count_overlaps, pooled
from automos.evaluation.predictions import StoredStages, find_predictions, says_what_moves_now

logger = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Result:
    """Counts of one recording, and what its movers and tracks share."""

    counts: Counts = field(default_factory=Counts)
    overlaps: Overlaps = field(default_factory=Overlaps.empty)

    @property
    def movers(self) -> Movers:
        """The moving objects of the truth, and what became of each."""
        return movers_of(self.overlaps)


@dataclass(frozen=True, eq=False)
class Report:
    """Counts of recordings by name, and their scores."""

    recordings: dict[str, Result]

    @property
    def counts(self) -> Counts:
        """The points of all recordings, pooled."""
        return sum((result.counts for result in self.recordings.values()), start=Counts())

    @property
    def scores(self) -> Scores:
        """The scores of all points; `scores.iou` is the benchmark's number."""
        return self.counts.scores

    @property
    def objects(self) -> dict[str, Any] | None:
        """The scores of all objects; None where no truth names them, or no label the tracks."""
        return _objects([result.overlaps for result in self.recordings.values()])

    def to_dict(self) -> dict[str, Any]:
        """Return all scores as plain numbers; ratios in [0, 1], None if undefined."""
        return {
            **_counts_dict(self.counts),
            "objects": without_nan(self.objects),
            "recordings": {
                name: {
                    **_counts_dict(result.counts),
                    "objects": _movers_dict(result.movers),
                    "of_objects": without_nan(_objects([result.overlaps])),
                }
                for name, result in self.recordings.items()
            },
        }

    def to_json(self) -> str:
        """Return `to_dict` as JSON."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False) + "\n"

    def table(self) -> Table:
        """Return the scores as a table: all points, by range, by recording; ratios in percent."""
        table = Table(
            title="Moving points, counted as SemanticKITTI does, in %; called moving rightly, wrongly, and missed",
            box=SIMPLE_HEAD,
            padding=0,
            show_edge=False,
        )
        table.add_column("", no_wrap=True)
        for heading in ("IoU", "precision", "recall", "right", "wrong", "missed", "objects"):
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_row(
            "all points", *_cells(self.scores), _found(self.recordings.values()), style="bold", end_section=True
        )
        for name, scores in self.counts.scores_by_range.items():
            table.add_row(name, *_cells(scores), "")
        table.add_section()
        if len(self.recordings) > 1:
            for name, result in self.recordings.items():
                table.add_row(name, *_cells(result.counts.scores), _found([result]))
        return table


# ---------------------------------------------------------------------------------------------------- evaluating
def evaluate_recordings(predictions: str | Path, sequences: Iterable[Sequence], progress: Progress = silent) -> Report:
    """Score labels on disk against the ground truth that comes with the recordings.

    Parameters
    ----------
    predictions : str or Path
        For one recording, a results folder or a folder of `.label` files. For several, a folder that holds one such
        folder per recording, named after it, or `sequences/<name>/predictions` as the SemanticKITTI benchmark wants.
    sequences : iterable of Sequence
        The recordings. Those without ground truth are left out, with a warning in the log.
    progress : callable, optional
        Called as `progress(what, done, total)` after each scan.

    Returns
    -------
    Report
        Scores of all points together, by range, and of each recording.

    Raises
    ------
    InputError
        No recording has ground truth, or a prediction is missing or has another number of points than its scan.

    Examples
    --------
    >>> import automos
    >>> from automos.evaluation.report import evaluate_recordings
    >>> report = evaluate_recordings("automos_runs/my_log", automos.open_recordings("my_log"))
    >>> 0.0 <= report.scores.iou <= 1.0
    True
    """
    recordings = list(sequences)
    require_own_names([sequence.name for sequence in recordings])
    labelled = [s for s in recordings if any(s.truth(i) is not None for i in range(len(s)))]
    if not labelled:
        raise InputError(f"{_names(recordings)} came without labels: there is no truth to compare with")
    if len(labelled) < len(recordings):
        logger.warning("left out, without truth: %s", _names(s for s in recordings if s not in labelled))
    folders = {s.name: find_predictions(Path(predictions), s.name, len(recordings) == 1) for s in labelled}
    if of_now := [name for name, folder in folders.items() if says_what_moves_now(folder)]:
        logger.warning(
            "the labels of %s say what moves in each scan; to compare with a truth of what moved at any time, as "
            "SemanticKITTI's, label with --set labels.moving=sequence",
            ", ".join(of_now),
        )
    return Report({s.name: evaluate_folder(folders[s.name], s, progress) for s in labelled})


def evaluate_folder(folder: str | Path, sequence: Sequence, progress: Progress = silent) -> Result:
    """Return the counts of one recording whose predictions are `folder / <scan name>.label`.

    Raises
    ------
    InputError
        A prediction or the ground truth of a scan is missing, damaged, or has another number of points.
    """
    folder = Path(folder)
    counts, overlaps, stored = Counts(), [Overlaps.empty()], StoredStages(folder)
    for i, name in enumerate(sequence.names):
        truth = sequence.truth(i)
        if truth is not None:
            prediction = read_labels(folder / f"{name}.label", len(truth))
            counts += count(prediction, truth, ranges_of(sequence[i].points))
            overlaps.append(count_overlaps(i, prediction, truth, stored.tracks(name, prediction)))
        progress(f"evaluating {sequence.name}", i + 1, len(sequence))
    return Result(counts, Overlaps.concatenate(overlaps))


def _names(sequences: Iterable[Sequence]) -> str:
    return ", ".join(sequence.name for sequence in sequences)


# ------------------------------------------------------------------------------------------------------- showing
def _counts_dict(counts: Counts) -> dict[str, Any]:
    return {
        "n_scans": counts.n_scans,
        **_scores_dict(counts.scores),
        "ranges": {name: _scores_dict(scores) for name, scores in counts.scores_by_range.items()},
    }


def _scores_dict(scores: Scores) -> dict[str, float | int | None]:
    return without_nan(scores.ratios | asdict(scores))


def _objects(recordings: list[Overlaps]) -> dict[str, Any] | None:
    overlaps = pooled(recordings)
    is_told = (overlaps.mover > 0).any() and (overlaps.track > NO_TRACK).any()
    return scores_of_objects(overlaps) if is_told else None


def _movers_dict(movers: Movers) -> list[dict[str, Any]]:
    columns = (movers.label >> 16, movers.label & 0xFFFF, movers.n_scans, movers.n_points, movers.recall)
    names = ("instance", "label", "n_scans", "n_points", "recall", "outcome", "track", "association")
    outcome = np.array(OUTCOMES)[movers.outcome]
    rows = zip(*(one.tolist() for one in (*columns, outcome, movers.best, movers.association)), strict=True)
    return [dict(zip(names, row, strict=True)) for row in rows]


def _cells(scores: Scores) -> list[str]:
    points = (f"{value:,}" for value in (scores.true_dynamic, scores.false_dynamic, scores.false_static))
    return [*map(percent, scores.ratios.values()), *points]


def _found(results: Iterable[Result]) -> str:
    recall = np.concatenate([result.movers.recall for result in results])
    return f"{int((recall >= FOUND).sum())} of {len(recall)}" if len(recall) else "-"
