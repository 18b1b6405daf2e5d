"""The simulated stand-ins for the paper's data sets: which worlds are trained on, chosen by, and scored on.

Domain K takes KITTI's place (HDL-64E, European streets), domain A that of Apollo (another sensor on another roof, hills
and a market of scooters). Seeds of the parts never meet, nor those on which the labeler's settings were chosen (0-9).
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from automos.core.scan import Sequence
from automos.readers import open_sequence

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Part:
    """Recordings that serve one purpose: each a scenario and a seed."""

    worlds: tuple[tuple[str, int], ...]
    sensor: str
    scans: int = 60


@dataclass(frozen=True)
class Domain:
    """One data set: `extra` has no manual labels; `validation` chooses the epoch; `test` is only scored."""

    name: str
    train: Part
    extra: Part
    validation: Part
    test: Part


def _domain(name: str, sensor: str, *parts: str) -> Domain:
    return Domain(name, *(Part(tuple(_worlds(part)), sensor) for part in parts))


def _worlds(text: str) -> list[tuple[str, int]]:
    """Return ("city", 30), ("city", 31) for "city 30 31"; groups are separated by commas."""
    groups = [group.split() for group in text.split(",") if group.strip()]
    return [(scenario, int(seed)) for scenario, *seeds in groups for seed in seeds]


DOMAINS = {
    "K": _domain(
        "K",
        "HDL-64E",
        "city 30 31, junction 30, avenue 30, campus 30",
        "city 32 33 34, junction 31 32, avenue 31 32, campus 31, slowdown 31, narrow 31",
        "city 40, junction 40",
        "city 50 51, junction 50, avenue 50",
    ),
    "A": _domain(
        "A",
        "OS1-64",
        "scooters 30 31, hills 30 31, slowdown 30",
        "",
        "scooters 40, hills 40",
        "scooters 50, hills 50, slowdown 50",
    ),
}


def write_part(part: Part, folder: Path, progress: Progress | None = None, workers: int = 0) -> list[Sequence]:
    """Return the recordings of `part`, written below `folder` with their truth unless they are there already."""
    from automos.simulation import simulate, write

    recordings = []
    for scenario, seed in part.worlds:
        world = simulate(scenario, part.sensor, part.scans, seed)
        recordings.append(open_sequence(write(world, folder / world.name, workers, progress)))
    return recordings
