"""What stages found is only shown on the points that it was found of."""

import shutil

import numpy as np
import pytest

from automos.core.errors import InputError
from automos.readers import open_sequence
from automos.results.open_run import open_run
from automos.results.run_files import RunFiles
from automos.review.run_stages import RunStages


@pytest.mark.parametrize("change", ["cut short", "other points of no use"])
def test_a_scan_that_has_changed_since_it_was_labelled_is_told(lane_run, tmp_path, change):
    recording = shutil.copytree(lane_run.parent / "lane", tmp_path / "lane")
    scan = recording / "velodyne" / "000004.bin"
    points = np.fromfile(scan, "<f4")
    points[: len(points) // 8] = 0.0
    (points if change != "cut short" else points[: len(points) // 8 * 4]).tofile(scan)
    run, files = open_run(lane_run, recording), RunFiles(lane_run, open_sequence(recording))
    for look in (lambda: RunStages(lane_run, run.sequence).frame(4), lambda: files.is_ground(files.scan(4), 4)):
        with pytest.raises(InputError, match=r"scan 000004 has \d+ points of use and had \d+ when it was labelled"):
            look()


@pytest.mark.parametrize("stage", ["odometry", "candidates", "instances", "tracking", "labels"])
def test_a_stage_in_which_numbers_were_changed_is_told_by_its_file(lane_run, tmp_path, stage):
    run = shutil.copytree(lane_run, tmp_path / "run")
    for path in run.glob(f"stages/{stage}-*/*.npz"):
        with np.load(path) as file:
            arrays = dict(file)
        np.savez(path, **{name: array + 1 if array.dtype.kind in "iuf" else array for name, array in arrays.items()})
    sequence = open_sequence(lane_run.parent / "lane")
    with pytest.raises(InputError, match=rf"stages/{stage}-\w+/\w+\.npz is damaged .* automos label"):
        _ = (RunStages(run, sequence).frame(4), RunStages(run, sequence).owner_of_points(4))
