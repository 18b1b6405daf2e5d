"""Many runs as one data set, in a layout that trainers of moving-object segmentation load as it is.

semantickitti   OUT/sequences/50/{velodyne,labels}/000000.*, poses.txt, calib.txt, times.txt; OUT/poses/50.txt
helimos         OUT/RECORDING/ with the same in it; OUT/train.txt, val.txt, test.txt

Beside them lie the files that tell trainers of classes, splits and sensors, and dataset.json, which maps every scan
back to its recording. Recordings of different sensors are told of in different files, as a range image is of one.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.arrays import evenly_spread
from automos.core.atomic import write_text
from automos.core.claims import DATASET
from automos.core.errors import InputError
from automos.core.own_folder import own_folder
from automos.results.claiming import refuse_folder_of
from automos.results.run_files import RunFiles
from automos.writers.formats import copy_file, make_folders
from automos.writers.training import trainer_files
from automos.writers.training.members import Member, members_of
from automos.writers.training.scans import IDS, image_statistics
from automos.writers.training.sequence import Extras, Written, write_sequence
from automos.writers.training.trainer_files import SPLITS

LAYOUTS = ("semantickitti", "helimos")
MANIFEST = "dataset.json"
_THEIR_NAMES = {"train": "train", "valid": "val", "test": "test"}
"""HeLiMOS's names of the splits."""


@dataclass(frozen=True, eq=False)
class Made:
    """A data set that was written, and what of each recording is in it."""

    folder: Path
    written: list[Written]

    @property
    def members(self) -> list[Member]:
        """Its recordings."""
        return [one.member for one in self.written]

    def sentences(self) -> list[str]:
        """Return what a person should know of it: a line for each recording, and what trainers will stumble over."""
        lines, n_empty = [], 0
        for member, scans in ((one.member, one.scans) for one in self.written):
            share = 100.0 * sum(scan.moving for scan in scans) / max(sum(scan.points for scan in scans), 1)
            n_with = sum(scan.moving > 0 for scan in scans)
            n_empty += len(scans) - n_with
            lines.append(
                f"{member.name}: sequence {member.number}, {member.split}, {len(scans)} scans, {n_with} with movers, "
                f"{share:.2f} % of points move"
            )
        if n_empty:
            lines.append(f"warning: nothing moves in {n_empty} scans; some trainers leave such out without a word")
        if missing := [split for split in ("train", "valid") if all(m.split != split for m in self.members)]:
            lines.append(f"warning: no recording is in {missing[0]}, which trainers ask for: --split {missing[0]}=NAME")
        n_sensors = len({member.sensor for member in self.members})
        if n_sensors > 1:
            lines.append(f"{n_sensors} different sensors: give a trainer on range images one at a time")
        return lines


def make_training_set(
    runs: Sequence[RunFiles],
    out: Path,
    layout: str,
    ids: str = "universal",
    splits: Mapping[str, str] | None = None,
    extras: Extras = Extras(),  # noqa: B008
) -> Made:
    """Write the results of `runs` as one data set to folder `out`; an interrupted call goes on.

    Parameters
    ----------
    runs : opened with motion compensation.
    out : a new folder, or what the same call left of it.
    layout : one of `LAYOUTS`.
    ids : one of `IDS`.
    splits : split by name of recording, "train" where it is not named.
    extras : what is written beside, for trainers that need it.

    Raises
    ------
    InputError
        An unknown option, a folder that holds other things, a run that cannot be read, or a disk that is full.
    """
    for value, known, what in ((layout, LAYOUTS, "layout"), (ids, tuple(IDS), "ids")):
        if value not in known:
            raise InputError(f"--{what} {value}: there is no such; there are {', '.join(known)}")
    if word := re.search(r"velodyne|[][*?]", str(out.absolute())):
        raise InputError(
            f"{out}: in paths, trainers replace 'velodyne' and take []*? for patterns; choose one without {word[0]!r}"
        )
    for run in runs:
        refuse_folder_of(run.sequence, out)
    members = members_of(runs, splits or {})
    about = {
        "format": "automos dataset",
        "layout": layout,
        "ids": ids,
        "residuals": list(extras.residuals),
        "boxes": extras.boxes,
        "recordings": [member.about() for member in members],
    }
    with own_folder(out, DATASET, MANIFEST, about) as found:
        is_helimos = layout == "helimos"
        places = [out / m.name if is_helimos else out / "sequences" / f"{m.number:02d}" for m in members]
        written = [write_sequence(m, place, ids, extras) for m, place in zip(members, places, strict=True)]
        (_write_lists if is_helimos else _write_tables)(out, written)
        found.update(_manifest(out, written))
    return Made(out, written)


def _write_lists(out: Path, written: list[Written]) -> None:
    """Write HeLiMOS's lists of scans, which hold for all recordings of a split, and how trainers call the lists."""
    called: dict[str, list[str]] = {}
    for split, theirs in _THEIR_NAMES.items():
        those = [one for one in written if one.member.split == split]
        if those:  # numbers beyond a recording's end do no harm, but one alone is read as no list
            longest = max(2, *(len(one.scans) for one in those))
            write_text(out / f"{theirs}.txt", "".join(f"{k}\n" for k in range(longest)))
        called[split] = [f"{one.member.name}/{theirs}.txt" for one in those]
    write_text(out / "mos4d.yaml", trainer_files.sequences_yaml(called))


def _write_tables(out: Path, written: list[Written]) -> None:
    """Write what SemanticKITTI's trainers ask for: poses, scans with movers, splits, and files of each sensor."""
    make_folders(out, "poses")
    lines = []
    for one in written:
        copy_file(one.folder / "poses.txt", out / "poses" / f"{one.member.number:02d}.txt")
        if one.member.split == "train":
            moving = enumerate(scan.moving for scan in one.scans)
            lines += [f"{one.member.number:02d} {k:06d} {n}\n" for k, n in moving if n]
    write_text(out / "train_split_dynamic_pointnumber.txt", "".join(lines))
    called = {split: [f"{number:02d}" for number in numbers] for split, numbers in _split_of(written).items()}
    write_text(out / "mos4d.yaml", trainer_files.sequences_yaml(called))
    sensors = list(dict.fromkeys(one.member.sensor for one in written))
    for k, sensor in enumerate(sensors):
        suffix = "" if len(sensors) == 1 else f"_{k + 1}"
        _write_sensor(out, [one for one in written if one.member.sensor == sensor], suffix)


def _write_sensor(out: Path, written: list[Written], suffix: str) -> None:
    """Write the classes, splits and image of the recordings of one sensor, for trainers on range images and InsMOS."""
    numbers: Counter[int] = sum((one.numbers for one in written), Counter())
    shares = {number: count / max(numbers.total(), 1) for number, count in numbers.items()}
    scans = [
        np.fromfile(one.folder / "velodyne" / f"{k:06d}.bin", np.float32).reshape(-1, 4)
        for one in written
        for k in evenly_spread(range(len(one.scans)), 10)
    ]
    most = max((scan.points for one in written for scan in one.scans), default=1)
    sensor, split = written[0].member.sensor, _split_of(written)
    statistics = image_statistics(scans, sensor)
    write_text(out / f"semantic-kitti-mos{suffix}.yaml", trainer_files.classes_yaml(shares, split))
    write_text(out / f"sensor{suffix}.yaml", trainer_files.sensor_yaml(sensor, statistics, most))
    write_text(out / f"insmos{suffix}.yaml", trainer_files.insmos_yaml(split))


def _split_of(written: list[Written]) -> dict[str, list[int]]:
    """Return the numbers of the sequences in each split."""
    return {split: [one.member.number for one in written if one.member.split == split] for split in SPLITS}


def _manifest(out: Path, written: list[Written]) -> dict[str, Any]:
    """Return what dataset.json says of the scans: where each came from, and how much of it moves."""
    return {
        "points": "x, y, z in metres in the sensor's frame at the scan's pose, motion-compensated; intensity 0 to 1",
        "poses": "T_world_sensor",
        "numbers": "labels; the object in the upper 16 bits, of ids 'universal' only",
        "sequences": {
            str(one.folder.relative_to(out)): {
                "name": one.member.name,
                "full_scale_of_intensity": one.member.full_scale,
                "scans": [scan._asdict() for scan in one.scans],
            }
            for one in written
        },
    }
