"""One recording of a data set on disk, as SemanticKITTI lays it out: velodyne, labels, poses, calibration, times."""

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from automos.core.atomic import write_npy, write_raw, write_text
from automos.core.geometry import inverse
from automos.core.pose_writers import write_kitti
from automos.core.scan import Points, Pose
from automos.objects.verdict import Verdict
from automos.writers.formats import make_folders
from automos.writers.training.members import Member
from automos.writers.training.scans import WIDTH, TrainingScan, residual_image, training_scan

_IDENTITY = "1 0 0 0 0 1 0 0 0 0 1 0"
_INSMOS_CLASSES = (1, 6, 9, 8, 1)
"""InsMOS's numbers of each `Kind`: car, truck, bicyclist, person."""


@dataclass(frozen=True)
class Extras:
    """What is written beside, for trainers that need it.

    Attributes
    ----------
    residuals : tuple of int
        How many scans back each residual image looks; a folder for each.
    boxes : bool
        Whether InsMOS's boxes are written.
    """

    residuals: tuple[int, ...] = ()
    boxes: bool = False


class WrittenScan(NamedTuple):
    """The recording's own name of a scan, and how many points it has, and how many of them move."""

    name: str
    points: int
    moving: int


@dataclass(frozen=True, eq=False)
class Written:
    """What of a recording is in the data set.

    Attributes
    ----------
    member : Member
    folder : Path
    scans : list of WrittenScan
        Those called 000000, 000001, ... there; scans without a point of use are left out.
    numbers : Counter
        How many points have each number of a label.
    """

    member: Member
    folder: Path
    scans: list[WrittenScan] = field(default_factory=list)
    numbers: Counter[int] = field(default_factory=Counter)


def write_sequence(member: Member, folder: Path, ids: str, extras: Extras) -> Written:
    """Write the recording `member` to `folder`; scans that are there are complete, and kept."""
    run, written = member.run, Written(member, folder)
    kept: list[int] = []
    before: deque[tuple[Points, Pose]] = deque(maxlen=max(extras.residuals, default=0))
    make_folders(folder, "velodyne", "labels", *([_BOXES] if extras.boxes else []), *map(_residuals, extras.residuals))
    for index in run.each(f"writing {member.name}"):
        if not run.scan(index).is_valid.any():
            continue
        scan = _write_scan(member, index, folder, f"{len(kept):06d}", ids, extras, before)
        before.append((scan.points[:, :3], run.T_world_sensor[index]))
        written.scans.append(WrittenScan(run.names[index], len(scan.points), scan.n_moving))
        numbers, counts = np.unique(scan.labels & 0xFFFF, return_counts=True)
        written.numbers.update(dict(zip(numbers.tolist(), counts.tolist(), strict=True)))
        kept.append(index)
    write_kitti(folder / "poses.txt", run.T_world_sensor[kept])
    write_text(folder / "calib.txt", "".join(f"{key}: {_IDENTITY}\n" for key in ("P0", "P1", "P2", "P3", "Tr")))
    write_text(folder / "times.txt", "".join(f"{stamp:.9f}\n" for stamp in run.stamps[kept]))
    return written


def _write_scan(
    member: Member,
    index: int,
    folder: Path,
    stem: str,
    ids: str,
    extras: Extras,
    before: Sequence[tuple[Points, Pose]],
) -> TrainingScan:
    points, labels = folder / "velodyne" / f"{stem}.bin", folder / "labels" / f"{stem}.label"
    if labels.exists():  # written last
        return TrainingScan(np.fromfile(points, np.float32).reshape(-1, 4), np.fromfile(labels, np.uint32))
    scan = training_scan(member.run, index, ids, member.full_scale)
    write_raw(points, scan.points)
    T_now_world = inverse(member.run.T_world_sensor[index])
    for back in extras.residuals:
        image = np.zeros((member.sensor.height, WIDTH), np.float32)
        if back <= len(before):
            earlier, T_world_before = before[-back]
            image = residual_image(scan.points[:, :3], earlier, T_now_world @ T_world_before, member.sensor)
        write_npy(folder / _residuals(back) / f"{stem}.npy", image)
    if extras.boxes:
        write_npy(folder / _BOXES / f"{stem}.npy", insmos_boxes(member, index))
    write_raw(labels, scan.labels)
    return scan


_BOXES = "boundingbox_label"


def _residuals(back: int) -> str:
    return f"residual_images_{back}"


def insmos_boxes(member: Member, index: int) -> npt.NDArray[np.object_]:
    """Return the (K, 4) boxes of scan `index` as InsMOS loads them: name, class, whether it moves, box.

    A box is the centre x, y, z, length, width, height and heading, in metres and radians of the sensor's frame.
    """
    run = member.run
    found = run.boxes_upright(index)
    boxes = found.boxes.transformed(inverse(run.T_upright_sensor(index)))
    rows = np.empty((len(found), 4), object)
    for k, box in enumerate(found):
        rows[k, :3] = "object", _INSMOS_CLASSES[box.kind], int(found.verdict[k] == Verdict.MOVING)
        rows[k, 3] = [*boxes.center[k].tolist(), *box.size.tolist(), float(boxes.yaw[k])]
    return rows
