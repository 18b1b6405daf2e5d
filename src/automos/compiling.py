"""Kernels are compiled once, when they first run, and kept on disk by numba; on the first run, two at a time.

Compiling takes numba's lock, so threads do not share it out; processes do. On a first run a second process labels a
small made-up recording while this one reads files and finds the poses of the real one: when candidates, instances and
labels are looked for, their kernels are there. `python -m automos.compiling` compiles all, ahead of any run.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from automos.parallel import available_cores
from automos.working_folder import SAFE_PATH

LINE = "compiling once: this first run takes longer than those that follow"


@contextmanager
def compiling_beside(tell: Callable[[str], object], knows_poses: bool) -> Iterator[None]:
    """Compile what labelling needs in a process of its own while the context's body runs, if this is the first run.

    Parameters
    ----------
    tell : called with one line for the user where something is to be compiled.
    knows_poses : whether the kernels of odometry are left to the body.
    """
    if not is_cold():
        yield
        return
    tell(LINE)
    if available_cores() == 1:
        yield
        return
    beside = subprocess.Popen(
        [sys.executable, "-m", "automos.compiling", *(["knows_poses"] if knows_poses else [])],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **SAFE_PATH},
    )
    try:
        yield
    finally:
        if beside.poll() is None:
            beside.terminate()
            beside.wait()


def is_cold() -> bool:
    """Return whether the kernel that a run needs last was not compiled since this copy was installed."""
    from automos.tracking import completion

    kept = getattr(completion._fill, "stats", None)
    if kept is None or kept.cache_path is None:  # numba was told not to compile, or has no place for what it compiles
        return False
    source = Path(completion.__file__).stat().st_mtime
    return not any(file.stat().st_mtime >= source for file in Path(kept.cache_path).glob("completion._fill-*.nbi"))


def compile_all(knows_poses: bool = False) -> None:
    """Label a small recording, so that all that labelling needs is compiled; odometry too, unless it `knows_poses`."""
    from automos.array_sequence import ArraySequence
    from automos.pipeline import label

    stamps = 0.1 * np.arange(24)
    poses = np.tile(np.eye(4), (len(stamps), 1, 1))
    poses[:, 0, 3] = _SPEED * stamps
    label(ArraySequence([made_up_sweep(t) for t in stamps], stamps), poses=poses if knows_poses else None, workers=1)


_SPEED = 3.0
"""Metres per second of the sensor, so that its sweeps need compensation."""


def made_up_sweep(stamp: float) -> np.ndarray:
    """Return (N, 3) points: in a walled square, a box as large as a car overtakes the sensor."""
    turn, elevation = np.meshgrid(np.arange(0.1, 360.0, 0.8) / 360.0, np.linspace(-0.38, 0.07, 32), indexing="ij")
    azimuth, time = 2.0 * np.pi * turn.ravel() - np.pi, stamp + 0.1 * turn.ravel() - 0.05
    rays = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation.ravel())])
    ahead = np.array([1.0, 0.0, 0.0])
    sensor = _SPEED * time[:, None] * ahead + np.array([0.0, 0.0, 1.8])
    distance = ((np.where(rays > 0, [30.0, 12.0, np.inf], [-20.0, -12.0, 0.0]) - sensor) / rays).min(axis=1)
    car, half = 9.0 * time[:, None] * ahead + np.array([-7.0, 5.0, 0.8]), np.array([2.0, 0.9, 0.7])
    faces = np.sort([(car - half - sensor) / rays, (car + half - sensor) / rays], axis=0)
    enters, leaves = faces[0].max(axis=1), faces[1].min(axis=1)
    return np.where((enters > 0) & (enters < leaves), enters, distance)[:, None] * rays


if __name__ == "__main__":
    compile_all(knows_poses="knows_poses" in sys.argv[1:])
