"""Jobs of ours beside libraries': processes, trajectory errors, clusters, registration. Called by `libraries.py`."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from library_files import POINTS, best_ms

from automos.core.geometry import se3_exp
from automos.evaluation.trajectory import absolute_errors, errors_over_distance, rmse

POOLS = {
    "ours": """
from pathlib import Path
from automos.fleet.local_pool import LocalPool
from automos.fleet.orders import Job, Order, Recording
from automos.settings import load_settings
pool = LocalPool(2, 2)
for name in ("a", "b"):
    pool.submit(Order(Job(load_settings("default"), "out", Path("work")), Recording(name, "log")))
pids = pool.pids
""",
    "pebble": """
import multiprocessing, time
from pebble import ProcessPool
pool = ProcessPool(max_workers=2)
futures = [pool.schedule(time.sleep, args=(60,)) for _ in range(2)]
time.sleep(1.0)
pids = [process.pid for process in multiprocessing.active_children()]
""",
    "concurrent.futures": """
import time
from concurrent.futures import ProcessPoolExecutor
pool = ProcessPoolExecutor(2)
futures = [pool.submit(time.sleep, 60) for _ in range(2)]
time.sleep(1.0)
pids = list(pool._processes)
""",
}
"""Two workers at work, and their process numbers; ours label a recording that takes longer than the test."""


def pool() -> dict[str, dict]:
    """Return for each pool how many of two workers at work outlive their parent, killed, by five seconds."""
    import psutil

    from automos.simulation import simulate, write

    out = {}
    for name, code in POOLS.items():
        with tempfile.TemporaryDirectory() as folder:
            write(simulate("city", "HDL-64E", n_scans=20), Path(folder) / "log")
            program = code + "print(*pids, flush=True)\nimport time\ntime.sleep(60)\n"
            parent = subprocess.Popen([sys.executable, "-c", program], cwd=folder, stdout=subprocess.PIPE, text=True)
            pids = [int(pid) for pid in parent.stdout.readline().split()]
            time.sleep(3.0)
            parent.kill()
            parent.wait()
            time.sleep(5.0)
            left = [p for p in map(_process, pids) if p is not None and p.status() != psutil.STATUS_ZOMBIE]
            out[name] = {"workers": len(pids), "left after the parent was killed": len(left)}
            for process in left:
                process.kill()
    return out


def _process(pid: int):
    import psutil

    return psutil.Process(pid) if psutil.pid_exists(pid) else None


def trajectory() -> dict[str, dict]:
    """Return time and figures on 1,000 poses that drift and jitter: rms of absolute errors, mean error over 10 m."""
    rng = np.random.default_rng(0)
    steps = [se3_exp([1.0, 0.0, 0.0, 0.0, 0.0, 0.02 * np.sin(0.02 * i)]) for i in range(1000)]
    true = np.array([*_chained(steps)])
    found = np.array([*_chained([step @ se3_exp(rng.normal(0.0, 2e-3, 6)) for step in steps])])
    measures = {"ours": lambda: (rmse(absolute_errors(found, true)), errors_over_distance(found, true, 10.0))}
    ate, rpe = measures["ours"]()
    out = {"ours": {"ms": best_ms(measures["ours"]), "ATE": ate, "RPE over 10 m": float(rpe.translation.mean())}}
    try:
        from evo.core import metrics
        from evo.core.trajectory import PosePath3D
    except ImportError as error:
        return out | {"evo": {"left out": str(error)}}

    def theirs():
        reference, estimate = PosePath3D(poses_se3=[*true]), PosePath3D(poses_se3=[*found])
        relative = metrics.RPE(metrics.PoseRelation.translation_part, 10.0, metrics.Unit.meters, all_pairs=True)
        relative.process_data((reference, estimate))
        estimate.align(reference)
        absolute = metrics.APE(metrics.PoseRelation.translation_part)
        absolute.process_data((reference, estimate))
        return absolute.get_statistic(metrics.StatisticsType.rmse), relative.get_statistic(metrics.StatisticsType.mean)

    return out | {"evo": {"ms": best_ms(theirs), "ATE": theirs()[0], "RPE over 10 m": float(theirs()[1])}}


def _chained(steps):
    T = np.eye(4)
    for step in steps:
        yield T
        T = T @ step


def clusters() -> dict[str, dict]:
    """Return milliseconds to the tree of densities of 5,000 and 20,000 points, and whether it can be cut publicly."""
    from hdbscan import HDBSCAN
    from sklearn.cluster import HDBSCAN as HDBSCAN_OF_SKLEARN

    made = {
        "hdbscan": lambda p: HDBSCAN(min_cluster_size=5, core_dist_n_jobs=1).fit(p),
        "scikit-learn": lambda p: HDBSCAN_OF_SKLEARN(min_cluster_size=5, copy=True).fit(p),
    }
    return {
        name: {f"ms, {n} points": best_ms(lambda fit=fit, n=n: fit(POINTS[:n]), 2) for n in (5000, 20000)}
        | {"tree is public": hasattr(fit(POINTS[:500]), "single_linkage_tree_")}
        for name, fit in made.items()
    }


def registration() -> dict[str, dict]:
    """Return milliseconds to register a scan on the map of the one before, and how far the two poses are apart."""
    from kiss_icp.mapping import VoxelHashMap
    from kiss_icp.registration import Registration

    from automos.core.voxels import rows_of_first_in_voxel
    from automos.odometry.registration import LocalMap, align
    from automos.simulation import simulate

    first, second = (scan.points for scan in simulate("city", "HDL-64E", n_scans=2, compensated=True))
    source, guess = second[rows_of_first_in_voxel(second, 1.5)], np.eye(4)
    ours, theirs = LocalMap(1.0, 20, 100.0), VoxelHashMap(1.0, 100.0, 20)
    ours.add(first.astype(np.float64), np.zeros(3))
    theirs.add_points(first.astype(np.float64))
    authors = Registration(500, 1e-4, 1)
    calls = {
        "ours": lambda: align(source, guess, ours, 0.5),
        "kiss-icp": lambda: authors.align_points_to_map(source.astype(np.float64), theirs, guess, 1.5, 0.5),
    }
    poses = [call() for call in calls.values()]
    apart = float(np.abs(poses[0] - poses[1]).max())
    return {name: {"points": len(source), "ms": best_ms(call), "apart": apart} for name, call in calls.items()}
