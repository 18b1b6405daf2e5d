"""What is at stake with each object is known from the tracking, without reading any scan."""

from dataclasses import replace

import numpy as np

from automos.readers import open_sequence
from automos.review.queue import weigh
from automos.review.run_stages import RunStages


def test_points_that_the_tracking_counted_are_those_of_all_scans(lane_run, monkeypatch):
    stages = RunStages(lane_run, open_sequence(lane_run.parent / "lane"))
    assert stages.objects.counts is not None
    uncounted = RunStages(lane_run, stages.frames.sequence)
    uncounted.objects = replace(stages.objects, counts=None)  # as runs of before, and those of the paper's method
    read = weigh(uncounted)
    monkeypatch.setattr(RunStages, "stage", None)
    counted = weigh(stages)
    assert counted.points.sum() > 1000
    assert len(counted.points) == len(stages.tracks)
    np.testing.assert_array_equal(counted.points, read.points)
    np.testing.assert_array_equal(counted.doubt, read.doubt)
