"""Paths that KISS-ICP finds in recordings as they are and without movers, against reference poses.

    python benchmarks/consumers/paths.py RUN [RUN ...] [--starts 9]

Each RUN is a results folder of `automos label`, of a recording in KITTI's layout with poses. `automos clean` writes it
into a temporary folder, and KISS-ICP's own loader reads both as folders of .bin files. One path is a draw: each is
found from several STARTS, the first 0, 1, 2 ... scans left out, and judged from where the last has begun. Drift is
KITTI's: the mean relative error of translation over all parts of some lengths; RMSE is the absolute error from the
common first pose. Printed are medians, and those of the differences, without minus with, start by start, with the
lowest and the highest.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from automos.core.geometry import inverse
from automos.results.open_run import open_run
from automos.results.run_files import RunFiles
from automos.writers.cleaning.clean import Choice, clean


def paths_of(folder: Path, starts: int) -> list[np.ndarray]:
    """Return (N, 4, 4) poses that KISS-ICP finds in a folder of .bin files, for each start, from the last one on."""
    from kiss_icp.config import KISSConfig
    from kiss_icp.datasets.generic import GenericDataset
    from kiss_icp.kiss_icp import KissICP

    scans = GenericDataset(folder)
    frames = [scans[index] for index in range(len(scans))]
    config, found = KISSConfig(), []
    config.data.deskew = False
    config.data.max_range, config.data.min_range = 100.0, 3.0
    config.mapping.voxel_size = 1.0
    for start in range(starts):
        odometry, poses = KissICP(config), []
        for frame, times in frames[start:]:
            odometry.register_frame(frame, times)
            poses.append(odometry.last_pose.copy())
        found.append(np.stack(poses)[starts - 1 - start :])
    return found


def errors(poses: np.ndarray, reference: np.ndarray) -> tuple[float, float]:
    """Return the drift in per cent over parts of 5 to 100 m, and the RMSE in metres from the common first pose."""
    steps = np.linalg.norm(np.diff(reference[:, :3, 3], axis=0), axis=1)
    driven = np.concatenate([[0.0], np.cumsum(steps)])
    shares = []
    for length in (5.0, 10.0, 20.0, 50.0, 100.0):
        for start in range(0, len(poses), 5):
            end = int(np.searchsorted(driven, driven[start] + length))
            if end < len(poses):
                found = inverse(poses[start]) @ poses[end]
                true = inverse(reference[start]) @ reference[end]
                shares.append(np.linalg.norm((inverse(true) @ found)[:3, 3]) / length)
    apart = (inverse(poses[0]) @ poses)[:, :3, 3] - (inverse(reference[0]) @ reference)[:, :3, 3]
    return 100.0 * float(np.mean(shares)) if shares else np.nan, float(np.sqrt((apart**2).sum(1).mean()))


def compare(run: RunFiles, starts: int = 1) -> tuple[np.ndarray, np.ndarray, float]:
    """Return (starts, 2) the errors with movers and (starts, 2) without, and the share of points left out."""
    reference = run.sequence.reference_poses
    if reference is None:
        raise SystemExit(f"{run.sequence.name} has no reference poses")
    with tempfile.TemporaryDirectory() as scratch:
        _, points, left_out = clean(run, Path(scratch) / "without", choice=Choice.NOT_MOVING)
        folders = run.sequence.paths[0].parent, Path(scratch) / "without" / "velodyne"
        found = [[errors(path, reference[starts - 1 :]) for path in paths_of(folder, starts)] for folder in folders]
    return np.array(found[0]), np.array(found[1]), left_out / max(points, 1)


def row(name: str, with_movers: np.ndarray, without: np.ndarray, share: float) -> str:
    """Return a line of the table."""
    cells = [name, f"{100 * share:.2f} %"]
    for one, other, unit in zip(with_movers.T, without.T, ("%", "m"), strict=True):
        apart = other - one
        spread = f"{np.median(apart):+.3f} ({apart.min():+.3f} to {apart.max():+.3f})"
        cells += [f"{np.median(one):.3f} {unit}", f"{np.median(other):.3f} {unit}", spread]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Print a row for each run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--starts", type=int, default=9)
    given = parser.parse_args()
    errors_of = "with | without | difference"
    print(f"| recording | left out | drift {errors_of} | RMSE {errors_of} |\n|{'---|' * 8}")
    for folder in given.runs:
        run = open_run(folder)
        print(row(run.sequence.name, *compare(run, given.starts)), flush=True)


if __name__ == "__main__":
    main()
