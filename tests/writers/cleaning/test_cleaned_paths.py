"""KISS-ICP on recordings without movers: no worse where it works, better where traffic leads it astray."""

import subprocess
import sys
from pathlib import Path

import pytest

from automos import simulation
from automos.results.open_run import open_run

pytest.importorskip("kiss_icp")


def errors(recording, folder):
    """Return KISS-ICP's errors (drift in per cent, RMSE in metres) with movers and without, as the benchmark does."""
    sys.path.insert(0, str(Path(__file__).parents[3]))
    from benchmarks.consumers.paths import compare

    words = [sys.executable, "-m", "automos", "label", str(recording), "--out", str(folder)]
    subprocess.run(words, check=True, capture_output=True)
    return compare(open_run(folder))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 6])
def test_on_a_motorway_the_path_is_better_without_movers(tmp_path, seed):
    world = simulation.simulate("motorway", "HDL-32E", n_scans=80, seed=seed)
    simulation.write(world, tmp_path / "motorway")
    (drift, rmse), (drift_without, rmse_without), left_out = errors(tmp_path / "motorway", tmp_path / "run")
    assert left_out > 0.02
    assert drift_without < drift
    assert rmse_without < rmse


@pytest.mark.slow
@pytest.mark.recordings
def test_on_a_real_drive_the_path_is_no_worse(recordings, tmp_path):
    place = recordings / "sequences" / "kitti_0005"
    (drift, rmse), (drift_without, rmse_without), _ = errors(place, tmp_path / "run")
    assert drift_without < drift + 0.1
    assert rmse_without < rmse + 0.05
