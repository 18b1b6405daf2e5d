"""Code of ours beside a library for the same job: speed, faults, size, licence. docs/architecture.md has the decisions.

All libraries: `pip install plyfile pypcd4 pillow pebble evo scikit-learn kiss-icp psutil`. Times are the best of five,
on one thread. A damaged file is a copy cut short, with one byte of its header changed, with a count beyond all memory,
or with more bytes than it promises; all readers read the same 402 copies.
"""

from __future__ import annotations

import importlib.metadata as metadata
import re
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from automos.core.errors import InputError
from automos.core.geometry import se3_exp
from automos.evaluation.trajectory import absolute_errors, errors_over_distance, rmse
from automos.readers import npy, pcd, ply
from automos.readers.columns import coordinates
from automos.writers.pcd import write_pcd

N = 120_000
_RNG = np.random.default_rng(0)
POINTS = _RNG.uniform([-60, -60, -2], [60, 60, 4], (N, 3)).astype(np.float32)
COLUMNS = {**dict(zip("xyz", POINTS.T, strict=True)), "intensity": POINTS[:, 0], "ring": np.arange(N, dtype="u2") % 64}
ROWS = np.rec.fromarrays([*COLUMNS.values()], names=[*COLUMNS])


def best_ms(call: Callable[[], object], repeat: int = 5) -> float:
    """Return the milliseconds of the fastest of `repeat` calls, after one that compiles and warms caches."""
    call()
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - start))
    return round(min(times), 2)


def files() -> dict[str, dict[str, float]]:
    """Return time and outcomes for every reader that is installed."""
    with tempfile.TemporaryDirectory() as folder:
        whole = _write_all(Path(folder))
        out = {}
        for suffix, name, read in _readers():
            found = {"ms": best_ms(lambda read=read, path=whole[suffix]: read(path))}
            bad = Path(folder) / f"bad{suffix}"
            counts: Counter[str] = Counter()
            for raw in _damaged(whole[suffix].read_bytes()):
                bad.write_bytes(raw)
                with np.errstate(all="ignore"):
                    counts[_outcome(read, bad)] += 1
            out[f"{suffix}, {name}"] = found | dict(sorted(counts.items()))
    return out


def _readers() -> Iterator[tuple[str, str, Callable]]:
    yield ".npy", "ours on numpy.load", _checked(npy.read)
    yield ".npy", "numpy.load alone", lambda path: np.load(path, allow_pickle=False)
    yield ".pcd", "ours", _checked(pcd.read)
    yield ".ply", "ours", _checked(ply.read)
    try:
        from pypcd4 import PointCloud

        yield ".pcd", "pypcd4", lambda path: PointCloud.from_path(path).pc_data
    except ImportError as error:
        print(error)
    try:
        from plyfile import PlyData

        yield ".ply", "plyfile", lambda path: PlyData.read(path)["vertex"].data
    except ImportError as error:
        print(error)


def _checked(read: Callable) -> Callable:
    """Return a reader of ours with the check for x, y and z that every scan passes."""

    def checked(path: Path) -> dict:
        columns = read(path)
        coordinates(columns, path)
        return columns

    return checked


def _write_all(folder: Path) -> dict[str, Path]:
    paths = {suffix: folder / f"scan{suffix}" for suffix in (".npy", ".pcd", ".ply")}
    np.save(paths[".npy"], ROWS)
    write_pcd(paths[".pcd"], COLUMNS)
    kinds = "".join(f"property {'ushort' if name == 'ring' else 'float'} {name}\n" for name in COLUMNS)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {N}\n{kinds}end_header\n"
    paths[".ply"].write_bytes(head.encode() + ROWS.tobytes())
    return paths


def _damaged(raw: bytes, n: int = 200) -> Iterator[bytes]:
    rng = np.random.default_rng(1)
    for _ in range(n):
        yield raw[: rng.integers(0, len(raw))]
        at = rng.integers(0, 150)
        yield raw[:at] + bytes([rng.integers(0, 256)]) + raw[at + 1 :]
    yield raw.replace(str(N).encode(), b"999999999999")
    yield raw + raw[-17_000:]


def _outcome(read: Callable, path: Path) -> str:
    try:
        found = read(path)
        is_whole = all(np.array_equal(found[axis], ROWS[axis]) for axis in "xyz")
    except Exception as error:
        if isinstance(error, InputError):
            return "error that names the file"
        is_own = isinstance(error, ValueError) or type(error).__module__.partition(".")[0] in ("plyfile", "pypcd4")
        return "its own error or ValueError" if is_own else f"{type(error).__name__} from within"
    return "points, right" if is_whole else "points, wrong"


def images() -> dict[str, dict[str, float]]:
    """Return time and bytes of a picture of a million pixels in eight colours, as the report's map is made of."""
    from automos.views.png import palette_png

    height, width, colors = 1000, 1000, _RNG.integers(0, 256, (8, 4), np.uint8)
    picture = (_RNG.random((height, width)) ** 4 * 8).astype(np.uint8)

    def by_hand() -> bytes:
        head = struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)
        rows = zlib.compress(np.pad(picture, ((0, 0), (1, 0))).tobytes(), 9)
        chunks = {b"IHDR": head, b"PLTE": colors[:, :3].tobytes(), b"tRNS": colors[:, 3].tobytes(), b"IDAT": rows}
        out = b"\x89PNG\r\n\x1a\n"
        for kind, content in (chunks | {b"IEND": b""}).items():
            out += struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        return out

    both = {"numpy and zlib": by_hand, "Pillow (ours)": lambda: palette_png(picture, colors)}
    return {name: {"ms": best_ms(write), "bytes": len(write())} for name, write in both.items()}


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


def packages() -> dict[str, dict]:
    """Return version, licence and megabytes of each library, and of all it needs beyond what AutoMOS needs."""
    base = _needs("automos-lidar", set())
    out = {}
    for name in ("numpy", "pillow", "plyfile", "pypcd4", "pebble", "evo", "hdbscan", "scikit-learn", "kiss-icp"):
        try:
            about = metadata.metadata(name)
        except metadata.PackageNotFoundError:
            continue
        licence = about.get("License-Expression") or (about.get("License") or "").split("\n")[0][:40]
        more = _needs(name, set()) - base
        sizes = {"own MB": _megabytes(name), "MB beside ours": round(sum(map(_megabytes, more)), 1)}
        out[name] = {"version": about["Version"], "licence": licence or "see its classifiers"} | sizes
    return out


def _needs(name: str, seen: set[str]) -> set[str]:
    """Return the installed packages that `name` needs, itself among them."""
    name = re.sub(r"[-_.]+", "-", name).lower()
    if name not in seen:
        try:
            needs = metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            return seen
        seen.add(name)
        for need in needs:
            if "extra ==" not in need:
                _needs(re.match(r"[\w.-]+", need)[0], seen)
    return seen


def _megabytes(name: str) -> float:
    sizes = (file.locate().stat().st_size for file in metadata.files(name) or () if file.locate().is_file())
    return round(sum(sizes) / 1e6, 1)


PARTS = (files, images, pool, trajectory, clusters, packages)


def part(store: Path, job: str) -> dict[str, Any]:
    """Return what was measured of each implementation of a job, by the name of its function above."""
    return {"found": {each.__name__: each for each in PARTS}[job]()}
