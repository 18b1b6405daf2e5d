"""Whatever a sensor sends, every scan comes back whole: in a process of its own, which must not crash."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from worlds import lane

import automos
from automos.core.errors import InputError

NUMBERS = (np.nan, np.inf, -np.inf, 0.0, 1e-45, 0.1, 100.0, 19_999.0, 1e9, 1e19, -1e19, 1e30, 3e38)
STAMPS = (0.0, 5e-324, 1.0 + 1e-9, 1e18, -1e300, np.nan, np.inf)


def hostile(rng, points):
    """Return an array that no sensor should send."""
    n, kind = len(points), rng.integers(8)
    if kind == 0:
        points[rng.random(n) < rng.choice([0.01, 0.9, 1.0])] = rng.choice(NUMBERS, 3)
    elif kind == 1:
        points[:, rng.integers(3)] = rng.choice(NUMBERS)
    elif kind == 2:
        points = np.tile(rng.choice(NUMBERS, 3), (int(rng.choice([1, 60, 1500])), 1))
    elif kind == 3:
        points = rng.uniform(-100.0, 100.0, (1500, 1)) * rng.normal(size=3)
    elif kind == 4:
        points = points[: rng.choice([0, 1, 49, 999])]
    elif kind == 5:
        points = points * rng.choice([1e-8, 1e-3, 1e3, 1e10])
    elif kind == 6:
        points = rng.integers(-100, 100, (1500, 3)).astype(rng.choice(["i1", "u1", "i8", "f2", ">f4", "?"]))
    return points


def push_all(seed):
    rng, labeler = np.random.default_rng(seed), automos.Labeler(lag=float(seed % 2) / 2.0)
    pushed, given, clean = [], [], [scan.points for scan in lane(6).sequence]
    for k in range(24):
        points = clean[k % len(clean)].copy()
        stamp = 0.1 * k if rng.random() < 0.7 else rng.choice(STAMPS)
        points = hostile(rng, points) if k > 3 and rng.random() < 0.6 else points
        try:
            with np.errstate(all="ignore"):
                given += labeler.push(points, stamp)
        except InputError:
            continue
        pushed.append(len(points))
    given += labeler.finish()
    assert [len(one.labels) for one in given] == pushed
    for one in given:
        assert np.isin(one.labels, list(automos.Label)).all()
        np.testing.assert_array_equal(one.confidence, np.clip(one.confidence, 0.0, 1.0))
        assert np.isfinite(one.pose).all()
        assert all(np.isfinite(one.objects[name]).all() for name in ("center", "size", "velocity"))


def test_hostile_scans_come_back_whole():
    here = Path(__file__)
    code = f"import sys; sys.path[:0] = {[str(here.parent), str(here.parent.parent)]!r}; "
    code += "import test_hostile_scans as hostile; [hostile.push_all(seed) for seed in range(4)]"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]


def test_stamps_that_numbers_cannot_tell_apart_are_no_times():
    labeler, scans = automos.Labeler(lag=0.0), [scan.points for scan in lane(12).sequence]
    given = [one for points in scans for one in labeler.push(points, 1e300)] + labeler.finish()
    assert [len(one.labels) for one in given] == [len(points) for points in scans]
    assert np.diff([one.stamp for one in given]) == pytest.approx(0.1)


@pytest.mark.parametrize("stamp", ["x", [1.0, 2.0], object()])
def test_a_stamp_that_is_no_number_is_told(stamp):
    with pytest.raises(InputError, match="a scan's stamp is seconds"):
        automos.Labeler(lag=0.0).push(np.ones((10, 3), np.float32), stamp)


@pytest.mark.parametrize("poses", ["x", [["a"]], object()])
def test_poses_that_are_no_numbers_are_told(poses):
    with pytest.raises(InputError, match="poses must be "):
        automos.label([np.ones((10, 3), np.float32)], poses=poses)
