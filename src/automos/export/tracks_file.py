"""tracks.json: every object with its verdict, how sure that is, and a box for every scan it was followed through."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from automos.atomic import atomic_path
from automos.geometry import inverse
from automos.odometry import Trajectory
from automos.tracking.tracks import Tracks
from automos.tracking.verdict import Verdict, Verdicts


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
