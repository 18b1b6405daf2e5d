"""The simulated stand-ins for the paper's data sets: which worlds are trained on, chosen by, and scored on.

Domain K takes KITTI's place (HDL-64E, European streets), domain A that of Apollo (another sensor on another roof, hills
and a market of scooters); S, of many sensors, is what the network that comes along learns from. Seeds of the parts
never meet, nor those on which the labeler's settings were chosen (0-9).
"""

from dataclasses import dataclass
from pathlib import Path

from automos.core.run import Progress, silent
from automos.core.scan import Sequence
from automos.readers import open_sequence


@dataclass(frozen=True)
class Part:
    """Recordings that serve one purpose: each a scenario, a sensor and a seed."""

    worlds: tuple[tuple[str, str, int], ...]
    scans: int = 60


@dataclass(frozen=True)
class Domain:
    """One data set: `validation` chooses the epoch; `test` is only scored; `extra` has no manual labels."""

    train: Part
    validation: Part
    test: Part
    extra: Part = Part(())


def _of_one_sensor(sensor: str, text: str) -> Part:
    """Return worlds ("city", sensor, 30), ("city", sensor, 31) for "city 30 31"; groups are separated by commas."""
    groups = [group.split() for group in text.split(",")]
    return Part(tuple((scenario, sensor, int(seed)) for scenario, *seeds in groups for seed in seeds))


_STREETS = ("city", "motorway", "junction", "campus", "scooters", "hills", "narrow", "canyon", "avenue", "country")
_SENSORS = ("HDL-64E", "OS1-64", "VLS-128", "HDL-64E", "HDL-32E", "HDL-64E-5Hz", "OS1-128", "HDL-64E", "VLP-16")


def _of_many_sensors(numbers: range, seed: int) -> Part:
    """Return worlds of domain S: with each the next street and the next sensor, and every time round another seed."""
    n, m = len(_STREETS), len(_SENSORS)
    return Part(tuple((_STREETS[k % n], _SENSORS[k % m], seed + k // n) for k in numbers), 25)


DOMAINS = {
    "K": Domain(
        _of_one_sensor("HDL-64E", "city 30 31, junction 30, avenue 30, campus 30"),
        _of_one_sensor("HDL-64E", "city 40, junction 40"),
        _of_one_sensor("HDL-64E", "city 50 51, junction 50, avenue 50"),
        _of_one_sensor("HDL-64E", "city 32 33 34, junction 31 32, avenue 31 32, campus 31, slowdown 31, narrow 31"),
    ),
    "A": Domain(
        _of_one_sensor("OS1-64", "scooters 30 31, hills 30 31, slowdown 30"),
        _of_one_sensor("OS1-64", "scooters 40, hills 40"),
        _of_one_sensor("OS1-64", "scooters 50, hills 50, slowdown 50"),
    ),
    "S": Domain(
        _of_many_sensors(range(60), 320), _of_many_sensors(range(9), 340), _of_many_sensors(range(20, 29), 350)
    ),
}


def write_part(part: Part, folder: Path, progress: Progress = silent, workers: int = 0) -> list[Sequence]:
    """Return the recordings of `part`, written below `folder` with their truth unless they are there already."""
    from automos.simulation import simulate, write

    recordings = []
    for scenario, sensor, seed in part.worlds:
        world = simulate(scenario, sensor, part.scans, seed)
        recordings.append(open_sequence(write(world, folder / world.name, workers, progress)))
    return recordings
