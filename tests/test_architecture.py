"""The rules of the house: who may import whom, names, lengths, and what the core never loads."""

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "src" / "automos"
FILES = sorted(SOURCE.rglob("*.py"))

ROOMS = (
    *({"core"}, {"settings"}),
    *({"odometry", "evidence", "objects"}, {"pipeline"}, {"online"}, {"labeler"}),
    *({"readers"}, {"evaluation"}, {"simulation"}, {"compiling"}),
    *({"results"}, {"writers"}, {"views"}, {"baselines"}, {"review"}, {"result"}, {"labeling"}),
    *({"live"}, {"network"}, {"fleet"}, {"cli"}, {"__main__"}),
)
"""From the base up: what is in one set may import what is in the sets before it, and nothing else."""

METHOD = {"core", "settings", "odometry", "evidence", "objects", "pipeline", "online", "labeler"}
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
    "pye57",
    "lazrs",
    "ouster",
    "selenium",
    "PIL",
)

OF_TORCH = {f"automos.network.{name}" for name in ("checkpoint", "export", "module", "salsanext", "training")}


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def name_of(path: Path) -> str:
    return path.relative_to(SOURCE).as_posix()


def room_of(path: Path) -> str:
    """Return the first name below automos: a package or a module."""
    return path.relative_to(SOURCE).with_suffix("").parts[0]


def imports_of(path: Path) -> set[str]:
    """Return the dotted names that a file imports from automos, wherever in the file."""
    found = set()
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}, line {node.lineno}: imports are absolute"
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= names if node.module == "automos" else {node.module}
    return {name for name in found if name.split(".")[0] == "automos"}


def rooms_imported(path: Path) -> set[str]:
    """Return the other rooms that a file imports."""
    rooms = {name.split(".")[1] for name in imports_of(path) if name.count(".")}
    return rooms - {"__version__", room_of(path)}


def test_a_room_imports_only_rooms_before_it():
    below: set[str] = set()
    allowed = {"__init__": set().union(*ROOMS)}  # public names, loaded on first use
    for beside in ROOMS:
        allowed |= {room: set(below) for room in beside}
        below |= beside
    for room in METHOD:
        allowed[room] &= METHOD
    strays = {name_of(path): rooms_imported(path) - allowed[room_of(path)] for path in FILES}
    assert {name: found for name, found in strays.items() if found} == {}


def test_the_method_needs_no_files():
    reached = {"settings/loading.py"}  # whose names the types alone know, see `settings/__init__.py`
    todo = ["automos.pipeline", "automos.labeler"]
    while todo:
        path = SOURCE.joinpath(*todo.pop().split(".")[1:])
        path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        if path.is_file() and name_of(path) not in reached:
            reached.add(name_of(path))
            todo += imports_of(path)
    files = {"workspace", "atomic", "claims", "reading", "run_record", "pose_files", "label_files"}
    assert {"objects/tracking.py", "core/stages.py"} <= reached
    assert not reached & {f"core/{name}.py" for name in files}


def test_the_rule_sees_imports_inside_functions():
    # the command line imports everything late, so a rule that looked only at the top of files would see nothing there
    assert {"automos.review.server", "automos.views.report"} <= imports_of(SOURCE / "cli" / "look.py")


def test_the_rule_names_every_room():
    assert set().union(*ROOMS) | {"__init__"} == {room_of(path) for path in FILES}


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
        for node in ast.walk(tree_of(path))
        if isinstance(node, functions)
    ]
    assert [(name, length) for name, length in lengths if length > 60] == []


def test_the_top_has_few_rooms():
    assert sum(path.is_dir() and path.name != "__pycache__" for path in SOURCE.iterdir()) <= 18
    assert sum(path.suffix == ".py" for path in SOURCE.iterdir()) <= 8


def test_the_command_line_and_the_settings_load_nothing_heavy():
    code = f"import sys, automos.cli, automos.settings; print(*sorted({HEAVY!r} & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []


def test_everything_but_the_network_can_be_imported_without_optional_packages():
    names = [".".join(["automos", *path.relative_to(SOURCE).with_suffix("").parts]) for path in FILES]
    names = [name.removesuffix(".__init__") for name in names if name not in OF_TORCH]
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
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.ImportFrom) and node.module != "automos":
            members = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= (members & set(modules)) or {node.module}
    return found & set(modules)
