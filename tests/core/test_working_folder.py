"""What lies in the working folder is data: no process of ours runs it, no library takes settings from it."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from worlds import lane, write_bins

import automos

PLANTED = (
    "queue",
    "multiprocessing",
    "pickle",
    "numpy",
    "joblib",
    "runpy",
    "logging",
    "sitecustomize",
    "usercustomize",
)
SCRIPT = "import sys; from automos.cli import main; sys.exit(main())"


@pytest.fixture
def folder(tmp_path):
    """Return a folder with two recordings, and beside them modules that leave a file when they are run."""
    for name in ("a", "b"):
        write_bins(lane(4).sequence, tmp_path / "logs" / name)
    for name in PLANTED:
        (tmp_path / "logs" / f"{name}.py").write_text(
            f"open({str(tmp_path / name)!r}, 'w').close()\nraise SystemExit(9)\n"
        )
    (tmp_path / "logs" / ".numba_config.yaml").write_text(f"cache_dir: {tmp_path / 'numba'}\ndisable_jit: 1\n")
    (tmp_path / "logs" / "matplotlibrc").write_bytes(b"figure.dpi : \xff\n")
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "automos").write_text(SCRIPT)
    return tmp_path


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess:
    """Run the command as its installed script does: the script's own folder is where Python looks first."""
    environment = {**os.environ, "PYTHONPATH": str(Path(automos.__file__).parents[1]), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(folder / "bin" / "automos"), *arguments]
    return subprocess.run(
        command, cwd=folder / "logs", env=environment, capture_output=True, text=True, check=False, timeout=300
    )


def left_by_planted(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.name not in ("logs", "bin", "out"))


@pytest.mark.parametrize(
    "arguments",
    [
        pytest.param((".",), id="worker processes"),
        pytest.param(("a", "--preset", "paper"), id="joblib's", marks=pytest.mark.slow),
    ],
)
def test_modules_and_settings_beside_the_recordings_are_not_run(folder, arguments):
    done = run(folder, "label", *arguments, "--out", str(folder / "out"), "--workers", "2")
    assert done.returncode == 0, done.stderr
    assert left_by_planted(folder) == []


@pytest.mark.slow
def test_methods_compared_in_processes_of_their_own_do_not_run_them(folder):
    (folder / "logs" / "a" / "labels").mkdir()
    for i in range(4):
        n_points = (folder / "logs" / "a" / f"{i:06d}.bin").stat().st_size // 16
        np.zeros(n_points, np.uint32).tofile(folder / "logs" / "a" / "labels" / f"{i:06d}.label")
    done = run(folder, "compare", "a", "--out", str(folder / "out"), "--method", "yoon", "--workers", "1")
    assert done.returncode == 0, done.stderr
    assert left_by_planted(folder) == []


def test_processes_started_by_a_caller_of_the_library_do_not_run_them(folder):
    (folder / "bin" / "automos").write_text(
        "from automos.core.parallel import map_in_order\nprint(list(map_in_order(abs, [-1, -2], workers=2)))"
    )
    done = run(folder)
    assert (done.stdout.strip(), done.returncode) == ("[1, 2]", 0), done.stderr
    assert left_by_planted(folder) == []


def test_the_callers_environment_is_left_as_it_was(monkeypatch):
    from automos.core.parallel import map_in_order

    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    assert list(map_in_order(abs, [-1], workers=2)) == [1]
    assert "PYTHONSAFEPATH" not in os.environ
