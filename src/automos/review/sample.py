"""A random sample of a run's labels for a person to judge, stored in sample.json; answers are lines of the log."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, TypeAdapter

from automos.core.atomic import write_json
from automos.core.errors import InputError
from automos.core.labels import Label
from automos.core.reading import checked, read_json
from automos.core.run import Progress, silent
from automos.core.scan import Mask
from automos.core.upright_boxes import Boxes, points_in_boxes
from automos.core.workspace import Workspace, write_run
from automos.objects.tracks import observed
from automos.review.apply import RECORD
from automos.review.box_rows import as_box
from automos.review.log import append_lines, key_of_changes, now, read_lines
from automos.review.quality import Estimate, recall, share, total_of_moments
from automos.review.run_stages import Changes, Rows, RunStages, changed_labels, decided_verdicts

SAMPLE_FILE = "sample.json"
FRINGE = 0.5
"""Metres around boxes of what moves within which other points may well be parts of it."""
SHARES = {"moving": 0.4, "fringe": 0.3, "moment": 0.3}
"""What part of the looks each stratum gets."""
LEAST = 10
"""Looks below which nothing can be said."""
ANSWERS = ("moving", "static", "unknown")

Kind = Literal["moving", "fringe", "moment"]
_OF_POINTS: tuple[Kind, Kind] = ("moving", "fringe")
"""Strata of which points are looked at, not moments."""


@dataclass(frozen=True)
class Look:
    """One thing to look at: a point (`row` of a scan) that is "moving" or "fringe", or a whole "moment" of `n_scans`.

    index : of the scan.
    """

    kind: Kind
    index: Annotated[int, Field(ge=0)]
    row: Annotated[int, Field(ge=-1)] = -1
    n_scans: Annotated[int, Field(ge=1)] = 1


@dataclass(frozen=True)
class Sample:
    """A random sample, and the sizes of its strata.

    Attributes
    ----------
    key : when it was drawn.   labels : fingerprint of the labels it is of.
    n_moving, n_fringe : points of the strata.
    usual : points that something moving has in a scan.
    looks : in the order in which they are shown; of one stratum, each first part is a random sample too.
    """

    key: str
    labels: str
    n_moving: Annotated[int, Field(ge=0)]
    n_fringe: Annotated[int, Field(ge=0)]
    usual: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    looks: Annotated[list[Look], Field(min_length=1)]


_SAMPLE = TypeAdapter(Sample)


def strata(stages: RunStages, index: int, changes: Changes) -> tuple[Mask, Mask]:
    """Return which points (N,) of scan `index` are labelled moving, and which are in the fringe of what is."""
    is_moving = changed_labels(stages, index, changes)["label"] == Label.MOVING
    here = stages.tracks[stages.tracks.rows_in_scan(index)]
    parts = [here[decided_verdicts(stages.verdicts, changes.decided).is_moving[here.track]].boxes]
    for amendment in changes.amendments:
        part = amendment.parts.get(stages.names[index])
        if part is not None and amendment.verdict == "moving":
            parts.append(as_box(part.box_level(stages.T_level_sensor[index])))
    is_fringe, frame = np.zeros(len(is_moving), np.bool_), stages.frame(index)
    is_fringe[frame.kept] = points_in_boxes(frame.points_level, Boxes.concatenate(parts), FRINGE) >= 0
    return is_moving, is_fringe & ~is_moving


def draw(
    stages: RunStages,
    changes: Changes,
    n_looks: int,
    seed: int | None = None,
    progress: Progress = silent,
) -> Sample:
    """Return a random sample of `n_looks` looks at the labels as they are after `changes`.

    Raises
    ------
    InputError
        Too few looks to say anything.
    """
    if n_looks < LEAST:
        raise InputError(f"--sample {n_looks} is too few looks to say anything: draw {LEAST} or more, 100 is usual")
    rng = np.random.default_rng(seed)
    n = len(stages.names)
    counts = np.zeros((2, n), np.int64)
    for i in range(n):
        counts[:, i] = [mask.sum() for mask in strata(stages, i, changes)]
        progress("sample", i + 1, n)
    looks = []
    for kind, of_scans in zip(_OF_POINTS, counts, strict=True):
        if of_scans.sum():
            drawn = rng.integers(of_scans.sum(), size=round(SHARES[kind] * n_looks))
            looks += _looks_at(stages, changes, kind, of_scans, drawn)
    edges = np.linspace(0, n, min(round(SHARES["moment"] * n_looks), n) + 1).round().astype(int)
    looks += [Look("moment", int(rng.integers(a, b)), n_scans=int(b - a)) for a, b in pairwise(edges)]
    labels = key_of_labels(stages.folder)
    n_moving, n_fringe = counts.sum(axis=1).tolist()
    return Sample(now(), labels, n_moving, n_fringe, _usual_size(stages, changes), looks)


def _looks_at(stages: RunStages, changes: Changes, kind: Kind, of_scans: Rows, drawn: Rows) -> list[Look]:
    """Return looks at the points of a stratum that are numbered `drawn` through all scans, in that order."""
    starts = np.concatenate([[0], np.cumsum(of_scans)])
    scans = np.searchsorted(starts, drawn, side="right") - 1
    rows = np.zeros(len(drawn), np.int64)
    for i in np.unique(scans).tolist():
        mask = strata(stages, i, changes)[_OF_POINTS.index(kind)]
        here = scans == i
        rows[here] = np.flatnonzero(mask)[drawn[here] - starts[i]]
    return [Look(kind, int(i), int(row)) for i, row in zip(scans, rows, strict=True)]


def _usual_size(stages: RunStages, changes: Changes) -> float:
    """Return how many points something moving has in a scan, in the middle."""
    is_moving = decided_verdicts(stages.verdicts, changes.decided).is_moving
    moving = observed(stages.tracks[is_moving[stages.tracks.track]])
    sizes = [
        stages.stage("instances").load(stages.names[i], "n_points")["n_points"][moving.segment[moving.scan == i]]
        for i in np.unique(moving.scan).tolist()
    ]
    sizes += [[len(part.rows)] for one in changes.amendments if one.verdict == "moving" for part in one.parts.values()]
    return float(np.median(np.concatenate(sizes))) if sizes else 100.0


# ------------------------------------------------------------------------------------------------------ kept in files
def save_sample(folder: Path, sample: Sample) -> None:
    """Write `sample` into `folder`."""
    looks = [list(vars(look).values()) for look in sample.looks]
    write_json(folder / SAMPLE_FILE, {**vars(sample), "looks": looks})


def read_sample(folder: Path) -> Sample | None:
    """Return the sample in `folder`, None without one; InputError if it is damaged."""
    path = folder / SAMPLE_FILE
    if not path.exists():
        return None
    try:
        fields = read_json(path)
        looks = [dict(zip(Look.__annotations__, look, strict=True)) for look in fields["looks"]]
        return checked(_SAMPLE, {**fields, "looks": looks})
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise InputError(f"{path} is damaged ({error}): remove it, and draw another with --sample") from None


def append_answer(folder: Path, sample: Sample, look: int, answer: str, missed: int = 0) -> None:
    """Log the answer to a look: one of `ANSWERS`, or "done" with the points missed in a moment."""
    line = {"kind": "answer", "at": now(), "sample": sample.key, "look": look, "answer": answer, "missed": missed}
    append_lines(folder, [line])


def read_answers(folder: Path, sample: Sample) -> dict[int, tuple[str, int]]:
    """Return the last answer to each look of `sample`, and the points missed; errors are the log's."""
    lines = read_lines(
        folder, "answer", "an answer",
        lambda line: (str(line["sample"]), int(line["look"]), str(line["answer"]), int(line["missed"])),
    )  # fmt: skip
    return {look: (answer, missed) for key, look, answer, missed in lines if key == sample.key}


# ------------------------------------------------------------------------------------------------------- what it says
def estimate(sample: Sample, answers: dict[int, tuple[str, int]]) -> dict[str, Any]:
    """Return precision and recall from the answers so far: `value`, `low`, `high`, or None; and looks by stratum."""
    by_kind = {kind: [n for n, look in enumerate(sample.looks) if look.kind == kind] for kind in SHARES}
    judged = {
        kind: [n for n in these if n in answers and answers[n][0] != "unknown"] for kind, these in by_kind.items()
    }

    def of(kind: str) -> Estimate:
        return share(sum(answers[n][0] == "moving" for n in judged[kind]), len(judged[kind]))

    moments = [(answers[n][1], sample.looks[n].n_scans) for n in judged["moment"]]
    found = precision = None
    if judged["moving"]:
        precision = of("moving")
        is_whole = all(n in answers for kind in ("fringe", "moment") for n in by_kind[kind]) and moments
        if is_whole:
            missed, n_scans = np.array(moments).T
            # A window whose moment could not be judged is assumed to be like the others.
            n_scans = n_scans * sum(look.n_scans for look in sample.looks if look.kind == "moment") / n_scans.sum()
            parts = [total_of_moments(missed.astype(np.float64), n_scans, sample.usual)]
            if sample.n_fringe:
                parts.append(of("fringe").scaled(sample.n_fringe))
            found = recall(precision.scaled(sample.n_moving), parts)
    return {
        "precision": None if precision is None else _rounded(precision),
        "recall": None if found is None else _rounded(found),
        "answered": {kind: len(these) for kind, these in judged.items()},
        "drawn": sample.key,
    }


def note_quality(folder: Path) -> None:
    """Write the result of the sample to run.json, and remove results for other labels."""
    with RECORD:
        sample = read_sample(folder)
        answers = {} if sample is None or sample.labels != key_of_labels(folder) else read_answers(folder, sample)
        run = Workspace(folder).read_run()
        before = run.pop("quality", None)
        if sample is not None and answers:
            run["quality"] = estimate(sample, answers)
        if run.get("quality") != before:
            write_run(folder, run)


def key_of_labels(folder: Path) -> str:
    """Return a fingerprint of the labels in `folder`: of the run and of the decisions since."""
    return f"{Workspace(folder).read_run().get('fingerprint')}{key_of_changes(folder)}"


def _rounded(found: Estimate) -> dict[str, float]:
    return {key: round(value, 4) for key, value in vars(found).items()}
