"""Who reads what we export: runs every proof and prints a table of export, reader and result.

    python benchmarks/consumers/table.py [RUN ...] [--environments FOLDER] [--only NAME ...]

Proofs by a package are tests. Each family of readers gets an environment of its own in FOLDER, which is kept; one that
is there is used as it is. Proofs by a trainer's own loader run on data sets made of the RUNs (the first is for
training, the last for validation; two worlds are simulated and labelled if none is given), with clones of the trainers'
repositories in FOLDER/repositories. The RUNs, of recordings in folders of .bin, are also what is compared point for
point with and without movers. What cannot be installed is not proven, and the table says so. Ends with 1 where a proof
fails.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

ROOT = Path(__file__).parents[2]
WRITERS = "tests/writers/"
POINTS = f"{WRITERS}cleaning/test_point_for_point.py"
ENVIRONMENTS = {
    "readers": ["{here}[dev-readers,dufomap]"],
    "supervisely": ["{here}[dev-supervisely]"],
    "ros2": ["{here}[dev-ros2]"],
    "ncore": ["{here}[dev,ncore]"],
    "odometry": ["{here}[dev]", "rko-lio", "evalio"],
    "t4": ["{here}[dev]", "colorama", "t4-devkit @ git+https://github.com/tier4/t4-devkit@4496b3e"],
    "trainers": ["torch", "torchvision", "pytorch-lightning", "scipy", "h5py", "tqdm", "kiss-icp", "PyYAML"],
}
"""What each environment has installed; `core` is the one that runs this."""
REPOSITORIES = {
    "4DMOS": "PRBonn",
    "MapMOS": "PRBonn",
    "LiDAR-MOS": "PRBonn",
    "MotionSeg3D": "haomo-ai",
    "MF-MOS": "SCNU-RISLAB",
    "InsMOS": "nubot-nudt",
    "OpenSceneFlow": "KTH-RPL",
}
"""Who has each repository."""
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
        (
            "drivestudio",
            "its loader's contract",
            f"{WRITERS}test_reconstruction.py",
            "drivestudio_finds",
        ),
    ),
    "ncore": (("ncore", "nvidia-ncore", f"{WRITERS}test_reconstruction.py", "ncores_loader"),),
    "t4": (("t4", "t4-devkit, its sanity check", f"{WRITERS}test_detector_sets.py", "tier_iv"),),
    "odometry": (
        ("clean, a bag with an IMU", "rko-lio", f"{WRITERS}cleaning/test_lidar_inertial.py", "rko_lio"),
        ("clean, a bag with an IMU", "evalio", f"{WRITERS}cleaning/test_lidar_inertial.py", "evalio"),
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
        ("clean, .bin", "numpy, every byte", POINTS, "four_floats"),
        ("clean --as bin", "numpy, every point", POINTS, "numpy"),
        ("clean --as pcd", "pypcd4, every point", POINTS, "as_pcd"),
        ("clean --as laz", "laspy, every point", POINTS, "laspy"),
        ("clean, PCD and LAZ", "pypcd4 and laspy, every field", POINTS, "every_field"),
        ("clean, bags with an IMU and tf", "rosbags, every message", POINTS, "nothing_else"),
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


def by_tests(python: str | None, rows: tuple[tuple[str, str, str, str], ...], runs: list[Path]) -> list[Row]:
    """Return the rows of one environment: all tests in one process, each row those whose names have its part."""
    if python is None:
        return [(export, reader, "not run") for export, reader, *_ in rows]
    files, parts = sorted({row[2] for row in rows}), " or ".join(dict.fromkeys(row[3] for row in rows))
    with tempfile.TemporaryDirectory() as scratch:
        report = Path(scratch) / "report.xml"
        command = [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", parts, *files]
        inherited = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
        inherited["AUTOMOS_RUNS"] = os.pathsep.join(str(run.absolute()) for run in runs)
        subprocess.run([*command, f"--junit-xml={report}"], cwd=ROOT, env=inherited, capture_output=True, check=False)
        cases = list(ElementTree.parse(report).iter("testcase")) if report.exists() else []
    found = []
    for export, reader, file, part in rows:
        place = file.removesuffix(".py").replace("/", ".")
        own = [case for case in cases if case.get("classname") == place and part in case.get("name", "").lower()]
        told = [next((child.tag for child in case), "ok") for case in own]
        result = "ok" if told and set(told) == {"ok"} else ", ".join(sorted(set(told))) or "no such test"
        found.append((export, reader, f"{result} ({len(told)} tests)"))
    return found


def by_loaders(python: str | None, repositories: Path, runs: list[Path]) -> list[Row]:
    """Return the rows of trainers' own loaders, on data sets made of `runs`."""
    if python is None:
        return [(export, f"{name}, its own loader", "not run") for name, export in LOADERS.items()]
    for name, owner in REPOSITORIES.items():
        if not (repositories / name).exists():
            address = f"https://github.com/{owner}/{name}"
            subprocess.run(["git", "clone", "-q", "--depth", "1", address, str(repositories / name)], check=False)
    with tempfile.TemporaryDirectory() as scratch:
        runs = runs or simulated_runs(Path(scratch))
        split = [] if len(runs) < 2 else ["--split", f"valid={runs[-1].name}"]
        for layout, extras in {"helimos": [], "semantickitti": ["--residuals", "1-8", "--boxes"]}.items():
            automos("dataset", *runs, "--out", f"{scratch}/{layout}", "--layout", layout, *split, *extras)
        automos("export", runs[0], "--to", "opensceneflow", "--out", f"{scratch}/opensceneflow")
        found = []
        for name, export in LOADERS.items():
            command = [python, str(ROOT / "benchmarks" / "consumers" / "loaders.py"), name, str(repositories), scratch]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            last = (done.stderr.strip().splitlines() or ["?"])[-1]
            result = f"ok: {done.stdout.strip()}" if done.returncode == 0 else f"failure: {last}"
            found.append((export, f"{name}, its own loader", result))
    return found


def automos(*words: object) -> None:
    """Run a command of this copy of AutoMOS."""
    inherited = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    command = [sys.executable, "-m", "automos", *map(str, words)]
    subprocess.run(command, stdout=sys.stderr, env=inherited, check=True)


def simulated_runs(folder: Path) -> list[Path]:
    """Return results of two simulated worlds."""
    for seed in (1, 2):
        world = folder / f"world{seed}"
        automos("simulate", world, "--sensor", "HDL-32E", "--scans", 30, "--seed", seed)
        automos("label", world, "--out", folder / "runs" / world.name)
    return sorted((folder / "runs").iterdir())


def environment(folder: Path, name: str) -> str | None:
    """Return the interpreter of environment `name`, which is made where it is not there; None where it cannot be."""
    python = folder / name / "bin" / "python"
    if not python.exists():
        wanted = [what.format(here=ROOT) for what in ENVIRONMENTS[name]]
        made = subprocess.run([sys.executable, "-m", "venv", str(folder / name)], check=False)
        words = [str(python), "-m", "pip", "install", "-q", *wanted]
        if made.returncode or subprocess.run(words, stdout=sys.stderr, check=False).returncode:
            shutil.rmtree(folder / name, ignore_errors=True)
            return None
    return str(python)


def main() -> None:
    """Run what can be run, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="*", type=Path, help="results folders of automos label")
    parser.add_argument("--environments", type=Path, default=Path.home() / ".cache" / "automos-consumers")
    parser.add_argument("--only", nargs="+", choices=["core", *ENVIRONMENTS], default=["core", *ENVIRONMENTS])
    given = parser.parse_args()
    folder = given.environments.absolute()
    folder.mkdir(parents=True, exist_ok=True)
    pythons = {name: environment(folder, name) for name in given.only if name != "core"}
    pythons["core"] = sys.executable if "core" in given.only else None
    rows = [row for name, tests in BY_TESTS.items() for row in by_tests(pythons.get(name), tests, given.runs)]
    rows += by_loaders(pythons.get("trainers"), folder / "repositories", given.runs)
    print("| export | reader | result |\n|---|---|---|")
    for row in rows:
        print(f"| {' | '.join(row)} |")
    sys.exit(any(not result.startswith(("ok", "not run")) for *_, result in rows))


if __name__ == "__main__":
    main()
