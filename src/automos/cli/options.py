"""Arguments and options that several commands share, each with one name and one help text."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Recording = Annotated[Path, typer.Argument(help="a folder of scans, a data set, a bag: see automos formats")]
Format = Annotated[str | None, typer.Option("--format", help="the recording's format, where guessing fails")]
Preset = Annotated[str, typer.Option(help="paper: as the seed paper; default: the best we know")]
SettingsFile = Annotated[Path | None, typer.Option("--settings", help="YAML file of settings that differ")]
Overrides = Annotated[
    list[str] | None, typer.Option("--set", help="one setting, e.g. tracking.max_misses=3; repeatable")
]
Poses = Annotated[Path | None, typer.Option(help="poses to use instead of odometry: KITTI or TUM file")]
Calib = Annotated[Path | None, typer.Option(help="calib.txt with Tr:, if the poses are the camera's")]
Workers = Annotated[int, typer.Option(min=0, help="processes; 0: one per core")]
