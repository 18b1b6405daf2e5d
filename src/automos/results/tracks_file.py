"""tracks.json: every object with its verdict, its confidence, and a box for each scan in which it was tracked.

The file is checked like any other input when it is read: anything that does not match the schema is an error.
"""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from automos.core.atomic import atomic_path
from automos.core.geometry import FARTHEST, inverse
from automos.core.json_members import each_member
from automos.core.reading import checked, damage_reported, read_text
from automos.objects.kinds import Kind, kind_probabilities
from automos.objects.tracks import Tracks
from automos.objects.verdict import Verdict, Verdicts
from automos.odometry.trajectory import Trajectory

VERDICTS = tuple(verdict.name.lower() for verdict in sorted(Verdict))
"""Classes of objects, in the order of `Verdict`."""

MIN_SIDE = 0.02
"""Metres. Things seen as a line or a plane have boxes without a side, which tools that round to a centimetre lose."""

Metres = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST, allow_inf_nan=False)]
Size = Annotated[float, Field(ge=0.0, le=FARTHEST, allow_inf_nan=False)]
Three = Annotated[list[Metres], Field(min_length=3, max_length=3)]
Row = Annotated[list[Metres], Field(min_length=4, max_length=4)]


class _Strict(BaseModel):
    model_config = ConfigDict(strict=True)


class _Box(_Strict):
    scan: Annotated[int, Field(ge=0)]
    stamp: Annotated[float, Field(allow_inf_nan=False)]
    observed: bool
    center: Three
    size: Annotated[list[Size], Field(min_length=3, max_length=3)]
    yaw: Annotated[float, Field(ge=-100.0, le=100.0)]
    velocity: Three
    p_moving: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0


class _Track(_Strict):
    id: Annotated[int, Field(ge=1, le=1 << 53)]
    verdict: Literal["unknown", "static", "moving"]
    confidence: Annotated[float, Field(ge=0.0, le=1.0)]
    p_moved: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    kind: dict[Literal["car", "large_vehicle", "two_wheeler", "person", "other"], float] = Field(default_factory=dict)
    displacement: Annotated[float, Field(ge=0.0)] = 0.0
    displacement_sigma: Annotated[float, Field(ge=0.0)] | None = None
    moves_from: Annotated[float, Field(allow_inf_nan=False)] | None = None
    moves_until: Annotated[float, Field(allow_inf_nan=False)] | None = None
    boxes: Annotated[list[_Box], Field(min_length=1)]


class _Tracks(_Strict):
    T_world_level: Annotated[list[Row], Field(min_length=4, max_length=4)]
    tracks: list[Any]


_TRACKS, _TRACK = TypeAdapter(_Tracks), TypeAdapter(_Track)


def each_track(path: Path, n_scans: int, beside: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the tracks of a tracks.json of `n_scans` scans; what it says beside is put into `beside`.

    Raises
    ------
    InputError
        It is absent, damaged, or of more scans.
    """
    ids, again = set(), "label again to have it written anew"
    with damage_reported(path, "is damaged", again, "give the results folder of a run, or label again"):
        for name, value in each_member(read_text(path), "tracks"):
            if name is not None:
                beside[name] = value
                continue
            checked(_TRACK, value)
            scans = [box["scan"] for box in value["boxes"]]
            if value["id"] in ids:
                raise ValueError("two tracks have one id")
            if max(scans) >= n_scans:
                raise ValueError(f"it has boxes of more than {n_scans} scans")
            if len(set(scans)) < len(scans):
                raise ValueError("a track has two boxes in a scan")
            ids.add(value["id"])
            yield value
        checked(_TRACKS, beside)
        T = np.array(beside["T_world_level"])
        if np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max() > 1e-3 or not np.array_equal(T[3], [0.0, 0.0, 0.0, 1.0]):
            raise ValueError("T_world_level is not a rigid transform")


def write_tracks(path: Path, trajectory: Trajectory, names: list[str], entries: Iterable[dict[str, Any]]) -> None:
    """Write `entries` to `path`, a track a line, so that neither writing nor a glance at it needs the whole."""
    head = {
        "frame": "level: z up, ground under the first scan at z = 0; T_world_level maps it to the frame of poses.txt",
        "T_world_level": np.round(inverse(trajectory.T_level_world), 9).tolist(),
        "units": {
            "center": "m",
            "size": "m: length, width, height",
            "yaw": "rad",
            "velocity": "m/s",
            "stamp": "s",
            "displacement": "m",
            "displacement_sigma": "m",
            "moves_from": "s",
            "moves_until": "s",
        },
        "scans": names,
    }
    with atomic_path(path) as temporary, temporary.open("w") as file:
        file.write(json.dumps(head, indent=1)[:-2] + ',\n "tracks": [')
        file.writelines(f"{',' if k else ''}\n  {json.dumps(entry)}" for k, entry in enumerate(entries))
        file.write("\n ]\n}\n")


def box_entry(scan: int, stamp: float, observed: bool, columns: list[float]) -> dict[str, Any]:
    """Return what tracks.json says of an object in one scan.

    columns : (10,) its centre, size, yaw and velocity.   stamp : seconds. All are rounded as they are to be written.
    """
    return {
        "scan": scan,
        "stamp": stamp,
        "observed": observed,
        "center": columns[:3],
        "size": columns[3:6],
        "yaw": columns[6],
        "velocity": columns[7:],
    }


def track_entries(
    tracks: Tracks, verdicts: Verdicts, trajectory: Trajectory, wanted: Iterable[int] | None = None
) -> Iterator[dict[str, Any]]:
    """Yield what tracks.json says of each track, or of those `wanted` (from 0), in their order.

    `p_moved` is the probability that it moved at some time, `p_moving` of a box that it moves in that scan; `kind` are
    the probabilities of each kind; `displacement`, metres, is from its first to its last box, `displacement_sigma` its
    standard deviation, null where it is not known; `moves_from` and `moves_until`, seconds, are the first and the last
    scan in which it moves, null where it never does.
    """
    stamps = np.round(trajectory.stamps, 6)
    for k in range(len(tracks)) if wanted is None else wanted:
        track = tracks[tracks.rows_of(k)]  # as lists, the columns of all at once are several times as large
        columns = np.column_stack([track.center, track.size, track.yaw, track.velocity]).round(3)
        rows = (track.scan, stamps[track.scan], track.is_observed, columns, track.p_moving.round(3))
        boxes = [
            {**box_entry(*row), "p_moving": p_moving}
            for *row, p_moving in zip(*(column.tolist() for column in rows), strict=True)
        ]
        scatter = verdicts.scatter[k]  # of either end
        sure, is_moving = float(verdicts.confidence[k]), verdicts.verdict[k] == Verdict.MOVING
        fastest = np.linalg.norm(track.velocity, axis=1).max(keepdims=True)
        kinds = kind_probabilities(np.median(track.size, axis=0)[None], fastest)[0]
        moves = [box["stamp"] for box in boxes if is_moving and box["p_moving"] >= 0.5]
        yield {
            "id": k + 1,
            "verdict": Verdict(verdicts.verdict[k]).name.lower(),
            "confidence": round(sure, 3),
            "p_moved": round(sure if is_moving else 1.0 - sure, 3),
            "kind": {kind.name.lower(): round(float(p), 3) for kind, p in zip(Kind, kinds, strict=True)},
            "displacement": round(float(np.linalg.norm(track.center[-1] - track.center[0])), 3),
            "displacement_sigma": round(float(np.sqrt(2.0) * scatter), 3) if np.isfinite(scatter) else None,
            "moves_from": min(moves, default=None),
            "moves_until": max(moves, default=None),
            "boxes": boxes,
        }
