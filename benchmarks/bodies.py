"""How good objects are: movers whole, tracks, boxes; and whether as many bodies move as their probability says."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from labels import N_BINS, scores_of
from recordings import opened
from rows import Lines, Row, part_of, percent, sensor_of

from automos import load_settings
from automos.core.label_files import to_mos
from automos.core.labels import Label
from automos.core.scan import Sequence
from automos.evaluation.objects import SIZES, scores_of_objects
from automos.evaluation.report import evaluate_recordings
from automos.labeling import label_recording
from automos.results.box_scores import box_errors
from automos.results.run_files import RunFiles
from automos.review.run_stages import RunStages

LEAST_BODIES = 30
"""In a bin of probability: bins with fewer are merged with the next."""
DRAWS, INTERVAL = 2000, 90.0
"""Bootstrap samples of the bodies in a bin, and percent of them in the interval."""


def score(recording: str, store: Path, method: str = "default") -> dict[str, Any]:
    """Return scores of points, objects and boxes, and how many bodies of each probability have moved."""
    with opened(recording, store) as made, tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "run"
        label_recording(made.sequence, place, load_settings(method), workers=1)
        (found,) = evaluate_recordings(place, [made.sequence]).recordings.values()
        return {
            "scans": len(made.sequence),
            **scores_of(found.counts),
            "objects": scores_of_objects(found.overlaps),
            "boxes": box_errors(RunFiles(place, made.sequence), found.overlaps).to_dict(),
            **_moved(RunStages(place, made.sequence), made.sequence),
        }


def _moved(stages: RunStages, sequence: Sequence) -> dict[str, Any]:
    """Return (N_BINS, 3) by probability of having moved: how many bodies, its sum, how many have; and of points.

    A body has moved if most of its points with truth are a mover's; without any such point it has no vote.
    """
    points = np.zeros((len(stages.tracks), 2))
    for i in range(len(sequence)):
        truth = sequence.truth(i)
        if truth is not None:
            owner, true = stages.owner_of_points(i), to_mos(truth)
            for k, kind in enumerate((Label.STATIC, Label.MOVING)):
                rows = owner[(owner >= 0) & (true == kind)]
                points[:, k] += np.bincount(rows, minlength=len(points))
    sure = stages.verdicts.confidence
    p = np.where(stages.verdicts.is_moving, sure, 1.0 - sure)
    judged = points.sum(axis=1) > 0
    points, p = points[judged], p[judged]
    bins = np.minimum((p * N_BINS).astype(int), N_BINS - 1)
    has_moved, n = points[:, 1] > points[:, 0], points.sum(axis=1)

    def by(*weights: npt.ArrayLike | None) -> list[list[float]]:
        return np.stack([np.bincount(bins, weight, N_BINS) for weight in weights], axis=1).tolist()

    return {"bodies": by(None, p, has_moved), "points_of_bodies": by(n, n * p, points[:, 1])}


def objects(rows: list[Row]) -> Lines:
    """Return one row a world, then all: movers whole, and what is wrong with the others; tracks and boxes."""
    names = [f"{n}+ points: whole" for n in SIZES]
    heading = ["world", *names, "missed, split, merged", "S_assoc", "tracks a mover", "elsewhere", "HOTA", "box IoU"]
    lines = [heading]
    for row in rows:
        found, boxes = row["objects"], row["boxes"]
        counts = [found["movers"][f"{n}+ points"] for n in SIZES]
        wrong = ", ".join(f"{counts[0][name]}" for name in ("missed", "split", "merged"))
        whole = [f"{each['whole']} of {sum(each.values())}" for each in counts]
        numbers = ["-" if found[key] is None else f"{found[key]:.2f}" for key in ("association", "tracks_per_mover")]
        title = f"`{part_of(row, 0)}`, {sensor_of(row)}, seed {part_of(row, 3)}"
        rest = [f"{found['tracks_elsewhere']}", percent(found["hota"]), percent(boxes["iou"]["median"])]
        lines.append([title, *whole, wrong, *numbers, *rest])
    totals = []
    for n in SIZES:
        counts = [row["objects"]["movers"][f"{n}+ points"] for row in rows]
        whole, of = sum(c["whole"] for c in counts), sum(sum(c.values()) for c in counts)
        totals.append(f"{whole} of {of} ({100 * whole / max(of, 1):.0f} %)")
    return [*lines, ["**all**", *totals, *[""] * (len(heading) - 1 - len(SIZES))]]


def calibration(rows: list[Row]) -> Lines:
    """Return one row a bin of probability, merged until it has `LEAST_BODIES`: how many of them have moved."""
    bodies, points = (np.sum([row[key] for row in rows], axis=0) for key in ("bodies", "points_of_bodies"))
    lines = [["says moved", "bodies", "have moved", "90 % interval", "interval is off by", "points", "points move"]]
    for part in merged(bodies[:, 0]):
        (n, p, moved), (of, p_points, move) = bodies[part].sum(axis=0), points[part].sum(axis=0)
        low, high = interval(int(n), int(moved))
        says = p / n
        off = max(low - says, says - high, 0.0)
        cells = [f"{says:.3f}", f"{n:.0f}", f"{moved / n:.3f}", f"{low:.2f} to {high:.2f}", f"{off:.2f}"]
        lines.append([*cells, f"{of:,.0f} at {p_points / max(of, 1.0):.3f}", f"{move / max(of, 1.0):.3f}"])
    return lines


def merged(n: npt.NDArray) -> list[slice]:
    """Return runs of bins of (N,) bodies `n` with `LEAST_BODIES` each, from the lowest on; the rest is in the last."""
    parts, start = [], 0
    for end in range(1, len(n) + 1):
        if n[start:end].sum() >= LEAST_BODIES:
            parts.append(slice(start, end))
            start = end
    if parts and start < len(n):
        parts[-1] = slice(parts[-1].start, len(n))
    return parts


def interval(n: int, moved: int) -> tuple[float, float]:
    """Return the bootstrap interval, over `n` bodies of which `moved` have moved, of the share that has."""
    shares = np.random.default_rng(0).binomial(n, moved / n, DRAWS) / n  # what resampling 0s and 1s comes to
    low, high = np.percentile(shares, [50.0 - 0.5 * INTERVAL, 50.0 + 0.5 * INTERVAL])
    return float(low), float(high)
