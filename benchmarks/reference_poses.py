"""How far a recording's reference poses, and the odometry's, are from what two scans seconds apart say themselves.

    python benchmarks/reference_poses.py RECORDING... [--seconds 5] [--every 8] [--json FILE]
    python benchmarks/reference_poses.py --store FOLDER [--cases NAME ...] [--every 8] [--json FILE]

The second form takes real drives of the folder that AUTOMOS_RECORDINGS names and simulated worlds kept in FOLDER.
Two scans are laid on each other directly (point-to-plane ICP of small_gicp on what stands on the ground), once from the
pose between them that the reference gives and once from the odometry's, with nothing known of the scans between. Where
both end at the same place, that place is a yardstick: how far either pose is from it, in percent of the way, and what
share of the points has a neighbour within 10 cm in the other scan under each. On simulated recordings the reference is
exact, so there its distance is the error of the yardstick.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import small_gicp
from rich.console import Console
from rich.table import Table
from scipy.spatial import KDTree
from store import real_drive, stored_world

from automos import load_settings, open_sequence
from automos.core.geometry import inverse, transform
from automos.core.scan import Sequence
from automos.odometry import estimate_trajectory
from automos.odometry.motion import usable_points
from automos.odometry.trajectory import Trajectory
from automos.settings import OdometrySettings

DISTANCES = (2.0, 1.0, 0.5, 0.3)
"""Metres, one registration each: pairs further apart are left out."""
VOXEL, CLOSE = 0.25, 0.1
MIN_HEIGHT, MAX_RANGE = 0.5, 60.0
SAME = 0.02
"""Metres between two results that are the same."""
DRIVES = {
    "kitti_0005, 5 s": ("kitti_0005", 5.0),
    "kitti_0027, 5 s": ("kitti_0027", 5.0),
    "kitti_0027, 2 s": ("kitti_0027", 2.0),
}
WORLDS = {f"`{name}`, 5 s": (name, 5.0) for name in ("city", "hills", "narrow")}
"""Each case's recording, and the seconds between the two scans of a pair."""
WORLD = ("HDL-64E", 100, 0)
"""Sensor, scans and seed of the simulated worlds."""


def compare(sequence: Sequence, settings: OdometrySettings, seconds: float, every: int) -> dict:
    """Return the mean distances (% of the way) of odometry and reference from scans registered directly."""
    found = estimate_trajectory(sequence, settings)
    apart = round(seconds / float(np.median(np.diff(found.stamps))))
    rows = []
    for first in range(0, len(sequence) - apart, every):
        target, source = (standing_points(sequence, found, i, settings) for i in (first, first + apart))
        T_found, T_reference = (
            inverse(T[first]) @ T[first + apart] for T in (found.T_world_sensor, sequence.reference_poses)
        )
        way = float(np.linalg.norm(T_found[:3, 3]))
        if way < 1.0:
            continue
        direct, from_reference = register(target, source, T_found), register(target, source, T_reference)
        tree = KDTree(target)
        rows.append(
            {
                "is_agreed": distance(direct, from_reference) < SAME,
                "odometry_percent": 100.0 * distance(direct, T_found) / way,
                "reference_percent": 100.0 * distance(direct, T_reference) / way,
                "close_odometry": share_close(tree, transform(T_found, source)),
                "close_reference": share_close(tree, transform(T_reference, source)),
            }
        )
    agreed = [row for row in rows if row["is_agreed"]]
    figures = {key: float(np.mean([row[key] for row in agreed])) for key in (agreed[0] if agreed else {})}
    return {"pairs": len(rows), "agreed": len(agreed), **figures}


def standing_points(sequence: Sequence, found: Trajectory, index: int, settings: OdometrySettings) -> np.ndarray:
    """Return the compensated points (M, 3) of a scan, in its frame, that stand clear of the ground and not too far."""
    points, _ = usable_points(sequence[index], found.timing, found.sweep_motion[index], settings)
    height = transform(found.T_level_world @ found.T_world_sensor[index], points)[:, 2]
    return points[(height > MIN_HEIGHT) & (np.linalg.norm(points, axis=1) < MAX_RANGE)].astype(np.float64)


def register(target: np.ndarray, source: np.ndarray, T_start: np.ndarray) -> np.ndarray:
    """Return T_target_source (4, 4) that lays `source` on `target`, from `T_start`."""
    fixed, tree = small_gicp.preprocess_points(target, downsampling_resolution=VOXEL)
    moved, _ = small_gicp.preprocess_points(source, downsampling_resolution=VOXEL)
    T = T_start
    for reach in DISTANCES:
        T = small_gicp.align(
            fixed, moved, tree, T, registration_type="PLANE_ICP", max_correspondence_distance=reach, max_iterations=60
        ).T_target_source
    return T


def share_close(tree: KDTree, points: np.ndarray) -> float:
    """Return the share of `points` that have a neighbour within 10 cm."""
    return float(np.isfinite(tree.query(points, distance_upper_bound=CLOSE)[0]).mean())


def distance(first: np.ndarray, second: np.ndarray) -> float:
    """Return metres between the places of two transforms."""
    return float(np.linalg.norm(first[:3, 3] - second[:3, 3]))


def cases(arguments: argparse.Namespace) -> Iterator[tuple[str, Sequence, float]]:
    """Yield a name, a recording and the seconds between two scans, for each that was asked for."""
    for folder in arguments.recordings:
        sequence = open_sequence(folder)
        yield sequence.name, sequence, arguments.seconds
    if arguments.store is not None:
        for case in arguments.cases:
            name, seconds = (DRIVES | WORLDS)[case]
            yield (
                case,
                real_drive(name) if case in DRIVES else stored_world(arguments.store, name, *WORLD),
                seconds,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="*", type=Path)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--store", type=Path, help="where gate.py keeps its worlds")
    parser.add_argument("--cases", nargs="+", choices=[*DRIVES, *WORLDS], default=[*DRIVES, *WORLDS], metavar="NAME")
    parser.add_argument("--every", type=int, default=8, help="scans between the first ones of pairs")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    settings = load_settings("default").odometry
    table = Table(
        "recording", "pairs (both starts agree)", "odometry off", "reference off", "within 10 cm under either"
    )
    results = {}
    for name, sequence, seconds in cases(arguments):
        results[name] = row = compare(sequence, settings, seconds, arguments.every)
        if row["agreed"]:
            table.add_row(
                name,
                f"{row['pairs']} ({row['agreed']})",
                *(f"{row[key]:.2f} %" for key in ("odometry_percent", "reference_percent")),
                " / ".join(f"{100 * row[f'close_{who}']:.1f} %" for who in ("odometry", "reference")),
            )
        else:
            table.add_row(name, f"{row['pairs']} (0)", "-", "-", "-")
    Console(width=120).print(table)
    if arguments.json:
        arguments.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
