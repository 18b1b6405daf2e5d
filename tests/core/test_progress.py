"""How far a stage is, where there is a terminal and where there is none."""

import io

import pytest
from rich.console import Console

from automos.core import progress
from automos.core.progress import LINE_EVERY, StageProgress


@pytest.fixture
def clock(monkeypatch):
    """Return a list whose only item is the time."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def told(console_is_terminal, clock, seconds_per_scan) -> str:
    said = io.StringIO()
    with StageProgress(Console(file=said, force_terminal=console_is_terminal, width=100), "log") as tell:
        for stage in ("odometry", "labels"):
            for done in range(1, 11):
                clock[0] += seconds_per_scan
                tell(stage, done, 10)
    return said.getvalue()


def test_without_a_terminal_each_stage_is_a_line_when_it_ends(clock):
    assert told(False, clock, 0.01).splitlines() == [
        "log odometry: 10 of 10 scans, 0 s",
        "log labels: 10 of 10 scans, 0 s",
    ]


def test_without_a_terminal_a_long_stage_is_a_line_every_few_seconds(clock):
    lines = told(False, clock, LINE_EVERY / 2.5).splitlines()
    assert [line.split(",")[0] for line in lines[:4]] == [
        *(f"log odometry: {done} of 10 scans" for done in (4, 7, 10)),
        "log labels: 4 of 10 scans",
    ]


def test_a_terminal_has_bars(clock):
    assert "━" in told(True, clock, 0.01)
