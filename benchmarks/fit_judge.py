"""Fit the weights of the verdict's terms on labelled recordings, and say how well its probabilities hold.

    python benchmarks/fit_judge.py --train RECORDING ... --test RECORDING ... [--cache FOLDER]

Every recording is taken to tracks with the default preset; a track has moved where most of its points have. The weights
are those of a logistic regression, a track counting by the square root of its points, so that neither scraps nor the
longest tracks alone decide. Printed: prior and weights for `automos.objects.judge`, and on both sets the share of
points that would be labelled rightly (IoU of moving over tracked points) and the expected calibration error, with the
present weights and with the new ones.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import numpy.typing as npt
from experiment import code_digest
from sklearn.linear_model import LogisticRegression

from automos import load_settings, open_sequence
from automos.core.labels import Label, to_mos
from automos.objects.detections import Detections
from automos.objects.judge import PRIOR, WEIGHTS, segment_terms, track_terms
from automos.objects.tracker import track_objects
from automos.pipeline import Steps

Table = npt.NDArray[np.float64]
"""(T, len(WEIGHTS) + 2): the terms of tracks seen more than once, and how many of their points moved and did not."""


def tracks_of(recording: Path, cache: Path) -> Table:
    """Return the tracks of a labelled recording, kept in `cache` by its name and by the code."""
    file = cache / f"{code_digest()}-{recording.name}.npy"
    if not file.exists():
        cache.mkdir(parents=True, exist_ok=True)
        np.save(file, _tracks_of(recording))
    return np.load(file)


def _tracks_of(recording: Path) -> Table:
    sequence, settings = open_sequence(recording), load_settings("default")
    steps = Steps(sequence, settings)
    instances = steps.instances()
    detections = [Detections.from_arrays(instances.load(name, *Detections.columns())) for name in sequence.names]
    tracks = track_objects(zip(steps.trajectory.stamps, detections, strict=True), settings.tracking)
    points = np.zeros((len(tracks), 2))
    for i, name in enumerate(sequence.names):
        true, frame, ids = to_mos(sequence.truth(i)), steps.frames[i], instances.load(name, "ids", "stayed")
        rows = np.flatnonzero((tracks.scan == i) & tracks.is_observed)
        for kind, column in ((Label.MOVING, 0), (Label.STATIC, 1)):
            is_kind = true[frame.kept] == kind
            n = np.zeros(len(detections[i]) + 1)
            for own in ids.values():
                n += _count(own[is_kind], len(n))
            np.add.at(points[:, column], tracks.track[rows], n[tracks.segment[rows]])
    n_seen = np.bincount(tracks.track[tracks.is_observed], minlength=len(tracks))
    return np.column_stack([track_terms(tracks, [segment_terms(found) for found in detections]), points])[n_seen > 1]


def _count(ids: npt.NDArray[np.int32], n: int) -> Table:
    return np.bincount(ids[ids >= 0], minlength=n)[:n].astype(np.float64)


def fit(tables: list[Table]) -> tuple[float, npt.NDArray[np.float64]]:
    """Return the prior and the weights of the terms."""
    all_tracks = np.concatenate(tables)
    terms, moved, stayed = all_tracks[:, : len(WEIGHTS)], all_tracks[:, -2], all_tracks[:, -1]
    used = moved + stayed > 0
    model = LogisticRegression(C=10.0, max_iter=5000)
    model.fit(terms[used], (moved > stayed)[used], np.sqrt(moved + stayed)[used])
    return float(model.intercept_[0]), model.coef_[0]


def quality(tables: list[Table], prior: float, weights: npt.NDArray[np.float64], threshold: float) -> str:
    """Return mean and worst IoU over `tables`, and the calibration of moving and static points."""
    iou, false_points = [], 0.0
    probability = [1.0 / (1.0 + np.exp(-(prior + table[:, : len(WEIGHTS)] @ weights))) for table in tables]
    for p, table in zip(probability, tables, strict=True):
        moved, stayed = table[:, -2], table[:, -1]
        called = p >= threshold
        false_points += stayed[called].sum()
        if moved.sum():
            iou.append(100.0 * moved[called].sum() / (moved.sum() + stayed[called].sum()))
    p, moved, stayed = np.concatenate(probability), *np.concatenate(tables)[:, -2:].T
    errors = []
    for is_moving in (True, False):
        sure, right = (p, moved) if is_moving else (1.0 - p, stayed)
        rows = (p >= threshold) == is_moving
        n = (moved + stayed)[rows]
        bins = np.minimum((sure[rows] * 20).astype(int), 19)
        gap = np.bincount(bins, sure[rows] * n - right[rows], 20)
        errors.append(np.abs(gap).sum() / max(n.sum(), 1.0))
    return (
        f"IoU {np.mean(iou):.2f}, worst {min(iou):.1f}, {false_points:,.0f} false points, "
        f"calibration error {errors[0]:.3f} moving, {errors[1]:.3f} static"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--train", type=Path, nargs="+", required=True)
    parser.add_argument("--test", type=Path, nargs="+", required=True)
    parser.add_argument("--cache", type=Path, default=Path.home() / ".cache" / "automos" / "judge")
    arguments = parser.parse_args()
    train, test = ([tracks_of(r, arguments.cache) for r in part] for part in (arguments.train, arguments.test))
    threshold = load_settings("default").tracking.judge.min_probability
    now = PRIOR, np.array(list(WEIGHTS.values()))
    prior, weights = fit(train)
    print(f"prior {prior:.2f}, " + ", ".join(f"{n} {w:.2f}" for n, w in zip(WEIGHTS, weights, strict=True)))
    for name, tables in (("train", train), ("test", test)):
        print(f"{name}, now: {quality(tables, *now, threshold)}")
        print(f"{name}, new: {quality(tables, prior, weights, threshold)}")


if __name__ == "__main__":
    main()
