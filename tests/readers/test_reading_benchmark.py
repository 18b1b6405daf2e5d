"""The benchmark of reading reads every point of what it writes."""

import sys
from pathlib import Path

import numpy as np
import pytest
from street_log import street_log

from automos.core.array_sequence import ArraySequence

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import reading


@pytest.mark.parametrize("heading", reading.FORMATS)
def test_what_the_benchmark_writes_is_read_whole(tmp_path, heading):
    scans = street_log(2).scans[:2]
    run = reading.Unlabelled(ArraySequence(scans, np.array([0.0, 0.1])))
    name, format, write = reading.FORMATS[heading]
    try:
        write(run, tmp_path / name)
        milliseconds, n_points = reading.measure(tmp_path / name, format, 1)
    except ImportError as error:
        pytest.skip(str(error))
    assert milliseconds > 0.0
    assert n_points == sum(map(len, scans))
