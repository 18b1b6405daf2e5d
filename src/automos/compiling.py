"""Compiles the kernels in several processes on the first run; numba keeps them on disk.

Compiling holds numba's lock, so threads cannot share the work, but processes can. On a first run, other processes
compile the kernels for candidates and objects, each on an artificial recording, while this one reads files and
estimates poses. The shares have no kernel in common, or it would be compiled twice. `python -m automos.compiling`
compiles everything ahead of any run.
"""

import multiprocessing
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numba.core.caching import NullCache

from automos.core.array_sequence import ArraySequence
from automos.core.geometry import make_transform
from automos.core.made_up_sweep import BOX, HEIGHT, SPEED, box_center, made_up_sweep
from automos.core.parallel import SAFE_PATH, available_cores, end_with
from automos.core.scan import GROUND, OBJECT
from automos.core.stages import Arrays
from automos.evidence.stage import candidates_of
from automos.odometry.sweep_timing import SweepTiming
from automos.odometry.trajectory import Trajectory
from automos.pipeline import Steps
from automos.settings import load_settings

SHARES = ("poses", "candidates", "objects")
"""What is compiled apart, each about a third: odometry; free space; segments, tracks, verdicts and labels."""
LINE = "compiling once, which takes about a minute: this first run takes longer than those that follow"
ANEW = (
    "what is compiled cannot be kept, so every run compiles anew, about a minute: set NUMBA_CACHE_DIR to a folder that "
    "you may write to"
)


@contextmanager
def compiling_beside(report: Callable[[str], object], shares: tuple[str, ...]) -> Iterator[None]:
    """Compile `shares` of `SHARES` in a process each while the context's body runs, if this is the first run.

    report : called with one line for the user if something is to be compiled.
    """
    if not is_cold():
        if isinstance(getattr(_last_kernel(), "_cache", None), NullCache):
            report(ANEW)
        yield
        return
    report(LINE)
    beside = _started(shares) if available_cores() > 1 else []
    try:
        yield
    finally:
        for process in beside:
            if process.poll() is None:
                process.terminate()
                process.wait()


def _started(shares: tuple[str, ...]) -> list[subprocess.Popen]:
    """Start processes that compile `shares`: where one can part later, one, which reads the libraries for all."""
    together = [shares] if sys.platform == "linux" else [(share,) for share in shares]
    return [
        subprocess.Popen(
            [sys.executable, "-m", "automos.compiling", *some],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **SAFE_PATH},
        )
        for some in together
    ]


def is_cold() -> bool:
    """Return whether numba would compile the kernel that a run needs last, instead of finding it on disk.

    Numba is asked, which knows of what source, by which version and for which processor each file on disk is.
    """
    kernel = _last_kernel()
    index = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    if index is None:  # numba is set not to compile, or has no place to store the result
        return False
    processor = kernel.targetctx.codegen().magic_tuple()
    return not any(made_for == processor for _, made_for, _ in index._load_index())


def _last_kernel() -> Any:
    from automos.objects import object_points

    return object_points._around


def compile_all() -> None:
    """Label a small recording, so that all that labelling needs is compiled."""
    _small_run().labels()


def compile_shares(shares: list[str]) -> None:
    """Compile the kernels of several shares, each in a process that parts from this one and ends when this is ended."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # which ends daemons first
    context = multiprocessing.get_context("fork")
    parent, own = os.getppid(), os.getpid()
    parts = [context.Process(target=_compile_part, args=(share, own), daemon=True) for share in shares]
    for part in parts:
        part.start()
    end_with(parent)
    for part in parts:
        part.join()


def _compile_part(share: str, parent: int) -> None:
    end_with(parent)
    compile_share(share)


def compile_share(share: str) -> None:
    """Compile what one of `SHARES` needs; results of the stages before it are made up, so that these need nothing."""
    steps = _small_run()
    if share == "poses":
        steps.trajectory  # noqa: B018
        return
    n = len(steps.sequence)
    T, motion = np.tile(np.eye(4), (n, 1, 1)), np.zeros((n, 6))
    T[:, 0, 3], motion[:, 0] = SPEED * _STAMPS, 0.1 * SPEED
    timing = SweepTiming("azimuth", turn=1, seam_deg=180.0, share=1.0)
    steps.run.fill(
        "odometry", {"all": Trajectory(T, _STAMPS, motion, timing, make_transform(t=[0.0, 0.0, HEIGHT])).to_arrays()}
    )
    if share == "candidates":
        steps.candidates()
        return
    steps.run.fill(
        "candidates",
        {name: _made_up_candidates(steps.frames[i].points_level, _STAMPS[i]) for i, name in enumerate(steps.run.names)},
    )
    steps.labels()


def _small_run() -> Steps:
    recording = ArraySequence([made_up_sweep(t) for t in _STAMPS], _STAMPS)
    return Steps(recording, load_settings("default"), workers=1)


def _made_up_candidates(points_level: np.ndarray, stamp: float) -> Arrays:
    """Return what is known of a made-up sweep's points: the box has moved, the walls stay."""
    off = np.abs(points_level - box_center(stamp))
    log_odds = np.where((off < BOX + np.array([1.0, 0.1, 0.1])).all(axis=1), 4.0, -4.0)
    kind = np.where(points_level[:, 2] < 0.05, GROUND, OBJECT).astype(np.uint8)
    solidity = np.full(len(kind), 255, np.uint8)
    return candidates_of(log_odds, kind, points_level[:, 2], solidity, np.array([0.0145, 0.014]))


_STAMPS = np.array([0.1 * k for k in range(24)], np.float64)


if __name__ == "__main__":
    if len(sys.argv) > 2:
        compile_shares(sys.argv[1:])
    elif len(sys.argv) == 2:
        compile_share(sys.argv[1])
    else:
        compile_all()
