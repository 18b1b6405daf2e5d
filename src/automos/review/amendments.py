"""Objects made by a person: added where none was found, or cut, split or joined from found ones.

Such an object consists of its points and its box, scan by scan. The points are rows of the recording's scans, and the
box is in the scan's own sensor frame, so neither depends on the results or poses of a run with other settings. In a
run, the object replaces any track that holds its points; a track that was cut becomes two such objects.
"""

import base64
import re
import zlib
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from automos.core.geometry import inverse, transform
from automos.core.reading import read_bytes
from automos.core.scan import MAX_RANGE, Pose
from automos.review.log import LOG_FILE, append_lines, read_lines

MOST_BYTES = 1 << 28
"""Of the rows of a part, unpacked; no scan has as many points."""


@dataclass(frozen=True, eq=False)
class Part:
    """One scan of an object made by hand.

    Attributes
    ----------
    rows : (K,) int64
        Ascending: its points, rows of the scan as the recording has it.
    center, heading : (3,) float64
        Metres, and a unit vector along its length; sensor frame.
    size : (3,) float64
        Metres, length, width, height.
    """

    rows: npt.NDArray[np.int64]
    center: npt.NDArray[np.float64]
    heading: npt.NDArray[np.float64]
    size: npt.NDArray[np.float64]

    @classmethod
    def of_box(cls, rows: npt.NDArray, box: npt.NDArray[np.float64], T_level_sensor: Pose) -> Self:
        """Return the part of points `rows` and an upright `box` (7,): centre, size, yaw; level frame."""
        T = inverse(T_level_sensor)
        heading = T[:3, :3] @ [np.cos(box[6]), np.sin(box[6]), 0.0]
        return cls(np.sort(rows).astype(np.int64), transform(T, box[None, :3])[0], heading, np.asarray(box[3:6]))

    def box_level(self, T_level_sensor: Pose) -> npt.NDArray[np.float64]:
        """Return its upright box (7,): centre, size, yaw; level frame."""
        heading = T_level_sensor[:3, :3] @ self.heading
        center = transform(T_level_sensor, self.center[None])[0]
        return np.array([*center, *self.size, np.arctan2(heading[1], heading[0])])


@dataclass(frozen=True, eq=False)
class Amendment:
    """An object made by hand: key in the log, when, how, its verdict ("moving", "static", "unknown"), its parts."""

    key: str
    at: str
    how: str
    verdict: str
    parts: Mapping[str, Part]

    @property
    def sentence(self) -> str:
        """What it is, in words."""
        scans = sorted(self.parts)
        return f"The object made by hand at {self.at} (scans {scans[0]} to {scans[-1]})"


def append_amendments(folder: Path, amendments: Iterable[Amendment]) -> None:
    """Add objects made by hand to the log in `folder`; errors as for the log."""
    packed = ((one, {scan: _pack(part) for scan, part in one.parts.items()}) for one in amendments)
    append_lines(folder, ({"kind": "amendment", "at": one.at, **vars(one), "parts": parts} for one, parts in packed))


def append_verdicts(folder: Path, at: str, verdicts: Mapping[str, str]) -> None:
    """Add to the log what was decided of objects made by hand, by key; "undo" takes the object back."""
    lines = ({"kind": "amendment", "at": at, "key": key, "verdict": verdict} for key, verdict in verdicts.items())
    append_lines(folder, lines)


def read_amendments(folder: Path) -> list[Amendment]:
    """Return the objects made by hand that hold, oldest first, with what was decided last; errors as of the log."""
    held: dict[str, Amendment] = {}
    for key, verdict, made in read_lines(folder, "amendment", "an object made by hand", _parse):
        if made is not None:
            held[key] = made
        elif verdict == "undo":
            held.pop(key, None)
        elif key in held:
            held[key] = replace(held[key], verdict=verdict)
    return list(held.values())


def in_scans(amendments: Iterable[Amendment], names: Container[str]) -> tuple[list[Amendment], list[Amendment]]:
    """Return `amendments` with only their parts in the scans `names`, and those that have none: scans were removed."""
    left = [(one, {scan: part for scan, part in one.parts.items() if scan in names}) for one in amendments]
    return [replace(one, parts=parts) for one, parts in left if parts], [one for one, parts in left if not parts]


def ever_made(folder: Path) -> list[Amendment]:
    """Return all objects ever made by hand, those taken back since included; errors as of the log."""
    lines = read_lines(folder, "amendment", "an object made by hand", _parse)
    return [made for _, _, made in lines if made is not None]


def new_keys(folder: Path, n: int) -> list[str]:
    """Return `n` keys that no object in the log of `folder` has or had."""
    path = folder / LOG_FILE
    text = read_bytes(path) if path.exists() else b""  # lines that are broken included: a person may mend them
    first = 1 + max(map(int, re.findall(rb'"key": *"h([0-9]{1,9})"', text)), default=0)
    return [f"h{first + k}" for k in range(n)]


def _parse(fields: dict[str, Any]) -> tuple[str, str, Amendment | None]:
    key, verdict = fields["key"], fields["verdict"]
    if not re.fullmatch(r"h[1-9]\d{0,8}", key):
        raise ValueError(f"key is {key[:40]!r}")
    if verdict not in ("moving", "static", "unknown", "undo"):
        raise ValueError(verdict)
    if "parts" not in fields:
        return key, verdict, None
    parts = {scan: _unpack(part) for scan, part in fields["parts"].items()}
    return key, verdict, Amendment(key, str(fields["at"]), str(fields["how"]), verdict, parts)


def _pack(part: Part) -> dict[str, Any]:
    steps = np.diff(part.rows, prepend=0).astype("<u4")
    box = np.concatenate([part.center, part.heading, part.size]).round(4).tolist()
    return {"rows": base64.b64encode(zlib.compress(steps.tobytes(), 9)).decode(), "box": box}


def _unpack(packed: dict[str, Any]) -> Part:
    steps = np.frombuffer(zlib.decompressobj().decompress(base64.b64decode(packed["rows"]), MOST_BYTES), "<u4")
    box = np.array(packed["box"], np.float64)
    if box.shape != (9,) or not (np.abs(box) < MAX_RANGE).all():
        raise ValueError(f"box is not of nine ordinary numbers: {box[:9]}")
    return Part(np.cumsum(steps, dtype=np.int64), box[:3], box[3:6], box[6:])
