"""The rules of the house: who may import whom, names, lengths, and what the core never loads."""

import ast
import re
import subprocess
import sys
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "src" / "automos"
FILES = sorted(SOURCE.rglob("*.py"))

BASE = {
    "labels",
    "label_files",
    "scan",
    "frames",
    "array_sequence",
    "own_sequence",
    "arrays",
    "arguments",
    "geometry",
    "upright_boxes",
    "settings",
    "errors",
    "extras",
    "atomic",
    "detections",
    "working_folder",
    "reading",
    "cells",
    "kernels",
    "voxels",
    "column_data",
    "covariances",
    "normal_equations",
}
MODELS = {"sensor", "ground", "trajectory"}
METHOD = {"candidates", "instances", "tracking"}
STAGES = {"odometry", "network", *METHOD}
COMPARED = {"baselines", "pipeline", "evaluation", "visualization"}
MAY_IMPORT = {
    **dict.fromkeys(BASE, BASE),
    "sensor": {*BASE, "sensor"},
    "ground": {*BASE, "ground"},
    "trajectory": {*BASE, "sensor"},
    **{stage: {*BASE, *MODELS, stage} for stage in STAGES},
    **{stage: {*BASE, *MODELS, stage, "parallel"} for stage in ("odometry", "network")},
    "loop_closure": {*BASE, "odometry", "trajectory"},
    "paper": {*BASE, *METHOD, "paper"},
    "stages": {*BASE, *MODELS, *METHOD, "paper", "baselines", "parallel", "stages", "workspace"},
    "__main__": {"cli"},
    "pose_files": BASE,
    "pose_writers": BASE,
    "datasets": {*BASE, "datasets", "pose_files"},
    "evaluation": {*BASE, "evaluation", "pose_files", "workspace"},
    "baselines": {*BASE, "baselines", "ground", "sensor", "paper", "parallel"},
    "comparison": {*BASE, *COMPARED, "comparison", "odometry", "trajectory", "run", "workspace"},
    "live": {*BASE, "live", "datasets", "odometry", "compiling", "labeler"},
    "mapping": {*BASE, "datasets", "mapping", "run"},
    "results": {
        *BASE,
        "results",
        "result",
        "evaluation",
        "datasets",
        "trajectory",
        "tracking",
        "pose_files",
        "pose_writers",
        "recording_warnings",
        "workspace",
    },
    "visualization": {*BASE, "visualization", "evaluation", "export", "labeler", "results", "workspace"},
    "scale": {
        *BASE,
        "scale",
        "pipeline",
        "labeling",
        "datasets",
        "results",
        "stages",
        "parallel",
        "workspace",
    },
    "review": {
        *BASE,
        "review",
        "visualization",
        "export",
        "results",
        "workspace",
        "stages",
        "trajectory",
        "tracking",
        "instances",
        "datasets",
    },
}
"""Rooms, and the other rooms they may import; one not named here may import any other but the command line."""

HEAVY = {"torch", "numba", "scipy", "matplotlib", "hdbscan", "sklearn", "kiss_icp", "small_gicp", "trimesh", "pandas"}
OPTIONAL = (
    "torch",
    "torchvision",
    "onnx",
    "onnxruntime",
    "rerun",
    "fsspec",
    "s3fs",
    "rerun_cli",
    "ray",
    "open3d",
    "rosbags",
    "velodyne_decoder",
    "mcap",
    "plotly",
    "pyarrow",
    "laspy",
    "lazrs",
    "ouster",
    "selenium",
    "PIL",
)


def name_of(path: Path) -> str:
    return path.relative_to(SOURCE).as_posix()


def room_of(path: Path) -> str:
    """Return the first name below automos: a package or a module."""
    return path.relative_to(SOURCE).with_suffix("").parts[0]


def imports_of(path: Path) -> set[str]:
    """Return the dotted names that a file imports from automos, wherever in the file."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}, line {node.lineno}: imports are absolute"
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= names if node.module == "automos" else {node.module}
    return {name for name in found if name.split(".")[0] == "automos"}


def test_a_module_imports_only_what_its_room_may_and_none_the_command_line():
    strays = {}
    for path in FILES:
        rooms = {name.split(".")[1] for name in imports_of(path) if name.count(".")} - {"__version__"}
        rooms -= {room_of(path)}
        strays[name_of(path)] = sorted(rooms - MAY_IMPORT.get(room_of(path), rooms - {"cli"}))
    assert {name: rooms for name, rooms in strays.items() if rooms} == {}


def test_the_rule_sees_imports_inside_functions():
    # the command line imports everything late, so a rule that looked only at the top of files would see nothing there
    assert {"automos.review.server", "automos.views.report"} <= imports_of(SOURCE / "cli" / "look.py")


def test_rooms_named_in_the_rule_are_there():
    assert set(MAY_IMPORT) <= {room_of(path) for path in FILES}


def test_a_module_is_named_after_its_idea():
    vague = {"util", "utils", "helper", "helpers", "manager", "misc", "common"}
    assert [name_of(path) for path in FILES if vague & set(re.split(r"\W|_", name_of(path)))] == []


def test_a_file_past_250_lines_is_two_ideas():
    lengths = {name_of(path): len(path.read_text().splitlines()) for path in FILES}
    assert {name: length for name, length in lengths.items() if length > 250} == {}


def test_a_function_fits_on_a_screen():
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    lengths = [
        (f"{name_of(path)}:{node.lineno} {node.name}", node.end_lineno - node.lineno + 1)
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, functions)
    ]
    assert [(name, length) for name, length in lengths if length > 60] == []


def test_the_method_stays_small():
    rooms = {"odometry", "candidates", "instances", "tracking"}
    assert sum(len(path.read_text().splitlines()) for path in FILES if room_of(path) in rooms) <= 4500


def test_the_command_line_and_the_settings_load_nothing_heavy():
    code = f"import sys, automos.cli, automos.settings; print(*sorted({HEAVY!r} & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []


def test_everything_but_the_network_can_be_imported_without_optional_packages():
    names = [".".join(["automos", *path.relative_to(SOURCE).with_suffix("").parts]) for path in FILES]
    names = [name.removesuffix(".__init__") for name in names if not name.startswith("automos.network")]
    code = (
        f"import sys, importlib\nsys.modules.update(dict.fromkeys({OPTIONAL!r}))\n"
        f"for name in {names!r}: importlib.import_module(name)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_files_import_each_other_in_no_circle():
    modules = {".".join(["automos", *path.relative_to(SOURCE).with_suffix("").parts]): path for path in FILES}
    modules = {name.removesuffix(".__init__"): path for name, path in modules.items()}
    needs = {name: files_imported(path, modules) for name, path in modules.items()}
    while free := {name for name, needed in needs.items() if not needed & set(needs)}:
        needs = {name: needed for name, needed in needs.items() if name not in free}
    assert needs == {}, "these import each other, or what does"


def files_imported(path: Path, modules: dict[str, Path]) -> set[str]:
    """Return those of `modules` that a file imports; `from package import module` imports the module."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module != "automos":
            members = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= (members & set(modules)) or {node.module}
    return found & set(modules)
