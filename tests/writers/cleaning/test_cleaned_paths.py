"""KISS-ICP on recordings without movers: no worse where it works, better in dense traffic."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from automos import simulation
from automos.results.open_run import open_run

pytest.importorskip("kiss_icp")


def change(recording, folder, starts):
    """Return what KISS-ICP's median errors (drift in per cent, RMSE in metres) gain without movers, and their share."""
    sys.path.insert(0, str(Path(__file__).parents[3]))
    from benchmarks.consumers.paths import compare

    words = [sys.executable, "-m", "automos", "label", str(recording), "--out", str(folder)]
    subprocess.run(words, check=True, capture_output=True)
    with_movers, without, left_out = compare(open_run(folder), starts)
    return *np.median(without - with_movers, axis=0), left_out


@pytest.mark.slow
def test_on_a_motorway_the_path_is_better_without_movers(tmp_path):
    world = simulation.simulate("motorway", "HDL-32E", n_scans=80, seed=5)
    simulation.write(world, tmp_path / "motorway")
    drift, rmse, left_out = change(tmp_path / "motorway", tmp_path / "run", starts=1)
    assert left_out > 0.02
    assert drift < 0.0
    assert rmse < 0.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [903, 906])
def test_in_dense_traffic_the_path_is_better_without_movers(tmp_path, seed):
    world = simulation.simulate("avenue", "HDL-64E", n_scans=80, seed=seed)
    simulation.write(world, tmp_path / "avenue")
    drift, rmse, left_out = change(tmp_path / "avenue", tmp_path / "run", starts=3)
    assert left_out > 0.1
    assert drift < 0.1
    assert rmse < 0.0


@pytest.mark.slow
@pytest.mark.recordings
def test_on_a_real_drive_the_path_is_no_worse(recordings, tmp_path):
    drift, rmse, _ = change(recordings / "sequences" / "kitti_0005", tmp_path / "run", starts=3)
    assert drift < 0.1
    assert rmse < 0.05
