"""The recordings of a data set: what each is called in it, which split it is in, and which sensor it is of."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from automos.core.arrays import evenly_spread
from automos.core.beam_pattern import learn_pattern
from automos.core.errors import InputError
from automos.core.workspace import Workspace
from automos.results.run_files import RunFiles
from automos.writers.training.scans import ImageSensor, full_scale_of, measure_sensor
from automos.writers.training.trainer_files import SPLITS

FIRST_NUMBER = 50
"""Of the sequences: trainers come with lists of the scans to leave out of KITTI's, which have the numbers below."""
_SHOWN = 5
"""Scans by which a sensor is known."""


@dataclass(frozen=True, eq=False)
class Member:
    """A run in a data set.

    Attributes
    ----------
    run : RunFiles
    number : int
        Of its sequence, from 50 on.
    name : str
        Of the recording, as a folder is called that trainers find by a pattern; with the number where others have it.
    split : str
        One of `SPLITS`.
    full_scale : float
        The intensity that becomes 1.
    sensor : ImageSensor
        The same for all recordings of one kind of sensor.
    """

    run: RunFiles
    number: int
    name: str
    split: str
    full_scale: float
    sensor: ImageSensor

    def about(self) -> dict[str, Any]:
        """Return what identifies it, for the manifest."""
        run = Workspace(self.run.folder).read_run()
        return {
            "sequence": self.number,
            "name": self.name,
            "split": self.split,
            "run": str(self.run.folder.absolute()),
            "recording": run.get("recording", {}).get("source"),
            "labels": run.get("fingerprint"),
        }


def members_of(runs: Sequence[RunFiles], splits: Mapping[str, str]) -> list[Member]:
    """Return the members that `runs` are, numbered in their order.

    splits : split by name of recording; those not named are for training.

    Raises
    ------
    InputError
        No runs, the same twice, an unknown split, or a name that no recording has.
    """
    if not runs:
        raise InputError("a data set needs results: give the results folders of automos label")
    folders = [run.folder.resolve() for run in runs]
    twice = next((run.folder for run in runs if folders.count(run.folder.resolve()) > 1), None)
    if twice is not None:
        raise InputError(f"{twice} is given twice: give each results folder once")
    names = [run.sequence.name for run in runs]
    for name, split in splits.items():
        if split not in SPLITS:
            raise InputError(f"--split {split}={name}: there is no split {split!r}; there are {', '.join(SPLITS)}")
        if name not in names:
            raise InputError(f"--split {split}={name}: no such recording; there are: {', '.join(sorted(set(names)))}")
    members = [
        Member(run, number, called, splits.get(name, "train"), full_scale_of(run), _sensor_of(run))
        for number, (run, name, called) in enumerate(zip(runs, names, _folders(names), strict=True), FIRST_NUMBER)
    ]
    return _with_joined_sensors(members)


def _folders(names: list[str]) -> list[str]:
    """Return what folders of recordings with these `names` are called, no two alike, without signs of patterns."""
    plain = [re.sub(r"[][*?]", "_", name) for name in names]
    numbered = [f"{name}-{number}" for number, name in enumerate(plain, FIRST_NUMBER)]
    times = Counter(plain)
    found = [name if times[name] == 1 else other for name, other in zip(plain, numbered, strict=True)]
    return found if len(set(found)) == len(found) else numbered


def _sensor_of(run: RunFiles) -> ImageSensor:
    """Return the sensor of a run, from some of its scans: their beam numbers if they have such, else their pattern.

    Its rays are those of the scans as measured: compensated, those that meet what rides along are degrees off.
    """
    scans = {index: run.scan(index) for index in evenly_spread(range(len(run)), _SHOWN)}
    rings = [scan.ring for scan in scans.values() if scan.ring is not None and len(scan.ring)]
    frames = (run.frame(scan, index) for index, scan in scans.items())
    n_rows = max(int(ring.max()) for ring in rings) + 1 if rings else learn_pattern(filter(None, frames)).n_rows
    return measure_sensor([scan.points[scan.is_valid] for scan in scans.values()], n_rows)


def _with_joined_sensors(members: list[Member]) -> list[Member]:
    """Return `members` with one sensor for all that are of one kind, which holds the rays of each."""
    kinds: list[ImageSensor] = []
    kind_of: list[int] = []
    for member in members:
        like = next((k for k, kind in enumerate(kinds) if kind.is_like(member.sensor)), len(kinds))
        kinds[like:] = [member.sensor if like == len(kinds) else kinds[like].joined(member.sensor), *kinds[like + 1 :]]
        kind_of.append(like)
    return [replace(member, sensor=kinds[kind]) for member, kind in zip(members, kind_of, strict=True)]
