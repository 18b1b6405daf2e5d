"""No float32 makes a compiled kernel read or write beyond its arrays, hang or fail.

Reading beyond an array is seen for certain under bounds checks (CONTRIBUTING.md tells how to run the suite so).
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hostile_floats import CLOUDS
from hypothesis import given, settings
from kernels_beside import BESIDE
from kernels_of_stages import STAGES

ROOMS = {**STAGES, **BESIDE}

INTERPRETED = """
import sys
sys.path.insert(0, {folder!r})
import numpy as np
from hostile_floats import kernels as all_kernels
from kernels_beside import BESIDE
from kernels_of_stages import STAGES

kernels = {{(str(path), name) for path, name in all_kernels()}}
called = set()
def watch(frame, event, argument):
    if event == "call":
        called.add((frame.f_code.co_filename, frame.f_code.co_name))

ordinary = np.random.default_rng(0).normal(0.0, (8.0, 8.0, 1.0), (60, 3)).astype(np.float32)
damaged = ordinary.copy()
damaged[::7, 1], damaged[3::7, 2], damaged[5::7] = np.nan, 5e18, np.inf
sys.setprofile(watch)
with np.errstate(all="ignore"):
    for call in {{**STAGES, **BESIDE}}.values():
        call(ordinary)
        call(damaged)
sys.setprofile(None)
print(*sorted(f"{{path}}:{{name}}" for path, name in kernels - called), sep="\\n")
"""


@pytest.mark.parametrize("room", ROOMS)
@settings(max_examples=25)
@given(points=CLOUDS)
def test_every_float32_is_safe_for_the_kernels_of(room, points):
    with np.errstate(all="ignore"):
        ROOMS[room](points)


def test_every_kernel_is_called_and_makes_no_whole_number_of_what_is_none():
    # Interpreted instead of compiled, a kernel raises where int() is given infinity, and can be watched.
    code = INTERPRETED.format(folder=str(Path(__file__).parent))
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr[-3000:]
    assert run.stdout.split() == []
