"""Who reads what we export: runs every proof and prints a table of export, reader and result.

    python benchmarks/consumers/table.py RUN [RUN ...] [--readers PYTHON] [--supervisely PYTHON] [--ros2 PYTHON]
        [--trainers PYTHON --repositories FOLDER]

Proofs by a package are tests; they run with the interpreter of an environment that has it, as `.ci/all` makes them:
`[dev-readers,dufomap]`, `[dev-supervisely]`, `[dev-ros2]`. Proofs by a loader of a repository need an environment with
torch, torchvision, pytorch-lightning, scipy, h5py, tqdm, kiss-icp, and clones (see `loaders.py`); they read data sets
made of the RUNs, the first of which is for training and the last for validation. What is not given is not proven, and
the table says so. Ends with 1 where a proof fails.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

ROOT = Path(__file__).parents[2]
WRITERS = "tests/writers/"
BY_TESTS = {
    "core": (
        ("dataset helimos", "reader of 4DMOS's contract", f"{WRITERS}training/test_make.py", "helimos_trainer"),
        ("dataset semantickitti", "reader of LiDAR-MOS's contract", f"{WRITERS}training/test_make.py", "range_image"),
        ("dataset semantickitti", "kiss-icp", f"{WRITERS}training/test_make.py", "kiss_icp"),
        ("clean, bags and MCAP", "rosbags", f"{WRITERS}cleaning/test_bags.py", "only_the_points"),
        ("clean, Livox messages", "rosbags", "tests/readers/test_livox_message.py", "cut_out"),
        ("clean, LAS", "laspy", f"{WRITERS}cleaning/test_folders.py", "every_column"),
        ("openpcdet", "reader of CustomDataset's contract", f"{WRITERS}test_detector_sets.py", "openpcdet"),
        ("mmdet3d", "reader of Det3DDataset's contract", f"{WRITERS}test_detector_sets.py", "mmdetection3d"),
        ("sustech", "own arithmetic", f"{WRITERS}test_box_files.py", "sustech"),
        ("laz", "laspy", f"{WRITERS}test_points.py", "laz"),
        ("parquet", "pyarrow", f"{WRITERS}test_points.py", "parquet"),
    ),
    "readers": (
        ("nuscenes-tables", "nuscenes-devkit", f"{WRITERS}test_detector_sets.py", "tables_of_nuscenes"),
        ("dynamicmap", "dufomap, and dufomap run on it", f"{WRITERS}test_detector_sets.py", "dufomap"),
        ("flow-av2", "av2", f"{WRITERS}test_flow_files.py", "argoverses_own"),
        ("opensceneflow", "h5py, its loader's contract", f"{WRITERS}test_flow_files.py", "opensceneflow_finds_all"),
        ("nuscenes", "nuscenes-devkit", f"{WRITERS}test_independent_readers.py", "devkit_reads_nuscenes"),
        ("kitti_tracking", "TrackEval", f"{WRITERS}test_independent_readers.py", "trackeval"),
        ("openlabel", "vcd", f"{WRITERS}test_independent_readers.py", "vcd"),
        ("cvat", "datumaro", f"{WRITERS}test_merge.py", "cvats_own"),
        ("segments", "segments-ai", f"{WRITERS}test_independent_readers.py", "sdk_takes"),
        ("pcd", "pypcd4", f"{WRITERS}test_independent_readers.py", "pypcd4"),
        ("ply", "plyfile", f"{WRITERS}test_independent_readers.py", "plyfile"),
        ("mcap", "mcap-ros2-support", f"{WRITERS}test_independent_readers.py", "mcap"),
    ),
    "supervisely": (("supervisely", "supervisely", f"{WRITERS}test_independent_readers.py", "supervisely"),),
    "ros2": (
        ("automos ros2", "rclpy, a process beside it", "tests/live/ros2/test_node.py", "every_cloud"),
        ("automos ros2, damaged clouds", "rclpy, a process beside it", "tests/live/ros2/test_node.py", "are_none"),
    ),
}
"""Of each environment: export, reader, file of tests and a part of the tests' names."""
LOADERS = {
    "4DMOS helimos": "dataset helimos",
    "MapMOS helimos": "dataset helimos",
    "4DMOS kitti": "dataset semantickitti",
    "MapMOS kitti": "dataset semantickitti",
    "LiDAR-MOS": "dataset semantickitti --residuals",
    "MotionSeg3D": "dataset semantickitti --residuals",
    "MF-MOS": "dataset semantickitti --residuals",
    "InsMOS": "dataset semantickitti --boxes",
    "OpenSceneFlow": "opensceneflow",
}
"""What each loader of a repository reads."""
Row = tuple[str, str, str]


def by_tests(python: str | None, rows: tuple[tuple[str, str, str, str], ...]) -> list[Row]:
    """Return the rows of one environment: all tests in one process, each row those whose names have its part."""
    if python is None:
        return [(export, reader, "not run") for export, reader, *_ in rows]
    files, parts = sorted({row[2] for row in rows}), " or ".join(dict.fromkeys(row[3] for row in rows))
    with tempfile.TemporaryDirectory() as scratch:
        report = Path(scratch) / "report.xml"
        command = [python, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "-k", parts, *files]
        environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
        subprocess.run([*command, f"--junit-xml={report}"], cwd=ROOT, env=environment, capture_output=True, check=False)
        cases = list(ElementTree.parse(report).iter("testcase")) if report.exists() else []
    found = []
    for export, reader, file, part in rows:
        place = file.removesuffix(".py").replace("/", ".")
        own = [case for case in cases if case.get("classname") == place and part in case.get("name", "").lower()]
        told = [next((child.tag for child in case), "ok") for case in own]
        result = "ok" if told and set(told) == {"ok"} else ", ".join(sorted(set(told))) or "no such test"
        found.append((export, reader, f"{result} ({len(told)} tests)"))
    return found


def by_loaders(python: str | None, repositories: Path | None, runs: list[Path]) -> list[Row]:
    """Return the rows of trainers' own loaders, on data sets made of `runs`."""
    if python is None or repositories is None:
        return [(export, f"{name}, its own loader", "not run") for name, export in LOADERS.items()]
    with tempfile.TemporaryDirectory() as scratch:
        automos = [sys.executable, "-m", "automos"]
        split = [] if len(runs) < 2 else ["--split", f"valid={runs[-1].name}"]
        sets = {"helimos": [], "semantickitti": ["--residuals", "1-8", "--boxes"]}
        for layout, extras in sets.items():
            out = ["--out", f"{scratch}/{layout}", "--layout", layout]
            subprocess.run([*automos, "dataset", *map(str, runs), *out, *split, *extras], stdout=sys.stderr, check=True)
        flow = ["export", str(runs[0]), "--to", "opensceneflow", "--out", f"{scratch}/opensceneflow"]
        subprocess.run([*automos, *flow], stdout=sys.stderr, check=True)
        found = []
        for name, export in LOADERS.items():
            command = [python, str(ROOT / "benchmarks" / "consumers" / "loaders.py"), name, str(repositories), scratch]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            last = (done.stderr.strip().splitlines() or ["?"])[-1]
            result = f"ok: {done.stdout.strip()}" if done.returncode == 0 else f"failure: {last}"
            found.append((export, f"{name}, its own loader", result))
    return found


def main() -> None:
    """Run what can be run, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="*", type=Path, help="results folders of automos label")
    for environment in ("readers", "supervisely", "ros2", "trainers"):
        parser.add_argument(f"--{environment}", metavar="PYTHON")
    parser.add_argument("--repositories", type=Path)
    given = parser.parse_args()
    pythons = {"core": sys.executable, **{name: getattr(given, name) for name in BY_TESTS if name != "core"}}
    rows = [row for name, tests in BY_TESTS.items() for row in by_tests(pythons[name], tests)]
    rows += by_loaders(given.trainers, given.repositories, given.runs)
    print("| export | reader | result |\n|---|---|---|")
    for row in rows:
        print(f"| {' | '.join(row)} |")
    sys.exit(any(not result.startswith(("ok", "not run")) for *_, result in rows))


if __name__ == "__main__":
    main()
