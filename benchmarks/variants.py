"""What another method gains or loses with other parameters than those published: IoU on recordings with truth.

    python benchmarks/variants.py hmm_mos RECORDING [...] --change window=5 --change "window=5 min_sum=5" [--scans N]
    python benchmarks/variants.py m_detector RECORDING --change crossing.tolerance=0.05

Parameters are the fields of `automos.baselines.methods.published(METHOD)`, of a group after a dot. Poses are those of
the preset `default`, estimated once a recording.
"""

from __future__ import annotations

import argparse
import ast
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from robustness import Altered

from automos import load_settings, open_sequence
from automos.baselines import methods
from automos.core.labels import Label
from automos.core.scan import Sequence
from automos.evaluation.moving import Counts, count
from automos.odometry import estimate_trajectory
from automos.odometry.trajectory import SequenceFrames


def with_change(parameters: Any, change: str) -> Any:
    """Return `parameters`, a dataclass or a named tuple, with those of "name=value group.name=value" changed."""
    for item in change.split():
        path, _, value = item.partition("=")
        parameters = _replaced(parameters, path.split("."), ast.literal_eval(value))
    return parameters


def _replaced(group: Any, path: list[str], value: Any) -> Any:
    inner = _replaced(getattr(group, path[0]), path[1:], value) if len(path) > 1 else value
    return (
        dataclasses.replace(group, **{path[0]: inner})
        if dataclasses.is_dataclass(group)
        else group._replace(**{path[0]: inner})
    )


def score(method: str, parameters: Any, sequence: Sequence, trajectory: Any, settings: Any) -> Counts:
    """Return the counts of `method` with `parameters` on a recording."""
    frames, total = SequenceFrames(sequence, trajectory), Counts()
    before = methods.published
    methods.published = lambda name: parameters
    try:
        for i, is_moving in methods.BASELINES[method].find_moving(frames, trajectory.stamps, settings, 0):
            scan, truth = sequence[i], sequence.truth(i)
            labels = scan.is_valid.astype("uint8") * Label.STATIC
            labels[scan.is_valid] = is_moving * (Label.MOVING - Label.STATIC) + Label.STATIC
            total += count(labels, truth) if truth is not None else Counts()
    finally:
        methods.published = before
    return total


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("method", choices=[name for name in methods.BASELINES if name != "erasor"])
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--change", action="append", default=[], help='"name=value group.name=value"; repeatable')
    parser.add_argument("--scans", type=int, help="the first so many of each recording")
    arguments = parser.parse_args()
    settings, published = load_settings("default"), methods.published(arguments.method)
    for path in arguments.recordings:
        sequence = open_sequence(path)
        sequence = Altered(sequence, np.arange(len(sequence))[: arguments.scans])
        trajectory = estimate_trajectory(sequence, settings.odometry)
        for change in ("", *arguments.change):
            found = score(arguments.method, with_change(published, change), sequence, trajectory, settings).scores
            shown = f"{100 * found.iou:.1f} ({100 * found.precision:.1f} / {100 * found.recall:.1f})"
            Console().print(f"{path.name}, {change or 'as published'}: {shown}", markup=False, highlight=False)


if __name__ == "__main__":
    main()
