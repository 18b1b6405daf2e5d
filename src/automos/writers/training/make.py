"""Many runs as one data set, in a layout that trainers of moving-object segmentation load as it is.

semantickitti   OUT/sequences/50/{velodyne,labels}/000000.*, poses.txt, calib.txt, times.txt; OUT/poses/50.txt
helimos         OUT/RECORDING/ with the same in it; OUT/train.txt, val.txt, test.txt

Beside them lie the files that tell trainers of classes, splits and sensors, and dataset.json, which maps every scan
back to its recording. Recordings of different sensors are told of in different files, as a range image is of one.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.atomic import write_text
from automos.core.claims import DATASET
from automos.core.errors import InputError
from automos.core.own_folder import own_folder
from automos.results.claiming import refuse_folder_of
from automos.results.run_files import RunFiles
from automos.writers.training import trainer_files
from automos.writers.training.members import Member, members_of
from automos.writers.training.scans import IDS, ImageSensor, image_statistics, spread
from automos.writers.training.sequence import Extras, Written, write_sequence
from automos.writers.training.trainer_files import SPLITS

LAYOUTS = ("semantickitti", "helimos")
MANIFEST = "dataset.json"
_THEIR_NAMES = {"train": "train", "valid": "val", "test": "test"}
"""HeLiMOS's names of the splits."""


@dataclass(frozen=True, eq=False)
class Made:
    """A data set that was written: its members, and what of each is in it."""

    folder: Path
    members: list[Member]
    written: list[Written]

    def sentences(self) -> list[str]:
        """Return what a person should know of it: a line for each recording, and what trainers will stumble over."""
        lines = []
        for member, found in zip(self.members, self.written, strict=True):
            share = 100.0 * sum(found.moving) / max(sum(found.points), 1)
            lines.append(
                f"{member.name}: sequence {member.number}, {member.split}, {len(found.names)} scans, "
                f"{len(found.names) - found.n_without_movers} with movers, {share:.2f} % of points move"
            )
        empty = sum(found.n_without_movers for found in self.written)
        if empty:
            lines.append(f"warning: nothing moves in {empty} scans; some trainers leave such out without a word")
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
    if "velodyne" in str(out.absolute()):
        raise InputError(f"{out}: trainers replace the word 'velodyne' in paths; choose an --out without it")
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
        written = [write_sequence(member, _place(out, layout, member), ids, extras) for member in members]
        made = Made(out, members, written)
        _write_beside(made, layout)
        found.update(_manifest(made, layout))
    return made


def _place(out: Path, layout: str, member: Member) -> Path:
    return out / member.name if layout == "helimos" else out / "sequences" / f"{member.number:02d}"


def _write_beside(made: Made, layout: str) -> None:
    """Write what lies beside the sequences: lists, classes, sensors, and what trainers call each sequence."""
    out, members = made.folder, made.members
    if layout == "helimos":
        for split, theirs in _THEIR_NAMES.items():
            lengths = [len(f.names) for m, f in zip(members, made.written, strict=True) if m.split == split]
            if lengths:  # numbers beyond a recording's end do no harm, but one alone is read as no list
                write_text(out / f"{theirs}.txt", "".join(f"{k}\n" for k in range(max(2, *lengths))))
        called = {s: [f"{m.name}/{_THEIR_NAMES[s]}.txt" for m in members if m.split == s] for s in SPLITS}
    else:
        (out / "poses").mkdir(exist_ok=True)
        for member in members:
            poses = (_place(out, layout, member) / "poses.txt").read_text()
            write_text(out / "poses" / f"{member.number:02d}.txt", poses)
        called = {s: [f"{m.number:02d}" for m in members if m.split == s] for s in SPLITS}
        sensors = list(dict.fromkeys(member.sensor for member in members))
        for k, sensor in enumerate(sensors):
            _write_sensor(made, layout, sensor, "" if len(sensors) == 1 else f"_{k + 1}")
        lines = (
            f"{member.number:02d} {k:06d} {n}\n"
            for member, found in zip(members, made.written, strict=True)
            for k, n in enumerate(found.moving)
            if n and member.split == "train"
        )
        write_text(out / "train_split_dynamic_pointnumber.txt", "".join(lines))
    write_text(out / "mos4d.yaml", trainer_files.sequences_yaml(called))


def _write_sensor(made: Made, layout: str, sensor: ImageSensor, suffix: str) -> None:
    """Write the classes, splits and image of the recordings of one sensor, for trainers on range images and InsMOS."""
    pairs = [(m, f) for m, f in zip(made.members, made.written, strict=True) if m.sensor == sensor]
    numbers: Counter[int] = sum((f.numbers for _, f in pairs), Counter())
    shares = {number: count / max(numbers.total(), 1) for number, count in numbers.items()}
    split = {s: [m.number for m, _ in pairs if m.split == s] for s in SPLITS}
    scans = [
        np.fromfile(_place(made.folder, layout, m) / "velodyne" / f"{k:06d}.bin", np.float32).reshape(-1, 4)
        for m, f in pairs
        for k in spread(len(f.names), 10)
    ]
    most = max((max(f.points, default=1) for _, f in pairs), default=1)
    statistics = image_statistics(scans, sensor)
    write_text(made.folder / f"semantic-kitti-mos{suffix}.yaml", trainer_files.classes_yaml(shares, split))
    write_text(made.folder / f"sensor{suffix}.yaml", trainer_files.sensor_yaml(sensor, statistics, most))
    write_text(made.folder / f"insmos{suffix}.yaml", trainer_files.insmos_yaml(split))


def _manifest(made: Made, layout: str) -> dict[str, Any]:
    """Return what dataset.json says of the scans: where each came from, and how much of it moves."""
    return {
        "points": "x, y, z in metres in the sensor's frame at the scan's pose, motion-compensated; intensity 0 to 1",
        "poses": "T_world_sensor",
        "numbers": "labels; the object in the upper 16 bits, of ids 'universal' only",
        "sequences": {
            str(_place(made.folder, layout, member).relative_to(made.folder)): {
                "name": member.name,
                "full_scale_of_intensity": member.full_scale,
                "scans": [
                    {"name": name, "points": points, "moving": moving}
                    for name, points, moving in zip(found.names, found.points, found.moving, strict=True)
                ],
            }
            for member, found in zip(made.members, made.written, strict=True)
        },
    }
