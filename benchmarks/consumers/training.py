"""A network from what `automos dataset` writes, and the same from shuffled labels: do labels travel through the layout?

    python benchmarks/consumers/training.py FOLDER RECORDING [RECORDING ...]

Needs the extra `train`. Six worlds are simulated and labelled beside the RECORDINGs, all runs become one data set in
SemanticKITTI's layout, and LMNet learns from its folders as from anyone's, once as they are and once with each scan's
labels shuffled among its points. Both networks label a world that none of it has seen. All is done by commands, in
FOLDER; what is there already is used again.
"""

import argparse
import shutil
from pathlib import Path

import numpy as np
from table import automos

from automos import open_sequence
from automos.evaluation.report import evaluate_folder

WORLDS = {"city": 201, "avenue": 202, "junction": 203, "campus": 204, "motorway": 205, "scooters": 206}
"""Scenarios of the six worlds, and their seeds."""
HELD_OUT = ("avenue", 212)
SENSOR, SCANS = "HDL-64E", 40
SIZES = {
    "image.height": 32,
    "image.width": 512,
    "model.channels": 8,
    "model.dropout": 0.1,
    "training.batch": 4,
    "training.learning_rate": 0.004,
    "training.validation_scans": 40,
}
"""The narrow network on small images: one core trains it."""


def world(folder: Path, scenario: str, seed: int) -> Path:
    """Return a simulated recording with its truth."""
    place = folder / f"{scenario}_{seed}"
    if not place.exists():
        automos("simulate", place, "--sensor", SENSOR, "--scenario", scenario, "--scans", SCANS, "--seed", seed)
    return place


def labelled(folder: Path, recording: Path) -> Path:
    """Return the results of a recording."""
    run = folder / "runs" / recording.name
    if not run.exists():
        automos("label", recording, "--out", run, "--workers", 1)
    return run


def with_shuffled_labels(data: Path) -> Path:
    """Return a copy of a data set in which each scan has its labels in an order of chance."""
    copy = data.with_name(f"{data.name}_shuffled")
    if not copy.exists():
        shutil.copytree(data, copy)
        for k, path in enumerate(sorted(copy.glob("sequences/*/labels/*.label"))):
            labels = np.fromfile(path, np.uint32)
            np.random.default_rng(k).permutation(labels).tofile(path)
    return copy


def score(data: Path, held_out: Path, epochs: int, samples: int) -> float:
    """Return the IoU of the moving class, in per cent, of what learnt from `data` on a world that it did not see."""
    network, *sequences = data.with_name(f"{data.name}_network"), *sorted((data / "sequences").iterdir())
    sizes = SIZES | {"training.epochs": epochs, "training.samples": samples, "training.keep": [epochs]}
    options = [word for name, value in sizes.items() for word in ("--set", f"network.{name}={value}")]
    sources = [word for sequence in sequences for word in ("--data", sequence)]
    automos("train", *sources, "--out", network, "--device", "cpu", *options)
    found, last = data.with_name(f"{data.name}_found"), network / "epochs" / f"{epochs:03d}.pt"
    # the network after all epochs: of shuffled labels none is better, and the best by chance is the one hardly trained
    automos("segment", held_out, "--method", "lmnet", "--weights", last, "--out", found, *options)
    return 100.0 * evaluate_folder(found / "predictions", open_sequence(held_out)).counts.scores.iou


def main() -> None:
    """Print both scores; end with 1 where the first is below 40 or the second is not below 10."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--epochs", type=int, default=12)
    parser.add_argument("--samples", type=int, default=160)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    recordings = [*given.recordings, *(world(given.folder, *one) for one in WORLDS.items())]
    runs = [labelled(given.folder, recording) for recording in recordings]
    data = given.folder / "set"
    automos("dataset", *runs, "--out", data, "--layout", "semantickitti")
    held_out = world(given.folder, *HELD_OUT)
    scores = [score(one, held_out, given.epochs, given.samples) for one in (data, with_shuffled_labels(data))]
    print("learnt from the labels: IoU {:.1f}; from shuffled ones: {:.1f}".format(*scores))
    raise SystemExit(not scores[0] >= 40.0 > 10.0 > scores[1])


if __name__ == "__main__":
    main()
