import numpy as np
import pytest

from automos.core.run import Run
from automos.core.workspace import Workspace

NAMES = ["a", "b", "c", "d"]


def make_run(workspace: Workspace, key: str = "k", progress=None) -> Run:
    return Run(workspace, {"odometry": key, "labels": key}, NAMES, progress)


@pytest.fixture(params=["memory", "folder"])
def workspace(request, tmp_path):
    """Return a workspace of each kind."""
    return Workspace(tmp_path if request.param == "folder" else None)


class Maker:
    """Makes results of scans, keeps count, and breaks before scan `breaks_at`."""

    def __init__(self, breaks_at: int = 99):
        self.made: list[int] = []
        self.breaks_at = breaks_at

    def __call__(self, missing: list[int]):
        for i in missing:
            if i == self.breaks_at:
                raise KeyboardInterrupt
            self.made.append(i)
            yield i, {"square": np.array(i * i)}


def test_a_stage_of_the_whole_recording_is_made_once(workspace):
    calls = []

    def make(tick):
        calls.append(1)
        return {"x": np.arange(3)}

    for _ in range(2):
        np.testing.assert_array_equal(make_run(workspace).once("odometry", make)["x"], [0, 1, 2])
    assert len(calls) == 1


def test_a_stage_of_every_scan_is_made_once(workspace):
    maker = Maker()
    for _ in range(2):
        stage = make_run(workspace).each("labels", maker)
    assert maker.made == [0, 1, 2, 3]
    assert [int(stage.load(name)["square"]) for name in NAMES] == [0, 1, 4, 9]


def test_an_interrupted_stage_goes_on_with_the_scans_that_are_missing(workspace):
    first, second = Maker(breaks_at=2), Maker()
    with pytest.raises(KeyboardInterrupt):
        make_run(workspace).each("labels", first)
    stage = make_run(workspace).each("labels", second)
    assert (first.made, second.made) == ([0, 1], [2, 3])
    assert all(map(stage.has, NAMES))


def test_results_of_other_settings_are_never_read(workspace):
    old, new = Maker(), Maker()
    make_run(workspace, "k").each("labels", old)
    make_run(workspace, "other").each("labels", new)
    assert new.made == [0, 1, 2, 3]


def test_progress_counts_the_scans_that_were_there(workspace):
    ticks = []

    def progress(*tick):
        ticks.append(tick)

    with pytest.raises(KeyboardInterrupt):
        make_run(workspace, progress=progress).each("labels", Maker(breaks_at=2))
    assert ticks == [("labels", 1, 4), ("labels", 2, 4)]
    ticks.clear()
    make_run(workspace, progress=progress).each("labels", Maker())
    assert ticks == [("labels", 3, 4), ("labels", 4, 4)]


def test_progress_of_a_whole_stage_is_passed_on_under_its_name(workspace):
    ticks = []

    def make(tick):
        tick(3, 4)
        return {"x": np.zeros(1)}

    make_run(workspace, progress=lambda *tick: ticks.append(tick)).once("odometry", make)
    assert ticks == [("odometry", 3, 4)]


def test_a_stage_takes_time_only_when_it_is_made(workspace):
    run = make_run(workspace)
    run.each("labels", Maker())
    assert run.seconds["labels"] > 0.0
    assert run.seconds["odometry"] == 0.0
    again = make_run(workspace)
    again.each("labels", Maker())
    assert again.seconds["labels"] == 0.0


def test_memory_goes_back_after_each_stage_that_is_made(workspace, monkeypatch):
    calls = []
    monkeypatch.setattr("automos.core.run.return_memory", lambda: calls.append(1))
    for expected in (2, 2):  # what is there already is not made
        run = make_run(workspace)
        run.once("odometry", lambda tick: {"x": np.arange(3)})
        run.each("labels", Maker())
        assert len(calls) == expected
