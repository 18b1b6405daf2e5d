"""A results folder of labels that are chosen, beside a recording that is on disk."""

import numpy as np

from automos.core.label_files import read_labels
from automos.readers import open_sequence
from automos.results.run_files import RunFiles


def labelled(folder, recording, format=None):
    """Return the run of a recording, labelled: of every five points the first moves, the second has no label."""
    sequence = open_sequence(recording, format)
    (folder / "predictions").mkdir(parents=True)
    for index, name in enumerate(sequence.names):
        labels = np.full(len(sequence[index]), 9, np.uint32)
        labels[::5], labels[1::5] = 251, 0
        labels.tofile(folder / "predictions" / f"{name}.label")
    return RunFiles(folder, sequence)


def moving(run, index):
    """Return (N,) which points of a scan move."""
    return read_labels(run.folder / "predictions" / f"{run.names[index]}.label", len(run.scan(index))) == 251
