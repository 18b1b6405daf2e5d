"""How often the intervals of `automos review --sample` hold the truth, on simulated recordings that were labelled.

    python benchmarks/sampling.py --store FOLDER [--scenarios ...] [--sensors ...] [--scans 60] [--seeds 60]
                                  [--samples 100] [--looks 100] [--json FILE]

Each world is simulated once into FOLDER and labelled once; then sample after sample is drawn of its labels, and someone
who knows the truth of every point answers all looks. Counted is how many of the intervals of 95 % hold the precision
and the recall that all points have. Nothing of the intervals was chosen on seed 60.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
from store import stored_world

from automos.core.labels import Label, to_mos
from automos.core.scan import Sequence
from automos.labeling import label_recording
from automos.review.apply import Changes
from automos.review.run_stages import RunStages
from automos.review.sample import Sample, draw, estimate, strata
from automos.settings import load_settings

ROUNDING = 5e-5
"""Half of the last digit of what `estimate` gives back."""


def answers_of_who_knows(stages: RunStages, truth: list[np.ndarray], sample: Sample) -> dict[int, tuple[str, int]]:
    """Return the answers to all looks of someone who sees which points move."""
    answers = {}
    for number, look in enumerate(sample.looks):
        moves = truth[look.index] == Label.MOVING
        if look.kind == "moment":
            is_moving, is_fringe = strata(stages, look.index, Changes())
            answers[number] = "done", int((moves & ~is_moving & ~is_fringe).sum())
        else:
            answers[number] = "moving" if moves[look.row] else "static", 0
    return answers


def true_scores(found: list[np.ndarray], truth: list[np.ndarray]) -> dict[str, float]:
    """Return precision and recall of the moving class over all points."""
    is_found, moves = (np.concatenate(labels) == Label.MOVING for labels in (found, truth))
    right = float((is_found & moves).sum())
    return {"precision": right / max(is_found.sum(), 1), "recall": right / max(moves.sum(), 1)}


def measure(sequence: Sequence, folder: Path, n_samples: int, n_looks: int) -> dict:
    """Label a recording into `folder`, and return how many of the intervals of `n_samples` samples hold the truth."""
    label_recording(sequence, folder, load_settings("default"), workers=1)
    stages = RunStages(folder, sequence)
    truth = [to_mos(sequence.truth(i)) for i in range(len(sequence))]
    exact = true_scores([stages.labels(i)["label"] for i in range(len(sequence))], truth)
    holds, width = dict.fromkeys(exact, 0), {name: [] for name in exact}
    for seed in range(n_samples):
        sample = draw(stages, Changes(), n_looks, seed=seed)
        told = estimate(sample, answers_of_who_knows(stages, truth, sample))
        for name, value in exact.items():
            low, high = told[name]["low"], told[name]["high"]
            holds[name] += int(low - ROUNDING <= value <= high + ROUNDING)
            width[name].append(high - low)
    wide = {name: float(np.median(found)) for name, found in width.items()}
    return {"samples": n_samples, "looks": n_looks, "truth": exact, "holds": holds, "width": wide}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, required=True)
    parser.add_argument("--scenarios", nargs="+", default=["city", "junction", "campus", "scooters"])
    parser.add_argument("--sensors", nargs="+", default=["VLP-16"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[60])
    parser.add_argument("--scans", type=int, default=60)
    parser.add_argument("--samples", type=int, default=100)
    parser.add_argument("--looks", type=int, default=100)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    found = {}
    print("| recording | precision | held | recall | held | interval, in the middle |\n|---|---:|---:|---:|---:|---:|")
    for seed in given.seeds:
        for scenario in given.scenarios:
            for sensor in given.sensors:
                world = stored_world(given.store, scenario, sensor, given.scans, seed)
                with tempfile.TemporaryDirectory() as folder:
                    row = measure(world, Path(folder) / "run", given.samples, given.looks)
                found[world.name] = row
                cells = [f"{100 * row['truth'][n]:.1f} | {row['holds'][n]} of {row['samples']}" for n in row["truth"]]
                wide = ", ".join(f"{100 * value:.0f}" for value in row["width"].values())
                print(f"| {scenario}, {sensor}, seed {seed} | {' | '.join(cells)} | {wide} points |", flush=True)
    if given.json:
        given.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
