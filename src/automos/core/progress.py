"""Progress of each stage: a bar with rate and remaining time, or lines if the output is not a terminal."""

from __future__ import annotations

import time
from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from automos.core.errors import plain


class _RateColumn(ProgressColumn):
    def __init__(self, counted: str):
        super().__init__()
        self._counted = counted

    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        if not speed:
            return Text("")
        return Text(f"{speed:.1f} {self._counted}/s" if speed >= 0.1 else f"{3600 * speed:.0f} {self._counted}/h")


LINE_EVERY = 5.0
"""Seconds between two lines on a stage, where there is no terminal."""


class StageProgress:
    """A callback (stage, done, total) that draws one bar per stage, or prints lines to a log; use as a context."""

    def __init__(self, console: Console, title: str, counted: str = "scans"):
        """Draw on `console`, under `title`; `counted` says what."""
        columns = (BarColumn(), MofNCompleteColumn(), _RateColumn(counted), TimeElapsedColumn(), TimeRemainingColumn())
        self._console, self._title, self._counted = console, plain(title), counted
        self._lines: dict[str, tuple[float, int, float]] = {}  # when and where a stage began, when a line was printed
        self._bars = Progress(TextColumn("{task.description}", markup=False), *columns, console=console)
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> StageProgress:
        if self._console.is_terminal:
            self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._console.is_terminal:
            self._bars.stop()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show that `done` of `total` scans of `stage` are done."""
        if not self._console.is_terminal:
            self._print(stage, done, total)
            return
        if stage not in self._tasks:
            self._tasks[stage] = self._bars.add_task(f"{self._title} {stage:<10}", total=total)
        self._bars.update(self._tasks[stage], completed=done)

    def _print(self, stage: str, done: int, total: int) -> None:
        now = time.monotonic()
        began, first, said = self._lines.setdefault(stage, (now, done, now))
        if done < total and now - said < LINE_EVERY:
            return
        self._lines[stage] = began, first, now
        left = (now - began) / (done - first) * (total - done) if first < done < total else 0.0
        line = f"{self._title} {stage}: {done} of {total} {self._counted}, {_words(now - began)}"
        line += f", about {_words(left)} left" * (left > 0.0)
        self._console.print(line, markup=False, highlight=False, soft_wrap=True)


def _words(seconds: float) -> str:
    """Return a time as a person says it."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"
