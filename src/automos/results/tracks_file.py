"""tracks.json: every object with its verdict, how sure that is, and a box for every scan it was followed through."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from automos.atomic import atomic_path
from automos.errors import InputError
from automos.geometry import inverse
from automos.odometry import Trajectory
from automos.reading import read_json
from automos.tracking.tracks import Tracks
from automos.tracking.verdict import Verdict, Verdicts

VERDICTS = tuple(verdict.name.lower() for verdict in sorted(Verdict))
"""Classes of objects, in the order of `Verdict`."""

MIN_SIDE = 0.02
"""Metres. Things seen as a line or a plane have boxes without a side, which tools that round to a centimetre lose."""


def write_tracks(path: Path, trajectory: Trajectory, names: list[str], entries: Iterable[dict[str, Any]]) -> None:
    """Write `entries` to `path`, a track a line, so that neither writing nor a glance at it needs the whole."""
    head = {
        "frame": "level: z up, ground under the first scan at z = 0; T_world_level maps it to the frame of poses.txt",
        "T_world_level": np.round(inverse(trajectory.T_level_world), 9).tolist(),
        "units": {"center": "m", "size": "m: length, width, height", "yaw": "rad", "velocity": "m/s", "stamp": "s"},
        "scans": names,
    }
    with atomic_path(path) as temporary, temporary.open("w") as file:
        file.write(json.dumps(head, indent=1)[:-2] + ',\n "tracks": [')
        file.writelines(f"{',' if k else ''}\n  {json.dumps(entry)}" for k, entry in enumerate(entries))
        file.write("\n ]\n}\n")


def track_entries(tracks: Tracks, verdicts: Verdicts, trajectory: Trajectory) -> Iterator[dict[str, Any]]:
    """Yield what tracks.json says of each track, in their order."""
    columns = np.column_stack([tracks.center, tracks.size, tracks.yaw, tracks.velocity]).round(3).tolist()
    stamps = np.round(trajectory.stamps, 6).tolist()
    for k in range(len(tracks)):
        rows = tracks.rows_of(k)
        boxes = [
            {
                "scan": int(tracks.scan[r]),
                "stamp": stamps[tracks.scan[r]],
                "observed": bool(tracks.segment[r] >= 0),
                "center": columns[r][:3],
                "size": columns[r][3:6],
                "yaw": columns[r][6],
                "velocity": columns[r][7:],
            }
            for r in range(rows.start, rows.stop)
        ]
        yield {
            "id": k + 1,
            "verdict": Verdict(verdicts.verdict[k]).name.lower(),
            "confidence": round(float(verdicts.confidence[k]), 3),
            "boxes": boxes,
        }


def read_tracks(path: Path) -> dict[str, Any]:
    """Return what the file holds.

    Raises
    ------
    InputError
        It is missing or damaged.
    """
    try:
        return read_json(path)
    except FileNotFoundError:
        raise InputError(f"{path} is missing; give the results folder of a run, or label again") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path} is damaged ({error}); label again to have it written anew") from None


def box_table(tracks_file: dict[str, Any]) -> dict[str, npt.NDArray]:
    """Return columns of all boxes of all tracks, a row each, by scan, then track; sides are `MIN_SIDE` at least."""
    rows = [
        (
            *(box["scan"], track["id"], VERDICTS.index(track["verdict"]), track["confidence"]),
            *(box["observed"], box["yaw"], *box["center"], *box["size"], *box["velocity"]),
        )
        for track in tracks_file["tracks"]
        for box in track["boxes"]
    ]
    table = np.array(rows, np.float64).reshape(-1, 15)
    table = table[np.lexsort((table[:, 1], table[:, 0]))]
    return {
        "scan": table[:, 0].astype(np.int64),
        "id": table[:, 1].astype(np.int64),
        "verdict": table[:, 2].astype(np.int8),
        "confidence": table[:, 3],
        "observed": table[:, 4] > 0,
        "yaw": table[:, 5],
        "center": table[:, 6:9],
        "size": np.maximum(table[:, 9:12], MIN_SIDE),
        "velocity": table[:, 12:15],
    }
