"""The first minute: what the demo makes, without a network and without torch."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from automos.cli.demo import run_demo
from automos.core.errors import InputError
from automos.settings import load_settings
from automos.views.topdown import COLORS, MOVING

ALONE = """
import socket, sys
class NoTorch:
    def find_spec(self, name, *_):
        if name.split(".")[0] == "torch": raise ModuleNotFoundError(name)
sys.meta_path.insert(0, NoTorch())
def refuse(*_, **__): raise OSError("there is no network")
socket.socket.connect = socket.create_connection = socket.getaddrinfo = refuse
from pathlib import Path
import automos.cli.demo
from automos.settings import load_settings
if len(sys.argv) > 2: automos.cli.demo.SCANS = int(sys.argv[2])
made = automos.cli.demo.run_demo(Path(sys.argv[1]), load_settings("default"), lambda *_: None)
print(made.scores.iou)
"""


def _run(folder: Path, *n_scans: str) -> float:
    command = [sys.executable, "-c", ALONE, str(folder), *n_scans]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return float(done.stdout)


@pytest.mark.slow
def test_it_draws_and_reports_without_a_network_or_torch(tmp_path):
    from matplotlib.image import imread

    folder = tmp_path / "demo"
    assert _run(folder, "16") > 0.7
    assert "IoU of the moving class" in (folder / "report.md").read_text()
    picture = (255 * imread(folder / "street.png")[..., :3]).round().astype(int)
    green = [int(COLORS[MOVING][1][k : k + 2], 16) for k in (1, 3, 5)]
    assert np.count_nonzero(np.abs(picture - green).max(axis=2) < 8) > 500
    is_grey = (np.ptp(picture, axis=2) < 12) & (picture.max(axis=2) < 215)
    assert np.count_nonzero(is_grey) > 10_000


@pytest.mark.slow
def test_its_first_run_fits_into_a_minute(tmp_path):
    """As a user runs it, everything compiled anew; the minute is that of two cores that do nothing else."""
    command = [sys.executable, "-m", "automos", "demo", "--out", str(tmp_path / "demo")]
    begin = time.monotonic()
    subprocess.run(command, capture_output=True, env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}, check=True)
    assert time.monotonic() - begin < 60.0
    iou = re.search(r"IoU of the moving class \| ([0-9.]+) %", (tmp_path / "demo" / "report.md").read_text())
    assert iou is not None
    assert float(iou[1]) > 90.0


def test_a_file_in_the_folders_place_is_told_before_anything_is_simulated(tmp_path):
    (tmp_path / "demo").write_text("")
    with pytest.raises(InputError, match="demo is a file: choose another --out"):
        run_demo(tmp_path / "demo", load_settings("default"), lambda *_: pytest.fail("it began to simulate"))
