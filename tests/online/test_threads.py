"""What is given back depends on no thread: whether each has its turn at once, or only when its result is asked for."""

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import pytest
from worlds import lane

from automos import labeler
from automos.core.labels import Label
from automos.odometry import background

SCANS = list(lane(20).sequence)


class AtOnce(ThreadPoolExecutor):
    def submit(self, function, /, *args, **kwargs):
        done = Future()
        done.set_result(function(*args, **kwargs))
        return done


class WhenAsked(ThreadPoolExecutor):
    def submit(self, function, /, *args, **kwargs):
        return _Later(lambda: function(*args, **kwargs))


class _Later(Future):
    def __init__(self, function):
        super().__init__()
        self._function = function

    def result(self, timeout=None):
        if not self.done():
            self.set_result(self._function())
        return super().result(timeout)


def given_back(pool, lag, monkeypatch):
    for place in (labeler, background):
        monkeypatch.setattr(place, "ThreadPoolExecutor", pool)
    stream = labeler.Labeler(lag=lag)
    return [given for scan in SCANS for given in stream.push(scan)] + stream.finish()


@pytest.mark.parametrize("lag", [pytest.param(0.0, marks=pytest.mark.slow), 0.5])
def test_each_thread_may_come_first_or_last(lag, monkeypatch):
    first, last = (given_back(pool, lag, monkeypatch) for pool in (AtOnce, WhenAsked))
    assert any((given.labels == Label.MOVING).any() for given in first)
    for a, b in zip(first, last, strict=True):
        for name in ("pose", "labels", "track_ids", "confidence", "objects"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
