"""Renumbered recordings without times: put in order by what the scans saw, and left alone where nothing tells."""

from pathlib import Path

import numpy as np
import pytest

from automos.readers import open_sequence
from automos.readers.time_order import find_renumbering

N = 45


def drive(speed: float, n: int = N, seed: int = 0) -> list[np.ndarray]:
    """Return `n` scans (M, 3) metres, of house fronts; the sensor goes `speed` m a scan along x."""
    rng = np.random.default_rng(seed)
    along, height = (grid.ravel() for grid in np.meshgrid(np.arange(0.0, 8.0, 0.4), np.arange(-1.5, 4.0, 0.5)))
    corners = rng.uniform([-60.0, -25.0], [n * speed + 60.0, 25.0], (60, 2))
    fronts = [np.column_stack([x + along, np.full_like(along, y), height]) for x, y in corners]
    things = np.concatenate(fronts)
    scans = []
    for k in range(n):
        points = things - [k * speed, 0.0, 0.0] + rng.normal(0.0, 0.02, things.shape)
        scans.append(points[np.linalg.norm(points[:, :2], axis=1) < 50.0].astype(np.float32))
    return scans


def alphabetical(n: int, start: int = 0) -> np.ndarray:
    """Return (n,) which scan bears each number after renumbering."""
    return np.array(sorted(range(n), key=lambda k: str(k + start)))


@pytest.mark.parametrize("start", [0, 1])
@pytest.mark.parametrize("speed", [0.3, 2.0])
def test_scans_renumbered_by_the_alphabet_are_put_in_order(speed, start):
    scans, renumbered = drive(speed), alphabetical(N, start)
    order = find_renumbering(N, lambda k: scans[renumbered[k]])
    assert order is not None
    np.testing.assert_array_equal(renumbered[order], range(N))


@pytest.mark.parametrize("speed", [0.0, 0.3, 2.0])
def test_scans_in_order_are_left_alone(speed):
    scans = drive(speed)
    assert find_renumbering(N, scans.__getitem__) is None


def test_scans_of_which_some_are_missing_are_left_alone():
    scans = [scan for k, scan in enumerate(drive(1.0, 60)) if k % 7 and not 20 < k < 30]
    assert find_renumbering(len(scans), scans.__getitem__) is None


def test_scans_without_points_say_nothing_of_their_order():
    nothing = np.zeros((0, 3), np.float32)
    assert find_renumbering(N, lambda k: nothing) is None
    scans, renumbered = drive(1.0), alphabetical(N)
    order = find_renumbering(N, lambda k: nothing if k == 3 else scans[renumbered[k]])
    assert order is not None
    np.testing.assert_array_equal(renumbered[order], range(N))


def test_a_long_recording_costs_no_more_than_a_short_one():
    asked = []

    def points_of(k: int) -> np.ndarray:
        asked.append(k)
        return np.zeros((0, 3), np.float32)

    find_renumbering(5000, points_of)
    assert len(asked) == len(set(asked)) < 100


def write(folder: Path, scans: list[np.ndarray]) -> None:
    folder.mkdir()
    for k, scan in enumerate(scans):
        np.column_stack([scan, np.zeros(len(scan))]).astype(np.float32).tofile(folder / f"{k:06d}.bin")


def test_a_folder_of_renumbered_scans_is_opened_in_order_and_says_so(tmp_path):
    renumbered = alphabetical(N)
    write(tmp_path / "log", [drive(1.0)[k] for k in renumbered])
    sequence = open_sequence(tmp_path / "log")
    assert sequence.names[:4] == ["000000", "000001", "000012", "000023"]  # what was measured as scans 0, 1, 2, 3
    assert len(sequence.warnings) == 1
    assert "scan 000012 comes after 000001" in sequence.warnings[0]
    (tmp_path / "log" / "times.txt").write_text("".join(f"{0.1 * k:.1f}\n" for k in range(N)))
    assert open_sequence(tmp_path / "log").names == [f"{k:06d}" for k in range(N)]  # times are believed


@pytest.mark.parametrize("name", ["kitti_0005", "kitti_0027"])
def test_real_drives_are_left_alone_and_their_renumbered_copies_put_in_order(recordings, name):
    files = sorted((recordings / "sequences" / name / "velodyne").glob("*.bin"))
    n, renumbered = len(files), alphabetical(len(files))

    def points_of(k: int) -> np.ndarray:
        return np.fromfile(files[k], np.float32).reshape(-1, 4)[:, :3]

    assert find_renumbering(n, points_of) is None
    order = find_renumbering(n, lambda k: points_of(renumbered[k]))
    assert order is not None
    np.testing.assert_array_equal(renumbered[order], range(n))
