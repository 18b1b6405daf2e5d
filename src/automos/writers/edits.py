"""Reads boxes that were corrected in another tool: SUSTechPOINTS or CVAT.

Both give boxes in the scans' upright frames, as they were exported. SUSTechPOINTS keeps the ids of tracks; CVAT
renumbers them, so its tracks are recognised by the places of their boxes.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.errors import InputError
from automos.core.reading import damage_reported, read_json
from automos.core.scan import MAX_RANGE
from automos.core.upright_boxes import Boxes, iou_3d
from automos.results.run_files import RunFiles
from automos.results.tracks_file import MIN_SIDE, VERDICTS
from automos.writers.annotation_tools import ANNOTATIONS
from automos.writers.datumaro import Datumaro, read_datumaro

MAX_TILT = 0.2
"""Radians a box may be tilted about x or y; tools that fit boxes to points tilt them a little, which is not kept."""
_ID_DIGITS = 9
SAME_OBJECT = 0.3
"""Intersection over union above which two boxes of a scan are taken to be around the same object."""


@dataclass(frozen=True)
class EditedBox:
    """One box of one scan, in the scan's upright frame: metres, radians; `verdict` is an index into `VERDICTS`."""

    center: tuple[float, float, float]
    size: tuple[float, float, float]
    yaw: float
    verdict: int

    def to_boxes(self) -> Boxes:
        """Return it as the only one of a set of boxes."""
        return Boxes(np.array([self.center]), np.array([self.size]), np.array([self.yaw]), np.ones(1))


EditedScan = dict[int, EditedBox]
"""The boxes of one scan, by track id."""
_Called = tuple[str, EditedBox]
"""What a tool calls an object, "" where it has no name, and its box."""


def read_edits(path: Path, run: RunFiles) -> dict[int, EditedScan]:
    """Return the corrected boxes at `path` by scan; scans that the tool left out are not there.

    Parameters
    ----------
    path : a SUSTechPOINTS scene or its label folder, or CVAT's export "Datumaro 3D" as a zip, a folder or its JSON.
    run : the results that the boxes were exported from.

    Raises
    ------
    InputError
        Nothing of the kind is there, it is damaged, or it has boxes of a class that says nothing of motion.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist; check the path")
    labels = path / "label" if (path / "label").is_dir() else path
    if labels.is_dir() and any(labels.glob("*.json")) and not (path / ANNOTATIONS).exists():
        return _filed({file.stem: _boxes_in(file) for file in labels.glob("[!.]*.json")}, run, labels, "with obj_id")
    document = read_datumaro(path)
    if document is None:
        raise InputError(f"{path} is neither a SUSTechPOINTS scene (label/*.json) nor CVAT's export as 'Datumaro 3D'")
    return _recognise(_filed(_boxes_of(document, path), run, path, "of track"), run)


def _filed(boxes: dict[str, list[_Called]], run: RunFiles, path: Path, what: str) -> dict[int, EditedScan]:
    """Return boxes, by the name of their scan and each with `what` its object is called, by scan and track."""
    require_known(boxes, run, path)
    found = {index: boxes[name] for index, name in enumerate(run.names) if name in boxes}
    tracks = _tracks_called([called for each in found.values() for called, _ in each], run)
    edits: dict[int, EditedScan] = {index: {} for index in found}
    for index, each in found.items():
        for called, box in each:
            if (track := next(tracks)) in edits[index]:
                scan = run.names[index]
                raise InputError(f"{path} has two boxes {what} {called!r} in scan {scan!r}; give each object its own")
            edits[index][track] = box
    return edits


# ------------------------------------------------------------------------------------------------- SUSTechPOINTS
def _boxes_in(path: Path) -> list[_Called]:
    """Return the boxes in one label file, each with what its object is called."""
    with damage_reported(path, "is not a label file of SUSTechPOINTS", "save the scene again"):
        document = read_json(path)
        boxes = []
        for box in document["objs"] if isinstance(document, dict) else document:
            position, scale, rotation = (_xyz(box["psr"][key]) for key in ("position", "scale", "rotation"))
            made = _make_box(position, scale, rotation, box.get("obj_type", ""), path)
            boxes.append((_name_of(box.get("obj_id"), path), made))
        return boxes


def _name_of(obj_id: Any, path: Path) -> str:
    """Return what a tool calls the object of a box; "" where it has no name."""
    name = "" if obj_id is None else str(obj_id)
    if name.isascii() and name.isdecimal() and len(name) > _ID_DIGITS:
        raise InputError(f"{path} has a box with obj_id {name[:20]}...; ids have up to {_ID_DIGITS} digits")
    return name


def _xyz(values: dict[str, Any]) -> tuple[float, float, float]:
    return float(values["x"]), float(values["y"]), float(values["z"])


def _tracks_called(names: list[str], run: RunFiles) -> Iterator[int]:
    """Yield the track of each of `names`: numbers are kept, other names, and boxes without one, get new ones."""
    numbers = [int(name) if name.isascii() and name.isdecimal() else 0 for name in names]
    new = count(max([*run.tracks, *numbers], default=0) + 1)
    track_of: defaultdict[str, int] = defaultdict(lambda: next(new))
    for name, number in zip(names, numbers, strict=True):
        yield number or (track_of[name] if name else next(new))


# ---------------------------------------------------------------------------------------------------------- CVAT
def _boxes_of(document: Datumaro, path: Path) -> dict[str, list[_Called]]:
    """Return the boxes by the name of their scan, each with its track's number in CVAT, "" for single shapes."""
    names = [label.name for label in document.labels]
    boxes: dict[str, list[_Called]] = {}
    for item in document.items:
        found = boxes[Path(str(item.id)).name] = []
        for box in item.cuboids:
            if box.label_id >= len(names):
                raise InputError(f"{path} has a box of class {box.label_id}, but names {len(names)}; export it again")
            center, size, rotation = tuple(box.position), tuple(box.scale), tuple(box.rotation)
            track = "" if box.attributes.track_id is None else str(box.attributes.track_id)
            found.append((track, _make_box(center, size, rotation, names[box.label_id], path)))
    if len(boxes) < len(document.items):
        raise InputError(f"{path} has the boxes of a scan twice; export it from CVAT again")
    return boxes


def _recognise(edits: dict[int, EditedScan], run: RunFiles) -> dict[int, EditedScan]:
    """Return `edits` with the run's track ids: each track is the one most of whose boxes lie where its own do."""
    votes: Counter[tuple[int, int]] = Counter()
    for index, scan in edits.items():
        found = run.boxes_upright(index)
        for track, box in scan.items():
            overlap = iou_3d(box.to_boxes(), found.boxes)[0]
            if len(overlap) and overlap.max() > SAME_OBJECT:
                votes[track, int(found.ids[overlap.argmax()])] += 1
    known, taken = dict[int, int](), set[int]()
    for (track, original), _ in sorted(votes.items(), key=lambda item: (-item[1], item[0])):
        if track not in known and original not in taken:
            known[track] = original
            taken.add(original)
    others = sorted({track for scan in edits.values() for track in scan} - known.keys())
    known |= zip(others, count(max(run.tracks, default=0) + 1), strict=False)
    return {index: {known[track]: box for track, box in scan.items()} for index, scan in edits.items()}


# ----------------------------------------------------------------------------------------------------- both tools
def _make_box(
    center: tuple[float, ...], size: tuple[float, ...], rotation: tuple[float, ...], kind: str, path: Path
) -> EditedBox:
    if str(kind).lower() not in VERDICTS:
        raise InputError(
            f"{path} has a box of class {kind!r}; classes are {', '.join(VERDICTS)}: change it in the tool"
        )
    values = (*center, *size, *rotation)
    if not len(center) == len(size) == len(rotation) == 3:
        raise InputError(f"{path} has a box at {center} of size {size}, turned by {rotation}; each has three numbers")
    if not (np.abs(values) < MAX_RANGE).all():
        raise InputError(f"{path} has a box of size {size} at {center}, turned by {rotation}; no sensor sees so far")
    if min(size) < 0 or max(size) == 0:
        raise InputError(f"{path} has a box of size {size} at {center}; boxes have three sides, none below 0")
    size = tuple(max(side, MIN_SIDE) for side in size)  # tools round thin ones to nothing
    # Some tools write a heading beyond 90 degrees as a half turn about x or y; the box is the same.
    if max(abs(np.sin(rotation[0])), abs(np.sin(rotation[1]))) > np.sin(MAX_TILT):
        raise InputError(f"{path} has a box at {center} that is tilted by {rotation[:2]} rad; stand it upright")
    yaw = rotation[2] if np.cos(rotation[0]) * np.cos(rotation[1]) > 0 else -rotation[2]
    return EditedBox(center, size, float(yaw), VERDICTS.index(kind.lower()))  # type: ignore[arg-type]


def require_known(names: Iterable[str], run: RunFiles, path: Path) -> None:
    """Raise where the corrections at `path` are of other scans than the run's."""
    strays = sorted(set(names) - set(run.names))
    if strays:
        raise InputError(
            f"{path} has corrections of a scan {strays[0]!r}, which {run.sequence.name} has not; give the recording "
            "that it was exported from"
        )
