"""Time and memory that a method took on a recording, for each of its runs."""

import statistics
from dataclasses import dataclass
from pathlib import Path

from automos.core.reading import read_json

ALONE = 0.1
"""Processor cores that others may keep busy while something is timed; where more were, seconds are upper bounds."""


@dataclass(frozen=True)
class Cost:
    """Time and memory of a method, one value per run. Bytes, seconds and cores are nan if unknown.

    Attributes
    ----------
    seconds : list of float
        Per scan, by the clock.
    busy : list of float
        Per scan, seconds of processor time.
    memory : list of float
        Bytes, at most, of the process and its children with all their libraries.
    others : list of float
        Processor cores that other programs kept busy meanwhile.
    """

    seconds: list[float]
    busy: list[float]
    memory: list[float]
    others: list[float]

    @property
    def seconds_per_scan(self) -> float:
        """The median of the runs."""
        return statistics.median(self.seconds)

    @property
    def spread(self) -> float:
        """Seconds per scan between the fastest and the slowest run."""
        return max(self.seconds) - min(self.seconds)

    @property
    def peak_memory(self) -> float:
        """Bytes, the maximum over all runs."""
        return max(self.memory)

    @property
    def was_alone(self) -> bool:
        """Whether other programs used hardly any processor time."""
        return max(self.others) <= ALONE


def read_cost(file: Path, key: str) -> Cost | None:
    """Return the cost stored in `file` for a run with fingerprint `key`; None if there is none."""
    try:
        found = read_json(file)
        return Cost(**{name: found[name] for name in Cost.__annotations__}) if found["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError):  # damaged from outside: it is run again
        return None
