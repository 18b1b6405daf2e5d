"""Progress bars with rate and time left, one a stage."""

from __future__ import annotations

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


class _RateColumn(ProgressColumn):
    def __init__(self, counted: str):
        super().__init__()
        self._counted = counted

    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        if not speed:
            return Text("")
        return Text(f"{speed:.1f} {self._counted}/s" if speed >= 0.1 else f"{3600 * speed:.0f} {self._counted}/h")


class StageProgress:
    """A callback (stage, done, total) that draws one bar per stage; use as a context."""

    def __init__(self, console: Console, title: str, counted: str = "scans"):
        """Draw on `console`, under `title`; `counted` says what."""
        columns = (BarColumn(), MofNCompleteColumn(), _RateColumn(counted), TimeElapsedColumn(), TimeRemainingColumn())
        self._title = title
        self._bars = Progress(TextColumn("{task.description}", markup=False), *columns, console=console)
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> StageProgress:
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bars.stop()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show that `done` of `total` scans of `stage` are done."""
        if stage not in self._tasks:
            self._tasks[stage] = self._bars.add_task(f"{self._title} {stage:<10}", total=total)
        self._bars.update(self._tasks[stage], completed=done)
