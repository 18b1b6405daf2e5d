"""A simulated bag with an IMU, as it is and without movers: rko-lio's path in both, and what evalio reads."""

import subprocess
import sys

import numpy as np
import pytest

from automos import simulation
from automos.core.geometry import inverse
from automos.readers import open_sequence
from automos.results.run_files import RunFiles
from automos.simulation.write import GRAVITY, RATE, inertial
from automos.writers.cleaning.clean import clean

N_SCANS = 25


@pytest.fixture(scope="module")
def world():
    return simulation.simulate("campus", "VLP-16", n_scans=N_SCANS, seed=31)  # slow: rko-lio begins at rest


@pytest.fixture(scope="module")
def rko_lio():
    """Skip before bags are made where the program is not installed."""
    pytest.importorskip("rko_lio", reason="pip install rko-lio, in an environment of its own")


@pytest.fixture(scope="module")
def loaders():
    """Return evalio's loaders; skip before bags are made where they are not installed."""
    return pytest.importorskip("evalio.datasets.loaders", reason="pip install evalio, in an environment of its own")


@pytest.fixture(scope="module")
def bags(world, tmp_path_factory):
    """Return the folders of the bag and of the same without what truly moves."""
    pytest.importorskip("rosbags")
    folder = tmp_path_factory.mktemp("inertial")
    simulation.write(world, folder / "world", bag=True)
    sequence = open_sequence(folder / "world" / "bag")
    (folder / "run" / "predictions").mkdir(parents=True)
    for index, name in enumerate(sequence.names):
        world.truth(index)[world[index].is_valid].tofile(folder / "run" / "predictions" / f"{name}.label")
    cleaned, n_points, n_left_out = clean(RunFiles(folder / "run", sequence), folder / "cleaned")
    assert 0.0005 * n_points < n_left_out < 0.2 * n_points
    return folder / "world" / "bag", cleaned


def test_the_imu_measures_what_turns_and_holds_the_sensor(world):
    times = np.arange(100, 1900) / 1000.0
    turns, force = inertial(world, times)
    poses = world.poses_at(times)
    T = poses[0]  # integrated, the measurements lead to where the sensor is
    velocity = (world.poses_at(times[0] + 1e-4) - world.poses_at(times[0] - 1e-4))[:3, 3] / 2e-4
    place, R = T[:3, 3].copy(), T[:3, :3].copy()
    down = -GRAVITY * world.T_level_world[2, :3]
    for turn, pull in zip(turns[:-1], force[:-1], strict=True):
        acceleration = R @ pull + down
        place += 1e-3 * velocity + 0.5e-6 * acceleration
        velocity += 1e-3 * acceleration
        x, y, z = 1e-3 * turn
        R = R @ np.array([[1, -z, y], [z, 1, -x], [-y, x, 1]])
    np.testing.assert_allclose(place, poses[-1][:3, 3], atol=0.1)
    np.testing.assert_allclose(R, poses[-1][:3, :3], atol=5e-3)


@pytest.mark.slow
def test_without_movers_the_imu_is_there_byte_for_byte(bags):
    from rosbags.highlevel import AnyReader

    found = []
    for bag in bags:
        with AnyReader([bag]) as reader:
            found.append([(c.topic, time, raw) for c, time, raw in reader.messages() if c.topic != "/points"])
    assert found[0] == found[1]
    assert sum(topic == "/imu" for topic, *_ in found[0]) == pytest.approx(N_SCANS * 0.1 * RATE, abs=2)


def test_rko_lio_finds_the_path_in_both_and_none_the_worse_without_movers(rko_lio, world, bags, tmp_path):
    off = []
    for k, bag in enumerate(bags):
        words = ["from rko_lio.cli import app; app()", str(bag), "--log_dir", str(tmp_path / str(k))]
        subprocess.run([sys.executable, "-c", *words], check=True, capture_output=True, timeout=300)
        (path,) = (tmp_path / str(k)).glob("*/*_tum.txt")
        rows = np.loadtxt(path)
        assert len(rows) >= N_SCANS - 2
        true = world.poses_at(rows[:, 0] - rows[0, 0] + 0.5 * world.period)
        moved = np.linalg.norm((inverse(true[0]) @ true)[-1, :3, 3])
        found = np.linalg.norm(rows[-1, 1:4] - rows[0, 1:4])
        off.append(abs(found - moved))
        assert off[-1] < 0.03 * moved
    assert off[1] < off[0] + 0.05


def test_evalio_iterates_over_both_with_fewer_points_without_movers(loaders, bags):
    from evalio.types import ImuMeasurement, LidarMeasurement, LidarParams

    counts = []
    for bag in bags:
        of_sensor = LidarParams(num_rows=16, num_columns=1824, min_range=0.5, max_range=100.0)
        measured = list(loaders.RosbagIter(bag, "/points", "/imu", of_sensor))
        scans = [each for each in measured if isinstance(each, LidarMeasurement)]
        assert len(scans) == N_SCANS
        assert sum(isinstance(each, ImuMeasurement) for each in measured) > 450
        counts.append(sum(np.linalg.norm(scan.to_vec_positions(), axis=1).astype(bool).sum() for scan in scans))
    assert 0.8 * counts[0] < counts[1] < counts[0]
