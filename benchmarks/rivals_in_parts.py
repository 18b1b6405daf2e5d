"""M-detector and HMM-MOS on parts of recordings: at low speed, at high speed, in dense traffic, and with less of it.

    AUTOMOS_RECORDINGS=folder python benchmarks/rivals_in_parts.py --store FOLDER --out FOLDER [--cases NAME ...]
                                                                   [--json FILE]

Drive 0005 is scored in the view that has truth, drive 0027 (11 to 22 m/s), which has none, against the labels of the
preset `default`, made in the folder of --out where they are not there yet; `avenue` is a simulated world, kept in that
of --store. Poses are those of `default`.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import takewhile
from pathlib import Path

import numpy as np
import numpy.typing as npt
from rich.console import Console
from scores import ratios_of
from store import real_drive, stored_world

from automos import load_settings
from automos.baselines import hmm_mos, m_detector
from automos.baselines.m_detector_parameters import KITTI
from automos.core.labels import Label
from automos.core.scan import Mask, Sequence
from automos.evaluation.moving import Counts, count
from automos.labeling import label_recording
from automos.odometry import estimate_trajectory
from automos.odometry.trajectory import SequenceFrames
from automos.results.open_run import open_run

PARTS = {
    "kitti_0005, first 30 scans": ("kitti_0005", range(30)),
    "kitti_0005, last 26": ("kitti_0005", range(128, 154)),
    "kitti_0027, first 40": ("kitti_0027", range(40)),
    "`avenue`, scans 16 to 33": ("avenue", range(16, 34)),
}
WORLD = ("avenue", "HDL-64E", 40, 4)
"""Scenario, sensor, scans and seed of the simulated world."""
WITHOUT = replace(KITTI, edge=0.0, crossing=KITTI.crossing._replace(surface=-math.inf))
"""M-detector without interpolation, and with the edges of its view."""

Found = Iterator[tuple[int, Mask]]


def runs(sequence: Sequence) -> dict[str, Callable[[int], Found]]:
    """Return what finds moving points of a recording from a scan on, by name."""
    settings = load_settings("default")
    trajectory = estimate_trajectory(sequence, settings.odometry)
    frames, stamps, ground = SequenceFrames(sequence, trajectory), trajectory.stamps, settings.candidates.ground
    return {
        "M-detector": lambda start: m_detector.find_moving(frames, KITTI, stamps, ground, start),
        "M-detector, without interpolation and `edge`": lambda start: m_detector.find_moving(
            frames, WITHOUT, stamps, ground, start
        ),
        "HMM-MOS": lambda start: hmm_mos.find_moving(frames, hmm_mos.Parameters(), start),
    }


def scored(sequence: Sequence, found: Found, scans: range, truth: Callable[[int], npt.NDArray]) -> dict:
    """Return IoU, precision and recall over some scans, None for what is not defined, and the false points."""
    counts = Counts()
    for i, is_moving in takewhile(lambda each: each[0] < scans.stop, found):
        labels = np.full(len(sequence[i]), Label.UNLABELED, np.uint8)
        labels[sequence[i].is_valid] = np.where(is_moving, Label.MOVING, Label.STATIC)
        counts += count(labels, truth(i))
    return ratios_of(counts) | {"false": counts.scores.false_dynamic}


def opened(name: str, store: Path, out: Path) -> tuple[Sequence, Callable[[int], npt.NDArray]]:
    """Return a recording, and what its scans are scored by: truth, or labels of the preset `default`."""
    if name == WORLD[0]:
        world = stored_world(store, *WORLD)
        return world, world.truth
    sequence = real_drive(name)
    if sequence.truth(0) is not None:
        return sequence, sequence.truth
    label_recording(sequence, out / name, load_settings("default"))
    run = open_run(out / name)
    return sequence, lambda i: run.labels(i, len(sequence[i]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--cases", nargs="+", choices=list(PARTS), default=list(PARTS), metavar="NAME")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    result: dict[str, dict] = {}
    for case in arguments.cases:
        name, scans = PARTS[case]
        sequence, truth = opened(name, arguments.store, arguments.out)
        for title, find in runs(sequence).items():
            result.setdefault(title, {})[case] = row = scored(sequence, find(scans.start), scans, truth)
            Console().print(title, case, row, markup=False)
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
