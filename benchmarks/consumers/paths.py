"""Paths that KISS-ICP finds in recordings as they are and without movers, against reference poses.

    python benchmarks/consumers/paths.py RUN [RUN ...]

Each RUN is a results folder of `automos label`, of a recording in KITTI's layout with poses. `automos clean` writes it
into a temporary folder, and KISS-ICP's own loader reads both as folders of .bin files. Drift is KITTI's: the mean
relative error of translation over all parts of some lengths, and the absolute error (RMSE) once aligned.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from automos.core.geometry import inverse
from automos.results.open_run import open_run
from automos.results.run_files import RunFiles
from automos.writers.cleaning.clean import Choice, clean


def path_of(folder: Path) -> np.ndarray:
    """Return (N, 4, 4) the poses that KISS-ICP finds in a folder of .bin files."""
    from kiss_icp.config import KISSConfig
    from kiss_icp.datasets.generic import GenericDataset
    from kiss_icp.kiss_icp import KissICP

    scans = GenericDataset(folder)
    config = KISSConfig()
    config.data.deskew = False
    config.data.max_range, config.data.min_range = 100.0, 3.0
    config.mapping.voxel_size = 1.0
    odometry, poses = KissICP(config), []
    for index in range(len(scans)):
        frame, times = scans[index]
        odometry.register_frame(frame, times)
        poses.append(odometry.last_pose.copy())
    return np.stack(poses)


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


def compare(run: RunFiles) -> tuple[tuple[float, float], tuple[float, float], float]:
    """Return the errors with and without movers, and the share of points left out."""
    reference = run.sequence.reference_poses
    if reference is None:
        raise SystemExit(f"{run.sequence.name} has no reference poses")
    with tempfile.TemporaryDirectory() as scratch:
        _, points, left_out = clean(run, Path(scratch) / "without", choice=Choice.NOT_MOVING)
        folders = run.sequence.paths[0].parent, Path(scratch) / "without" / "velodyne"
        found = [errors(path_of(folder), reference) for folder in folders]
    return found[0], found[1], left_out / max(points, 1)


def main() -> None:
    """Print a row for each run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path)
    print("| recording | left out | drift with | without | RMSE with | without |\n|---|---|---|---|---|---|")
    for folder in parser.parse_args().runs:
        run = open_run(folder)
        (drift, rmse), (drift_without, rmse_without), share = compare(run)
        print(
            f"| {run.sequence.name} | {100 * share:.2f} % | {drift:.3f} % | {drift_without:.3f} % | {rmse:.3f} m | "
            f"{rmse_without:.3f} m |"
        )


if __name__ == "__main__":
    main()
