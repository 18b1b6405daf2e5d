"""Fixtures every test may use."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings

# The same examples on every run: a failure seen once is seen again. The first call of a kernel may compile it.
settings.register_profile("automos", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("automos")

_NAMES = ("kitti_0005", "kitti_0027")


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Return a folder that holds sequences/kitti_0005 and sequences/kitti_0027, real drives in KITTI's layout.

    The environment variable AUTOMOS_RECORDINGS names it. Without it, packed recordings in a folder `shared/data` beside
    the repository are unpacked once into the system's temporary folder. Without either, the test is skipped.
    """
    named = os.environ.get("AUTOMOS_RECORDINGS")
    packed = Path(__file__).resolve().parents[2] / "shared" / "data"
    if named:
        root = Path(named)
    elif (packed / "unpack.py").exists() and any(packed.glob("*/*.tar")):
        root = _unpack_once(packed)
    else:
        pytest.skip("real recordings are not here: set AUTOMOS_RECORDINGS to a folder that holds sequences/")
    missing = [name for name in _NAMES if not (root / "sequences" / name).is_dir()]
    if missing:
        pytest.skip(f"{root / 'sequences'} holds no {', '.join(missing)}")
    return root


def _unpack_once(packed: Path) -> Path:
    """Unpack behind a file lock, so that parallel workers and later sessions share one copy."""
    import fcntl

    root = Path(tempfile.gettempdir()) / f"automos-recordings-{os.getuid()}"
    root.mkdir(exist_ok=True)
    with open(root / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        done = root / "unpacked"
        if not done.exists():
            subprocess.run([sys.executable, packed / "unpack.py", root, *_NAMES], check=True, stdout=subprocess.DEVNULL)
            done.touch()
    return root
